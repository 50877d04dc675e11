"""Slip velocities of frictions along a motion: a kernel."""

from ..elements.loops.template import turning
from ..jit.kernels import entry, kernel, stack
from ..maths.vectors import rotate

# Of a unit in the table: where the coordinates of a and b begin, and how many they are (none of the ground); whether
# bodies turn on one another; what becomes of the component along an axis of a, or a normal of b.
AT_A, SIZE_A, AT_B, SIZE_B, TURNS, PART, INTS = range(7)
WHOLE, ALONG, ACROSS = 0, 1, 2  # parts of the velocity: all of it, along the axis of a, across the normal of b


@kernel
def _moved(at, size, q, qd, r, v, w):
    """Centroid, its velocity and the angular velocity of a body, ground frame; zeros of the ground."""
    for i in range(3):
        r[i] = q[at + i] if size > 0 else 0.0
        v[i] = qd[at + i] if size > 0 else 0.0
        w[i] = 0.0
    if size == 7:
        turning(q[at + 3 : at + 7], qd[at + 3 : at + 7], w)


@kernel
def _turned(at, size, q, s, out):
    """A direction of a body, ground frame."""
    if size == 7:
        rotate(q[at + 3 : at + 7], s, out)
    else:
        for i in range(3):
            out[i] = s[i]


@entry("mmwvvmmm")
def slip_velocities(q, qd, table, points, axes, v, sizes, n):
    """Slip velocities or rates v, axes n (k, 3 units), ground frame, and sizes of the terms of v (k, units).

    v = v_a + w_a x s - v_b - w_b x (x_a - r_b), or w_a - w_b, at q, qd (k, n); points s and axes: (3 units,).
    """
    ra, va, wa, rb, vb, wb = stack(3), stack(3), stack(3), stack(3), stack(3), stack(3)
    s, d = stack(3), stack(3)
    for k in range(q.shape[0]):
        for u in range(sizes.shape[1]):
            one, o, size = table[INTS * u : INTS * (u + 1)], 3 * u, 0.0
            _moved(one[AT_A], one[SIZE_A], q[k], qd[k], ra, va, wa)
            _moved(one[AT_B], one[SIZE_B], q[k], qd[k], rb, vb, wb)
            # v = w_a - w_b, or v_a + w_a x s - v_b - w_b x d with d = r_a + s - r_b
            if one[TURNS]:
                for i in range(3):
                    v[k, o + i] = wa[i] - wb[i]
                    size += abs(wa[i]) + abs(wb[i])
            else:
                _turned(one[AT_A], one[SIZE_A], q[k], points[o : o + 3], s)
                for i in range(3):
                    d[i] = ra[i] + s[i] - rb[i]
                for i in range(3):
                    j, m = (i + 1) % 3, (i + 2) % 3
                    va[i] += wa[j] * s[m] - wa[m] * s[j]
                    vb[i] += wb[j] * d[m] - wb[m] * d[j]
                    size += abs(va[i]) + abs(vb[i]) + abs(wa[j] * s[m]) + abs(wb[j] * d[m])
                for i in range(3):
                    v[k, o + i] = va[i] - vb[i]
            # Its part along the axis n of a, (v.n) n, or across the normal n of b, v - (v.n) n
            sizes[k, u] = size
            if one[PART] == WHOLE:
                continue
            if one[PART] == ALONG:
                _turned(one[AT_A], one[SIZE_A], q[k], axes[o : o + 3], d)
            else:
                _turned(one[AT_B], one[SIZE_B], q[k], axes[o : o + 3], d)
            along = v[k, o] * d[0] + v[k, o + 1] * d[1] + v[k, o + 2] * d[2]
            for i in range(3):
                n[k, o + i] = d[i]
                v[k, o + i] = along * d[i] if one[PART] == ALONG else v[k, o + i] - along * d[i]
