"""Rows and Taylor series of contacts with the ground, in place of those for any marker: one arm, force and product.

Row i is along a direction e_i of the ground. Its derivative is e_i . w, with w the velocity of the body's material
point at the end of an arm y' (body frame), which the kernel `arm_series` gives from the normal e_0 in the body frame:

    Phi             = e_0 . (r + A y' - x_b),   H_i = [e_i^T, (y' x A^T e_i)^T]                 (1)
    w_{k+1}         = (k + 2) r_{k+2} + sum_l (l + 1) A_{l+1} y'_{k+1-l}                        (2)
    F_k             = - sum_i e_i lam_i,k                                                       (3)
    tau'_k          = sum_j y'_j x (A^T F)_{k-j}                                                (4)

F, A^T F and y' are kept where the forces of the first three markers are in constraint_series.py.
"""

from ...jit.kernels import ANY, data_of, integers, kernel, matrix, part, stack, stack2, vector
from ...jit.simd import add, cross, first, fma, four, get, lanes, let, put, second, splat, sub, third, times, total
from .constraint_rows import INTS, POSE, ROW, R, turned
from .constraint_series import BODY_ROW, GROUND, RESIDUAL, S_R, UNTURNED, Instance, offsets, torque
from .template import MARKERS, NORMAL, OWNERS, ROWS, SLOTS, extent, kernel_arm_series


def is_ground_contact(kind, masks):
    """Whether all instances of a class, with these masks, are contacts of bodies that turn with the ground."""
    on_ground = masks >> (GROUND + kind.normal_at - 1) & 1 == 1  # of a Point: a body that never turns may move
    return "contact_rows" in kind.kernels and bool((on_ground & (masks >> UNTURNED & 1 == 0)).all())


@kernel
def _read(reals, i):
    """Three numbers, as a register."""
    return lanes(get(reals, i), get(reals, i + 1), get(reals, i + 2))


@kernel
def _turned_back(bodies, at, f):
    """A^T f."""
    x, y, z = times(four(bodies, at), f), times(four(bodies, at + 4), f), times(four(bodies, at + 8), f)
    return total(x), total(y), total(z)


@part
def _arm(k, reals, real, columns, at, scratch, n, arm):
    """y'_k, A_k being at columns[at]; n, arm: scratch."""
    # A_k^T e_0, along markers 1 to 3
    x, y, z = _turned_back(columns, at, _read(reals, real + 3 * NORMAL))
    for j in range(3):
        s = real + 3 + 3 * j
        n[j] = get(reals, s) * x + get(reals, s + 1) * y + get(reals, s + 2) * z
    kernel_arm_series(n, reals[real + 3 * MARKERS :], k, scratch, arm)
    # The first marker is fixed to the body
    f = _read(reals, real) if k == 0 else splat(0.0)
    for j in range(3):
        f = fma(_read(reals, real + 3 + 3 * j), splat(arm[j]), f)
    return f


def reduced(count, stride, table, reals, poses, unused, t, out, H):
    """As constraint_rows.reduced, Eq. (1)."""
    table, reals, poses, out = integers(table, ANY), vector(reals, ANY), vector(poses, ANY), vector(out, ANY)
    H, n, arm, scratch = vector(H, ANY), stack(3), stack(3), stack2(SLOTS, 1)
    for i in range(count):
        own, real = i * INTS, i * stride
        at, row = get(table, own + OWNERS[0]) * POSE, get(table, own + ROW)
        y = _arm(0, reals, real, poses, at, scratch, n, arm)
        # Phi, zero for rows on velocities
        f = add(four(poses, at + R), turned(poses, at, first(y), second(y), third(y)))
        gap = total(times(_read(reals, real + 3 * NORMAL), sub(f, _read(reals, real + 3 * (NORMAL - 1)))))
        for r in range(ROWS):
            let(out, row + r, gap if r == 0 else 0.0)
            # H on the side of the body, zero on that of the ground
            h, e = 16 * (row + r), _read(reals, real + 3 * (NORMAL + r))
            a, b, c = _turned_back(poses, at, e)
            put(H, h, e)
            put(H, h + 4, cross(y, lanes(a, b, c)))
            put(H, h + 8, splat(0.0))
            put(H, h + 12, splat(0.0))
    return 0


