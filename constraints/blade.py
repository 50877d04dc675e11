"""Row of a blade: a point of a has no velocity along a direction of a, within a plane of b and relative to b.

    d     = x_a - x_b,  X = f.d,  Y = g.d        f, g of body b, unit vectors across each other in the plane
    c     = direction of a, across the blade
    A xd  = (c.f) Xd + (c.g) Yd                                       (1)  [m/s], by the sine of c to the normal
    A     = [ e^T, 0, -e^T, (c.f) d^T, (c.g) d^T ],  e = (c.f) f + (c.g) g      (2)  for (x_a, c, x_b, f, g)
    gamma = (cd.f + c.fd) Xd + (cd.g + c.gd) Yd + 2 (c.f) fd.dd + 2 (c.g) gd.dd     (3)

Xd and Yd are rates of coordinates in b, so they are those relative to b, wherever it moves. Singular if c is along the
normal: the blade lies flat.
"""

import numpy as np

from ..plugins import PARALLEL, InvalidConstraint, Point, Primitive, Vector, dot, scaled


class Blade(Primitive):
    """No velocity of a point of a across a blade, within a plane of b that two of its directions span.

    `KnifeEdge` is the joint that uses it and derives the directions from the normal.

    Parameters
    ----------
    along_b, across_b : array_like (3,)
        Directions in the plane, across each other; scaled to unit length.

    Raises
    ------
    InvalidConstraint
        If along_b and across_b are not across each other, or a direction or body is wrong.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> skate = scene.add_body(mass=1.0, inertia=(1, 1, 1), velocity=(2, 0, 0))
    >>> plane = {"along_b": (1, 0, 0), "across_b": (0, 1, 0)}
    >>> scene.add(ts.constraints.Blade(skate, scene.ground, axis_a=(0, 1, 0), **plane))
    <Blade 'Blade(body1, ground)'>
    """

    rate_rows = 1
    markers = (Point("a"), Vector("a"), Point("b"), Vector("b", "along_b"), Vector("b", "across_b"))
    slots = 14

    def check(self):
        """Refuse directions of the plane that are not across each other."""
        if not abs(self.along_b @ self.across_b) < PARALLEL:
            raise InvalidConstraint(
                f"{self.name}: along_b and across_b are not across each other; give two perpendicular directions of "
                "the plane."
            )

    @staticmethod
    def rate(x, xd, par, t, out):
        """Eq. (1)."""
        cf, cg, Xd, Yd = 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            d, dd = x[i] - x[6 + i], xd[i] - xd[6 + i]
            cf += x[3 + i] * x[9 + i]
            cg += x[3 + i] * x[12 + i]
            Xd += xd[9 + i] * d + x[9 + i] * dd
            Yd += xd[12 + i] * d + x[12 + i] * dd
        out[0] = cf * Xd + cg * Yd

    @staticmethod
    def rate_jacobian(x, par, t, out):
        """Eq. (2)."""
        cf, cg = 0.0, 0.0
        for i in range(3):
            cf += x[3 + i] * x[9 + i]
            cg += x[3 + i] * x[12 + i]
        for i in range(3):
            d, e = x[i] - x[6 + i], cf * x[9 + i] + cg * x[12 + i]
            out[0, i], out[0, 6 + i] = e, -e
            out[0, 9 + i], out[0, 12 + i] = cf * d, cg * d

    @staticmethod
    def rate_gamma(x, xd, par, t, out):
        """Eq. (3)."""
        cf, cg, cfd, cgd, Xd, Yd, turning = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            cf += x[3 + i] * x[9 + i]
            cg += x[3 + i] * x[12 + i]
        for i in range(3):
            d, dd = x[i] - x[6 + i], xd[i] - xd[6 + i]
            cfd += xd[3 + i] * x[9 + i] + x[3 + i] * xd[9 + i]
            cgd += xd[3 + i] * x[12 + i] + x[3 + i] * xd[12 + i]
            Xd += xd[9 + i] * d + x[9 + i] * dd
            Yd += xd[12 + i] * d + x[12 + i] * dd
            turning += (cf * xd[9 + i] + cg * xd[12 + i]) * dd
        out[0] = cfd * Xd + cgd * Yd + 2.0 * turning

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2); rows of d, c, f, g, c.f, c.g."""
        for i in range(3):
            s[i, k], s[3 + i, k], s[6 + i, k], s[9 + i, k] = x[i] - x[6 + i], x[3 + i], x[9 + i], x[12 + i]
        s[12, k], s[13, k] = dot(s, 3, 6, k), dot(s, 3, 9, k)
        f, g = scaled(s, 6, 12, k), scaled(s, 9, 13, k)
        along, across = scaled(s, 0, 12, k), scaled(s, 0, 13, k)
        for i in range(3):
            out[0, i], out[0, 6 + i] = f[i] + g[i], -f[i] - g[i]
            out[0, 9 + i], out[0, 12 + i] = along[i], across[i]

    @classmethod
    def example(cls, rng, a, b):
        """A random instance."""
        point, axis, other = rng.normal(size=(3, 3))
        f, g, _ = np.linalg.qr(rng.normal(size=(3, 3)))[0].T
        return cls(a, b, point_a=point, axis_a=axis, point_b=other, along_b=f, across_b=g)
