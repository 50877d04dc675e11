"""Rolling of a ball on a ball, or in one: the row of Distance, and two on velocities.

    d     = x_a - x_b,  n = d / L                                     (1)  L = |d| in contact
    Phi   = (d.d - L^2) / 2 L                                         (2)  [m]
    w     = dd - f sum (d.e_j) ed_j - (1 - f) sum (d.h_j) hd_j        (3)  slip; e_j of a, h_j of b, f L from x_a
    t_i   = r_i - c_i (n + r_3),  c_i = r_i.n / (1 + r_3.n)           (4)  the turn of r_3 to n, least of all, takes r_i
    u_i   = t_i.w                                                     (5)  to t_i; [m/s], zero without slip
    u_x   = t_i^T for x_a, -f (d.e_j) t_i^T for e_j, -t_i^T for x_b, -(1 - f) (d.h_j) t_i^T for h_j        (6)
    ud    = td_i.w + t_i.wd,  wd = -f sum (d.e_j)' ed_j - (1 - f) sum (d.h_j)' hd_j                        (7)
    td_i  = rd_i - cd_i (n + r_3) - c_i (nd + rd_3),  cd_i = ((r_i.n)' - c_i (r_3.n)') / (1 + r_3.n)       (8)

r_i are at right angles, fixed to b. Singular where x_a = x_b, and where n = -r_3, a direction of b that is no axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import Point, Primitive, Vector, across, dot, number, product, quotient, scaled

if TYPE_CHECKING:
    from ..hints import BodyLike

E, B, H = 3, 12, 15  # where e_1, x_b and h_1 begin in x
THIRD = (0.48, 0.6, 0.64)  # r_3, along h_j


class _Direction(Vector):
    """A direction of a ball; of a point mass, which has none, it counts for nothing: f is zero."""

    def fitted(self, place, body, what, error):
        """Return the coordinates."""
        return place if body.dimension == 3 else super().fitted(place, body, what, error)


class SphereRolling(Primitive):
    """A ball of a rolls on a ball of b, or in one: the rows of `SphereContact` with friction.

    Parameters
    ----------
    distance : float, m
        Of the centres.
    share : float
        Of the line from the centre of a to that of b at which they touch: 1/2 for equal balls, negative within b, 0
        where a is a point.
    first_a, second_a, third_a, first_b, second_b, third_b : array_like (3,)
        Directions at right angles.

    Raises
    ------
    InvalidConstraint
        If the distance is not positive, or a place or body is wrong.

    Examples
    --------
    One row on positions, two on velocities:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0, 2))
    >>> contact = scene.add(ts.constraints.SphereRolling(ball, scene.ground, distance=2.0, share=0.5))
    >>> print(contact.rows, contact.rate_rows)
    1 2
    """

    rows = 1
    rate_rows = 2
    markers = (
        Point("a", "center_a"),
        *(_Direction("a", name) for name in ("first_a", "second_a", "third_a")),
        Point("b", "center_b"),
        *(Vector("b", name) for name in ("first_b", "second_b", "third_b")),
    )
    slots = 51

    def __init__(self, a: BodyLike, b: BodyLike, *, distance: float, share: float, **places: Any) -> None:
        names = [marker.argument for marker in self.markers if marker.argument[:6] != "center"]
        frame = dict(zip(names, np.tile(np.eye(3), (2, 1)), strict=True))
        super().__init__(a, b, **{**frame, **places})
        self.distance, self.share = distance, share

    def check(self):
        """Refuse a distance that is none."""
        if not 0.0 < number(self.distance) < np.inf:
            raise self.error(f"{self.name}: distance (m) of the centres must be positive, got {self.distance!r}.")
        if self.a.dimension == 3 and self.share:
            raise self.error(
                f"{self.name}: the point mass {self.a.name!r} can't roll; share must be 0, or use add_body."
            )

    @property
    def reach(self) -> float:
        """The distance of the centres, m."""
        return float(self.distance)

    def parameters(self):
        """(L, f, r_1, r_2, r_3), the last along h_j."""
        first, second = across(THIRD)
        return float(self.distance), float(self.share), *first.tolist(), *second.tolist(), *THIRD

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (2)."""
        d0, d1, d2 = x[0] - x[B], x[1] - x[B + 1], x[2] - x[B + 2]
        out[0] = (d0 * d0 + d1 * d1 + d2 * d2 - par[0] * par[0]) / (2.0 * par[0])

    @staticmethod
    def jacobian(x, par, t, out):
        """Of Eq. (2)."""
        for i in range(3):
            n = (x[i] - x[B + i]) / par[0]
            out[0, i], out[0, B + i] = n, -n

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Of Eq. (2)."""
        bias = 0.0
        for i in range(3):
            bias += (xd[i] - xd[B + i]) * (xd[i] - xd[B + i])
        out[0] = bias / par[0]

    @staticmethod
    def rate(x, xd, par, t, out):
        """Eq. (5)."""
        L, f = par[0], par[1]
        one, two, three, rest, c, g = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0
        for i in range(3):
            n = (x[i] - x[B + i]) / L
            w = xd[i] - xd[B + i]
            r1, r2, r3 = 0.0, 0.0, 0.0
            for j in range(3):
                a, h, p, q = E + 3 * j, H + 3 * j, 0.0, 0.0
                r1 += par[2 + j] * x[h + i]
                r2 += par[5 + j] * x[h + i]
                r3 += par[8 + j] * x[h + i]
                for l in range(3):
                    p += (x[l] - x[B + l]) * x[a + l]
                    q += (x[l] - x[B + l]) * x[h + l]
                w -= f * p * xd[a + i] + (1.0 - f) * q * xd[h + i]
            one += r1 * w
            two += r2 * w
            three += (n + r3) * w
            rest += r3 * n
            c += r1 * n
            g += r2 * n
        out[0] = one - c / rest * three
        out[1] = two - g / rest * three

    @staticmethod
    def rate_jacobian(x, par, t, out):
        """Eq. (6)."""
        L, f = par[0], par[1]
        rest, c, g = 1.0, 0.0, 0.0
        for i in range(3):
            n = (x[i] - x[B + i]) / L
            for j in range(3):
                h = x[H + 3 * j + i]
                c += par[2 + j] * h * n
                g += par[5 + j] * h * n
                rest += par[8 + j] * h * n
        for i in range(3):
            one, two, m = 0.0, 0.0, (x[i] - x[B + i]) / L
            for j in range(3):
                h = x[H + 3 * j + i]
                one += par[2 + j] * h
                two += par[5 + j] * h
                m += par[8 + j] * h
            one, two = one - c / rest * m, two - g / rest * m
            out[0, i], out[0, B + i], out[1, i], out[1, B + i] = one, -one, two, -two
            for j in range(3):
                a, h, p, q = E + 3 * j, H + 3 * j, 0.0, 0.0
                for l in range(3):
                    p -= f * (x[l] - x[B + l]) * x[a + l]
                    q -= (1.0 - f) * (x[l] - x[B + l]) * x[h + l]
                out[0, a + i], out[0, h + i], out[1, a + i], out[1, h + i] = p * one, q * one, p * two, q * two

    @staticmethod
    def rate_gamma(x, xd, par, t, out):
        """Eqs. (7), (8)."""
        L, f = par[0], par[1]
        rest, c, g, restd, cd, gd = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            n, nd = (x[i] - x[B + i]) / L, (xd[i] - xd[B + i]) / L
            for j in range(3):
                h, hd = x[H + 3 * j + i], xd[H + 3 * j + i]
                c += par[2 + j] * h * n
                g += par[5 + j] * h * n
                rest += par[8 + j] * h * n
                cd += par[2 + j] * (hd * n + h * nd)
                gd += par[5 + j] * (hd * n + h * nd)
                restd += par[8 + j] * (hd * n + h * nd)
        c, g = c / rest, g / rest
        cd, gd = (cd - c * restd) / rest, (gd - g * restd) / rest
        out[0], out[1] = 0.0, 0.0
        for i in range(3):
            m, md = (x[i] - x[B + i]) / L, (xd[i] - xd[B + i]) / L
            w, wd = xd[i] - xd[B + i], 0.0
            one, two, oned, twod = 0.0, 0.0, 0.0, 0.0
            for j in range(3):
                a, h, p, q, pd, qd = E + 3 * j, H + 3 * j, 0.0, 0.0, 0.0, 0.0
                one += par[2 + j] * x[h + i]
                two += par[5 + j] * x[h + i]
                m += par[8 + j] * x[h + i]
                oned += par[2 + j] * xd[h + i]
                twod += par[5 + j] * xd[h + i]
                md += par[8 + j] * xd[h + i]
                for l in range(3):
                    d, dd = x[l] - x[B + l], xd[l] - xd[B + l]
                    p += d * x[a + l]
                    q += d * x[h + l]
                    pd += dd * x[a + l] + d * xd[a + l]
                    qd += dd * x[h + l] + d * xd[h + l]
                w -= f * p * xd[a + i] + (1.0 - f) * q * xd[h + i]
                wd -= f * pd * xd[a + i] + (1.0 - f) * qd * xd[h + i]
            out[0] += (one - c * m) * wd + (oned - cd * m - c * md) * w
            out[1] += (two - g * m) * wd + (twod - gd * m - g * md) * w

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eqs. (2), (6); rows of e_j, h_j, n, n + r_3, d.e_j, d.h_j, r_i.n, 1 + r_3.n, -c_i, t_i, r_i."""
        L, f = par[0], par[1]
        for i in range(9):
            s[i, k], s[9 + i, k] = x[E + i], x[H + i]
        for i in range(3):
            n = (x[i] - x[B + i]) / L
            s[18 + i, k], out[0, i], out[0, B + i] = n, n, -n
            for row in range(3):
                s[42 + 3 * row + i, k] = 0.0
                for j in range(3):
                    s[42 + 3 * row + i, k] += par[2 + 3 * row + j] * x[H + 3 * j + i]
            s[21 + i, k] = n + s[48 + i, k]
        s[30, k], s[31, k] = -dot(s, 42, 18, k), -dot(s, 45, 18, k)
        s[32, k] = dot(s, 48, 18, k) + (1.0 if k == 0 else 0.0)
        for j in range(3):
            s[24 + j, k] = -f * L * dot(s, 18, 3 * j, k)
            s[27 + j, k] = -(1.0 - f) * L * dot(s, 18, 9 + 3 * j, k)
        for row in range(2):
            c, first = 33 + row, 36 + 3 * row
            s[c, k] = quotient(s[30 + row], s[32], s[c], k)
            for i in range(3):
                t = product(s[21 + i], s[c], k) + s[42 + 3 * row + i, k]
                s[first + i, k] = t
                out[1 + row, i], out[1 + row, B + i] = t, -t
            for j in range(3):
                a, h = E + 3 * j, H + 3 * j
                out[1 + row, a], out[1 + row, a + 1], out[1 + row, a + 2] = scaled(s, first, 24 + j, k)
                out[1 + row, h], out[1 + row, h + 1], out[1 + row, h + 2] = scaled(s, first, 27 + j, k)

    @staticmethod
    def contact(x, par):
        """Contact point and normal towards a, (3, k) each, of marker coordinates x (len(x), k)."""
        d = x[:3] - x[B : B + 3]
        return x[:3] - par[1] * d, np.copysign(1.0, par[1]) * d / par[0]

    @classmethod
    def example(cls, rng, a, b):
        """A random pair of balls; they need not touch."""
        places = {f"center_{body}": rng.normal(size=3) for body in "ab"}
        return cls(a, b, **places, distance=rng.uniform(0.5, 2.0), share=rng.uniform(0.2, 0.8))
