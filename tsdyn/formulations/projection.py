"""Projection onto the constraint manifold: positions, then velocities (Eqs. 20, 23, 29).

Corrections lie in the normal space W H^T at the current configuration, so one factorisation of S = H W H^T serves
positions and velocities. It also serves the accelerations, unless positions have moved by more than rounding.
"""

import math

from ..elements.loops.body_poses import OMEGA, POSE, RD, P, R, set_pose
from ..elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from ..errors import Status
from ..jit.kernels import kernel, long_kernel
from ..jit.simd import add, fma, four, put, splat
from ..maths.dense_linalg import largest
from ..rows.evaluation import factorise_rows, held, run_loops
from ..rows.independent_rows import weakest
from ..rows.schur_complement import gather, scatter
from ..rows.singularity import NEAR
from ..rows.tangent_workspace import LARGEST_SHARE, MOVED, RESIDUAL
from ..sparse.constraint_graph import DRIFT, REDUCED, VALUES
from ..sparse.factorisation import solve
from ..workspaces.workspace import AT_ROUNDING, FACTORIZATIONS, FLOOR, NEWTON

OK, SINGULAR = int(Status.SUCCESS), int(Status.SINGULAR)
NOT_FINITE, NEWTON_FAILED = int(Status.NOT_FINITE), int(Status.NEWTON_FAILED)
UNHELD = int(Status.UNHELD)
SWEEPS = 12
MOST_PARTS = 100.0  # of a step on which p is followed
LEAST_MOVE = 1e-15  # corrections above this are more than rounding: S is made anew


@long_kernel
def factorise(network, system, w, f, t):
    """b = Phi, and H, W H^T and the factors of S, at the present poses. Status."""
    run_loops(network, system.reals, REDUCED, f, t, f.b, f.H)
    w.counters[FACTORIZATIONS] += 1
    return OK if factorise_rows(network, system.reals, f, t, f.b, f.H, f.Y, f.S, 1) else SINGULAR


@long_kernel
def land(network, system, w, f, t):
    """Bring positions onto the manifold along W H^T; H, Y and S are those of where they land. Status."""
    floor, before, moved, renew = w.control[FLOOR], math.inf, 0.0, True
    f.sizes[RESIDUAL], f.sizes[MOVED] = -1.0, 0.0
    for _ in range(SWEEPS):
        if renew:
            status = factorise(network, system, w, f, t)
            if status != OK:
                return status
            if f.sizes[RESIDUAL] >= 0.0:
                return _settle(network, f, floor)
            renew = False
        else:
            run_loops(network, system.reals, VALUES, f, t, f.b, f.H)
        worst = largest(f.b)
        f.sizes[RESIDUAL] = max(f.sizes[RESIDUAL], worst)
        if not worst < math.inf:
            return NOT_FINITE
        if worst <= floor or worst > 0.5 * before:
            if worst > 100.0 * floor:
                return NEWTON_FAILED
            if moved <= LEAST_MOVE:
                w.counters[AT_ROUNDING] += 1 if moved == 0.0 else 0
                return _settle(network, f, floor)
            renew = True
            continue
        before = worst
        w.counters[NEWTON] += 1
        solve(network.pattern, f.S, f.b)
        moved = max(moved, _displace(network, f))
        f.sizes[MOVED] = moved
    return NEWTON_FAILED


@long_kernel
def _settle(network, f, floor):
    """End a landing, b being Phi: next to a singular configuration it is corrected below its floor. Status.

    What Phi leaves there moves bodies by as much over the distance.
    """
    if not held(f, floor):
        return UNHELD
    if weakest(network, f.S) < NEAR * f.sizes[LARGEST_SHARE]:
        solve(network.pattern, f.S, f.b)
        _displace(network, f)
    return OK


@kernel
def _displace(network, f):
    """Move and turn the bodies by -Y b; by how much, at most."""
    for i in range(f.Z.size):
        f.Z[i] = 0.0
    scatter(network, f.Y, f.b, f.Z)
    move_by(network, f)
    return largest(f.Z)


@kernel
def move_by(network, f):
    """Move and turn the bodies by Z, to first order."""
    p = f.p
    for b in range(network.bodies.shape[0]):
        at, o = b * POSE, 8 * b
        put(f.poses, at + R, add(four(f.poses, at + R), four(f.Z, o)))
        if network.bodies[b, 1] == 7:
            x, y, z = 0.5 * f.Z[o + 4], 0.5 * f.Z[o + 5], 0.5 * f.Z[o + 6]
            e0, e1, e2, e3 = (f.poses[at + P], f.poses[at + P + 1], f.poses[at + P + 2], f.poses[at + P + 3])
            p[0] = e0 - e1 * x - e2 * y - e3 * z
            p[1] = e1 + e0 * x - e3 * y + e2 * z
            p[2] = e2 + e3 * x + e0 * y - e1 * z
            p[3] = e3 - e2 * x + e1 * y + e0 * z
            normalise(p)
            set_pose(f.poses, at, p)


