"""Constraint rows from body poses, one loop a kind: rows of H = [Phi_r, Phi_pi'], 2 x 8 floats, in place of Phi_q.

A virtual displacement of a body is (dr, dpi') with dpi' = 2 G dp in the body frame: six numbers and no normalisation
row. A row of H holds the entries of body a, then of body b, each as (force, 0, body torque, 0).
"""

from ...jit.kernels import ANY, caller, integers, part, stack, stack2, vector
from ...jit.simd import get, let, put, splat
from .body_poses import POSE, add_gradient, marker_motion, marker_position
from .template import (
    CODES,
    MARKERS,
    OWNERS,
    ROOM,
    ROWS,
    SIZE,
    STARTS,
    acceleration_bias,
    differentiate,
    kernel_phi,
    kernel_value,
)

SIGNATURE = "iippppdpp"  # count, reals per instance, table, reals, poses, unused, t, out, H
call_body_loop = caller(SIGNATURE)
# of the graph's table for each instance: places of its two bodies among the poses, its first row, a mask of markers
BODY, ROW, MASK, INTS = 0, 2, 3, 4


@part
def _place_markers(table, own, reals, real, poses, x):
    """Set x (ROOM,) from the poses."""
    for j in range(MARKERS):
        marker_position(CODES[j], poses, get(table, own + OWNERS[j]) * POSE, reals, real + 3 * j, x, STARTS[j])


def values(count, stride, table, reals, poses, unused, t, out, H):
    """out = Phi, or Phi_t."""
    table, reals, poses, out = integers(table, ANY), vector(reals, ANY), vector(poses, ANY), vector(out, ANY)
    x, f = stack(ROOM), stack(ROWS)
    for i in range(count):
        own, real = i * INTS, i * stride
        _place_markers(table, own, reals, real, poses, x)
        kernel_value(x, reals[real + 3 * MARKERS :], t, f)
        row = get(table, own + ROW)
        for r in range(ROWS):
            let(out, row + r, f[r])
    return 0


def reduced(count, stride, table, reals, poses, unused, t, out, H):
    """out = Phi, and H = [Phi_r, Phi_pi'] = Phi_x [x_r, x_pi'] of bodies a and b."""
    table, reals, poses, out = integers(table, ANY), vector(reals, ANY), vector(poses, ANY), vector(out, ANY)
    H = vector(H, ANY)
    x, f, g = stack(ROOM), stack(ROWS), stack2(ROWS, SIZE)
    for i in range(count):
        own, real = i * INTS, i * stride
        _place_markers(table, own, reals, real, poses, x)
        par = reals[real + 3 * MARKERS :]
        # Phi and Phi_x of the primitive
        kernel_phi(x, par, t, f)
        differentiate(x, par, t, g)
        row = get(table, own + ROW)
        for r in range(ROWS):
            let(out, row + r, f[r])
            # H = Phi_x x_(r, pi'), marker by marker
            h = 16 * (row + r)
            for c in range(0, 16, 4):
                put(H, h + c, splat(0.0))
            for j in range(MARKERS):
                k, at = OWNERS[j], get(table, own + OWNERS[j]) * POSE
                add_gradient(CODES[j], poses, at, reals, real + 3 * j, g[r], STARTS[j], H, h + 8 * k)
    return 0


def bias(count, stride, table, reals, poses, unused, t, out, H):
    """out: the bias of Phi_r r'' + Phi_pi' omega'' + out = 0, Eq. 3 in these terms."""
    table, reals, poses, out = integers(table, ANY), vector(reals, ANY), vector(poses, ANY), vector(out, ANY)
    x, xd, xdd = stack(ROOM), stack(ROOM), stack(ROOM)
    f, g = stack2(ROWS, SIZE), stack(ROWS)
    for i in range(count):
        own, real = i * INTS, i * stride
        for j in range(MARKERS):
            # gamma + Phi_x xdd at (rdd, omega'd) = 0
            at = get(table, own + OWNERS[j]) * POSE
            marker_motion(CODES[j], poses, at, reals, real + 3 * j, x, xd, xdd, STARTS[j])
        row = get(table, own + ROW)
        acceleration_bias(x, xd, xdd, reals[real + 3 * MARKERS :], t, f, g, out[row:])
    return 0
