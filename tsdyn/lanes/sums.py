"""Sums over orders in the form that suits lanes: as few sums at a time as there are registers for.

For one case each of these sums is two, since an addition waits for the one before; lanes have three independent sums
where one case has one, and twice as many wouldn't fit into registers.
"""

from ..elements.loops.constraint_series import S_OMEGA, S_SPIN
from ..jit.kernels import kernel
from ..jit.simd import first, fma, four, get, lanes, less, second, splat, sub, third, total
from ..taylor.coefficients import inverses, put_momentum, put_product


@kernel
def turn_ahead(bodies, at, orders, k, exact):
    """As `coefficients.turn_ahead`."""
    x, y, z = splat(0.0), splat(0.0), splat(0.0)
    o = at + S_OMEGA * orders + 4 * (k - 1)
    for c in range(at + 12, at + 12 * (k + 1), 12):
        a0, a1, a2 = four(bodies, c), four(bodies, c + 4), four(bodies, c + 8)
        w0, w1, w2 = splat(get(bodies, o)), splat(get(bodies, o + 1)), splat(get(bodies, o + 2))
        x = less(a2, w1, fma(a1, w2, x))
        y = less(a0, w2, fma(a2, w0, y))
        z = less(a1, w0, fma(a0, w1, z))
        o -= 4
    o, (f, _, low, _) = at + 12 * (k + 1), inverses(k, exact)
    put_product(bodies, o, x, f, low, exact)
    put_product(bodies, o + 4, y, f, low, exact)
    put_product(bodies, o + 8, z, f, low, exact)


@kernel
def torque(bodies, at, k, forces, first):
    """As `constraint_series.torque`."""
    x, y, z = splat(0.0), splat(0.0), splat(0.0)
    c, f = at, first + 4 * k
    for _ in range(k + 1):
        g = four(forces, f)
        x = fma(four(bodies, c), g, x)
        y = fma(four(bodies, c + 4), g, y)
        z = fma(four(bodies, c + 8), g, z)
        c += 12
        f -= 4
    return lanes(total(x), total(y), total(z))


@kernel
def spin(graph, b, bodies, at, orders, k):
    """As `coefficients.spin`."""
    x, y = splat(0.0), splat(0.0)
    if graph.spins[b] != 0:
        o, spins = at + S_OMEGA * orders, at + S_SPIN * orders
        put_momentum(graph, b, bodies, o, spins, k)
        for j in range(k + 1):
            # -omega'_j x (J' omega')_{k-j}, both products of the cross product in sums of their own
            f, g = four(bodies, spins + 4 * (k - j)), four(bodies, o + 4 * j)
            x = fma(lanes(second(f), third(f), first(f)), lanes(third(g), first(g), second(g)), x)
            y = fma(lanes(third(f), first(f), second(f)), lanes(second(g), third(g), first(g)), y)
    return sub(x, y)