@part
def _find_arm(k, one, n, arm):
    """y'_k."""
    orders, table, own, reals, real, bodies, values, at = one
    body, (F, _L, _X, _J, own_scratch) = get(table, own + OWNERS[0]) * BODY_ROW * orders, offsets(orders)
    scratch = matrix(data_of(values[at + own_scratch :]), SLOTS, orders)
    put(values, at + F + 8 * orders + 4 * k, _arm(k, reals, real, bodies, body + 12 * k, scratch, n, arm))


@part
def _push(k, one, b, Z):
    """F_{k-1} by lam_{k-1} of b, Eq. (3); the torque of order k without lam_k, Eq. (4), onto the body's Z."""
    orders, table, own, reals, real, bodies, values, at = one
    body, row, force = get(table, own + OWNERS[0]), get(table, own + ROW), splat(0.0)
    A, F = body * BODY_ROW * orders, at + offsets(orders)[0]
    G, arms = F + 4 * orders, F + 8 * orders
    for r in range(ROWS):
        force = fma(_read(reals, real + 3 * (NORMAL + r)), splat(-get(b, row + r)), force)
    # (A^T F)_{k-1} with its last term, (A^T F)_k without it
    x, y, z = _turned_back(bodies, A, force)
    put(values, F + 4 * k - 4, force)
    put(values, G + 4 * k - 4, add(four(values, G + 4 * k - 4), lanes(x, y, z)) if k > 1 else lanes(x, y, z))
    put(values, F + 4 * k, splat(0.0))
    put(values, G + 4 * k, torque(bodies, A, k, values, F))
    # sum_j y'_j x (A^T F)_{k-j}, in two sums: each waits for its last
    u, v, o = splat(0.0), splat(0.0), G + 4 * k
    for j in range(arms, arms + 4 * k, 8):
        u = add(u, cross(four(values, j), four(values, o)))
        v = add(v, cross(four(values, j + 4), four(values, o - 4)))
        o -= 8
    if k % 2 == 0:
        u = add(u, cross(four(values, arms + 4 * k), four(values, G)))
    put(Z, 8 * body + 4, add(four(Z, 8 * body + 4), add(u, v)))


@part
def _residual(k, one, b):
    """b = (k + 1) e_i . w_{k+1}, Eq. (2)."""
    orders, table, own, reals, real, bodies, values, at = one
    A, row = get(table, own + OWNERS[0]) * BODY_ROW * orders, get(table, own + ROW)
    w = times(four(bodies, A + S_R * orders + 4 * (k + 2)), splat(k + 2.0))
    c, o, l = A + 12, at + offsets(orders)[0] + 8 * orders + 4 * (k + 1), 1.0
    for _ in range(k + 2):
        f = times(four(bodies, c), splat(get(values, o)))
        f = fma(four(bodies, c + 4), splat(get(values, o + 1)), f)
        w = fma(fma(four(bodies, c + 8), splat(get(values, o + 2)), f), splat(l), w)
        c += 12
        o -= 4
        l += 1.0
    w = times(w, splat(k + 1.0))
    for r in range(ROWS):
        let(b, row + r, total(times(_read(reals, real + 3 * (NORMAL + r)), w)))


def series(mode, k, kind, table, reals, bodies, values, b, Z):
    """As constraint_series.series."""
    table, reals, bodies = integers(table, ANY), vector(reals, ANY), vector(bodies, ANY)
    values, b, Z = vector(values, ANY), vector(b, ANY), vector(Z, ANY)
    kind, n, arm = extent(kind), stack(3), stack(3)
    for i in range(kind.count):
        one = Instance(kind.orders, table, i * INTS, reals, i * kind.stride, bodies, values, i * kind.width)
        if mode == RESIDUAL:
            _residual(k, one, b)
            continue
        # Orders zero and one at first, then one more each time
        for now in range(0 if k == 0 else k + 1, k + 2):
            _find_arm(now, one, n, arm)
        if k > 0:
            _push(k, one, b, Z)
    return 0
