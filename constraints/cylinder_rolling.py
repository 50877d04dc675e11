"""Rolling of a ball on or in a cylinder: the row of CylinderContact, and two on velocities.

R is the radius of the ball, negative outside, c that of the cylinder, S = c - R; e_1, e_2, e_3 is the ball's frame.

    X = d.f,  Y = d.g,  L = d.u                                      (1)
    n = (X f + Y g) / S,  tau = (X g - Y f) / S,  n_j = n.e_j        (2)  contact point x_a + R n
    w = xd_a - xd_b + R sum n_j ed_j                                 (3)  of the ball's material point there
    u_1 = u.w - (c / S) u.(X fd + Y gd)                              (4)  [m/s] slip along the axis: zero
    u_2 = tau.w - L tau.ud - c g.fd                                  (5)  [m/s] slip around it: zero
    u_x = u^T for x_a, R n_j u^T for e_j, -u^T for x_b, -(c / S) X u^T for f, -(c / S) Y u^T for g           (6)
          tau^T,       R n_j tau^T,       -tau^T,       -c g^T,                0,            -L tau^T for u
    ud  = (u_x xd)_x xd                                              (7)

Never singular.
"""

from ..plugins import Vector, dot, scaled
from .cylinder_contact import B, CylinderContact, F, G, across_axis, cylinder_series
from .smooth_contact import along

A, E = 12, 15  # where u and e_1 begin in x