@kernel
def normalise(p):
    """Scale p to unit length."""
    f = 1.0 / math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3])
    for i in range(4):
        p[i] *= f


@kernel
def gather_speeds(network, f):
    """Z = rd and omega' of the poses."""
    for b in range(network.bodies.shape[0]):
        put(f.Z, 8 * b, four(f.poses, b * POSE + RD))
        put(f.Z, 8 * b + 4, four(f.poses, b * POSE + OMEGA))


@kernel
def find_drift(network, system, f, t):
    """gamma = Phi_t, time being set."""
    for e in range(f.gamma.size):
        f.gamma[e] = 0.0
    run_loops(network, system.reals, DRIFT, f, t, f.gamma, f.H)


@kernel
def land_velocities(network, f, drifting):
    """Take out of the velocities of the poses what is normal to the manifold, twice: the second time it is rounding.

    H, Y and S are those of the poses; with `drifting`, gamma is Phi_t.
    """
    gather_speeds(network, f)
    for _ in range(2):
        gather(network, f.H, f.Z, f.b)
        if drifting:
            for e in range(f.b.size):
                f.b[e] += f.gamma[e]
        solve(network.pattern, f.S, f.b)
        scatter(network, f.Y, f.b, f.Z)
    for b in range(network.bodies.shape[0]):
        put(f.poses, b * POSE + RD, four(f.Z, 8 * b))
        put(f.poses, b * POSE + OMEGA, four(f.Z, 8 * b + 4))


@kernel
def sum_series(network, bodies, orders, top, h, poses, p):
    """The poses at h: A and r from coefficients up to top + 1, omega' up to top. A is made orthogonal by way of p."""
    s = splat(h)
    for b in range(network.bodies.shape[0]):
        first, at = b * orders * BODY_ROW, b * POSE
        o = first + S_R * orders
        r, rd = four(bodies, o + 4 * (top + 1)), splat(0.0)
        for k in range(top, -1, -1):
            rd = fma(rd, s, r)
            r = fma(r, s, four(bodies, o + 4 * k))
        put(poses, at + R, r)
        put(poses, at + RD, rd)
        if network.bodies[b, 1] == 7:
            w, o = splat(0.0), first + S_OMEGA * orders
            for k in range(top, -1, -1):
                w = fma(w, s, four(bodies, o + 4 * k))
            put(poses, at + OMEGA, w)
            fast = 0.0  # where it may turn far, p is followed on the way: it and -p are the same A
            for i in range(3):
                fast = max(fast, max(abs(bodies[o + i]), abs(poses[at + OMEGA + i])))
            parts = int(min(fast * abs(h), MOST_PARTS)) + 1
            for i in range(1, parts + 1):
                _sum_rotation(bodies, first, top, h * i / parts, poses, at)
                _parameters(poses, at, p)
                for j in range(4):
                    poses[at + P + j] = p[j]
            set_pose(poses, at, p)


@kernel
def _sum_rotation(bodies, first, top, h, poses, at):
    """A at h."""
    s, c = splat(h), first + 12 * (top + 1)
    x, y, z = four(bodies, c), four(bodies, c + 4), four(bodies, c + 8)
    for k in range(top, -1, -1):
        c = first + 12 * k
        x = fma(x, s, four(bodies, c))
        y = fma(y, s, four(bodies, c + 4))
        z = fma(z, s, four(bodies, c + 8))
    put(poses, at, x)
    put(poses, at + 4, y)
    put(poses, at + 8, z)


@kernel
def _parameters(poses, at, p):
    """Euler parameters of the matrix at poses[at], on the side of those there were; from the largest of the four."""
    a, b, c = poses[at], poses[at + 5], poses[at + 10]  # the diagonal
    x, y, z = poses[at + 6] - poses[at + 9], poses[at + 8] - poses[at + 2], poses[at + 1] - poses[at + 4]
    u, v, w = poses[at + 9] + poses[at + 6], poses[at + 2] + poses[at + 8], poses[at + 4] + poses[at + 1]
    e0, e1, e2, e3 = 1.0 + a + b + c, 1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c
    largest = max(max(e0, e1), max(e2, e3))
    if largest == e0:
        p[0], p[1], p[2], p[3] = e0, x, y, z
    elif largest == e1:
        p[0], p[1], p[2], p[3] = x, e1, w, v
    elif largest == e2:
        p[0], p[1], p[2], p[3] = y, w, e2, u
    else:
        p[0], p[1], p[2], p[3] = z, v, u, e3
    normalise(p)
    side = p[0] * poses[at + P] + p[1] * poses[at + P + 1] + p[2] * poses[at + P + 2] + p[3] * poses[at + P + 3]
    if side < 0.0:
        for i in range(4):
            p[i] = -p[i]