class CylinderRolling(CylinderContact):
    """A ball of a rolls on a cylinder of b, or in it: the rows of `RollingBallOnCylinder`.

    Parameters
    ----------
    first_b, second_b, axis_b : array_like (3,)
        A right-handed frame of directions at right angles; the last is the axis of the cylinder.
    first_a, second_a, third_a : array_like (3,)
        Any directions at right angles to each other.

    Examples
    --------
    One row on positions, two on velocities:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0, 1.5))
    >>> frame = {"first_b": (0, 1, 0), "second_b": (0, 0, 1), "axis_b": (1, 0, 0)}
    >>> ball_frame = {"first_a": (1, 0, 0), "second_a": (0, 1, 0), "third_a": (0, 0, 1)}
    >>> radii = {"radius": 0.5, "cylinder_radius": 1.0}
    >>> rolling = scene.add(ts.constraints.CylinderRolling(ball, scene.ground, **frame, **ball_frame, **radii))
    >>> print(rolling.rows, rolling.rate_rows)
    1 2
    """

    rate_rows = 2
    markers = (
        *CylinderContact.markers,
        Vector("b"),
        Vector("a", "first_a"),
        Vector("a", "second_a"),
        Vector("a", "third_a"),
    )
    slots = 33

    @staticmethod
    def rate(x, xd, par, t, out):
        """Eqs. (4) and (5)."""
        S, R, c = par[0], par[1], par[2]
        X, Y = across_axis(x)
        one, two, L, sway = 0.0, -c * along(x, G, xd, F), 0.0, 0.0
        for i in range(3):
            dd, tau = xd[i] - xd[B + i], (X * x[G + i] - Y * x[F + i]) / S
            L += (x[i] - x[B + i]) * x[A + i]
            one += x[A + i] * (dd - c / S * (X * xd[F + i] + Y * xd[G + i]))
            two += tau * dd
            sway += tau * xd[A + i]
        for j in range(3):
            e = E + 3 * j
            n = R * (X * along(x, F, x, e) + Y * along(x, G, x, e)) / S
            one += n * along(x, A, xd, e)
            two += n * (X * along(x, G, xd, e) - Y * along(x, F, xd, e)) / S
        out[0] = one
        out[1] = two - L * sway

    @staticmethod
    def rate_jacobian(x, par, t, out):
        """Eq. (6)."""
        S, R, c = par[0], par[1], par[2]
        X, Y = across_axis(x)
        L = along(x, 0, x, A) - along(x, B, x, A)
        for i in range(3):
            u, tau = x[A + i], (X * x[G + i] - Y * x[F + i]) / S
            out[0, i], out[0, B + i] = u, -u
            out[1, i], out[1, B + i] = tau, -tau
            out[0, F + i], out[0, G + i] = -c / S * X * u, -c / S * Y * u
            out[1, F + i], out[1, A + i] = -c * x[G + i], -L * tau
        for j in range(3):
            e = E + 3 * j
            n = R * (X * along(x, F, x, e) + Y * along(x, G, x, e)) / S
            for i in range(3):
                out[0, e + i] = n * x[A + i]
                out[1, e + i] = n * (X * x[G + i] - Y * x[F + i]) / S

    @staticmethod
    def rate_gamma(x, xd, par, t, out):
        """Eq. (7)."""
        S, R, c = par[0], par[1], par[2]
        X, Y = across_axis(x)
        Xd, Yd, L, Ld = 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            d, dd = x[i] - x[B + i], xd[i] - xd[B + i]
            Xd += xd[F + i] * d + x[F + i] * dd
            Yd += xd[G + i] * d + x[G + i] * dd
            L += x[A + i] * d
            Ld += xd[A + i] * d + x[A + i] * dd
        one, two = 0.0, -c * along(xd, G, xd, F)
        for i in range(3):
            dd, tau = xd[i] - xd[B + i], (X * x[G + i] - Y * x[F + i]) / S
            taud = (Xd * x[G + i] - Yd * x[F + i] + X * xd[G + i] - Y * xd[F + i]) / S
            one += xd[A + i] * (dd - c / S * (X * xd[F + i] + Y * xd[G + i]))
            one -= x[A + i] * c / S * (Xd * xd[F + i] + Yd * xd[G + i])
            two += taud * dd - Ld * tau * xd[A + i] - L * taud * xd[A + i]
        for j in range(3):
            e = E + 3 * j
            f, g = along(x, F, x, e), along(x, G, x, e)
            n = R * (X * f + Y * g) / S
            fd, gd = along(xd, F, x, e) + along(x, F, xd, e), along(xd, G, x, e) + along(x, G, xd, e)
            nd = R * (Xd * f + Yd * g + X * fd + Y * gd) / S
            one += nd * along(x, A, xd, e) + n * along(xd, A, xd, e)
            two += nd * (X * along(x, G, xd, e) - Y * along(x, F, xd, e)) / S
            two += n * (Xd * along(x, G, xd, e) - Yd * along(x, F, xd, e)) / S
            two += n * (X * along(xd, G, xd, e) - Y * along(xd, F, xd, e)) / S
        out[0] = one
        out[1] = two

    @staticmethod
    def series(x, par, k, s, out):
        """Of CylinderContact's row and Eq. (6); more rows of u, e_j, n, tau, R n_j, -L."""
        cylinder_series(x, par, k, s, out)
        R, c = par[1], par[2]
        f0, f1, f2 = scaled(s, 0, 10, k)
        g0, g1, g2 = scaled(s, 3, 9, k)
        s[26, k], s[27, k], s[28, k] = g0 - f0, g1 - f1, g2 - f2
        for i in range(9):
            s[14 + i, k] = x[E + i]
        for i in range(3):
            u, tau = x[A + i], s[26 + i, k]
            s[11 + i, k], s[23 + i, k] = u, out[0, i]
            out[1, i], out[1, B + i], out[2, i], out[2, B + i] = u, -u, tau, -tau
            out[2, F + i] = -c * x[G + i]
        for j in range(3):
            e = E + 3 * j
            s[29 + j, k] = R * dot(s, 14 + 3 * j, 23, k)
            out[1, e], out[1, e + 1], out[1, e + 2] = scaled(s, 11, 29 + j, k)
            out[2, e], out[2, e + 1], out[2, e + 2] = scaled(s, 26, 29 + j, k)
        s[32, k] = -dot(s, 6, 11, k)
        out[2, A], out[2, A + 1], out[2, A + 2] = scaled(s, 26, 32, k)
        f0, f1, f2 = scaled(s, 11, 9, k)
        out[1, F], out[1, F + 1], out[1, F + 2] = -c * f0, -c * f1, -c * f2
        f0, f1, f2 = scaled(s, 11, 10, k)
        out[1, G], out[1, G + 1], out[1, G + 2] = -c * f0, -c * f1, -c * f2
