"""Contact of a smooth convex surface with a plane: one row, without friction.

The surface is an ellipsoid with its centre at x_a and semi-axes a_j along e_j, thickened by a radius R. A ball has
equal semi-axes; a thin disc has a_3 = 0 and R = 0, a torus a_3 = 0 and R > 0.

    d     = x_a - x_b,  z = normal of b,  z_j = e_j.z                (1)
    s     = sqrt(sum a_j^2 z_j^2)                                    (2)
    c_j   = -a_j^2 z_j / s                                           (3)  contact point x_a + sum c_j e_j - R z
    Phi   = z.d - s - R                                              (4)  [m]
    Phi_x = [ z^T, c_1 z^T, c_2 z^T, c_3 z^T, -z^T, (d + sum c_j e_j)^T ]    (5)  for (x_a, e_1, e_2, e_3, x_b, z)
    gamma = 2 zd.dd - (sum a_j^2 (zd_j^2 + 2 z_j ed_j.zd) - sd^2) / s        (6)  sd = sum a_j^2 z_j zd_j / s

Singular where s = 0: a disc that lies flat.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import UNDIRECTED, Point, Primitive, Vector, dot, floats, kernel, not_negative, scaled, shown, some

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike

E, P, Z = 3, 12, 15  # where e_1, x_b and z begin in x


class SmoothContact(Primitive):
    """An ellipsoid of a, or a disc or torus, touches a plane of b and slides on it: the contact row of `RollingDisc`.

    Parameters
    ----------
    first_a, second_a, third_a : array_like (3,)
        Directions of the semi-axes, at right angles.
    semi_axes : array_like (3,), m
        Of the ellipsoid; one is zero for a disc.
    tyre_radius : float, m
        Thickness added to the ellipsoid in all directions.

    Raises
    ------
    InvalidConstraint
        If a length is negative, or a place or body is wrong.

    Examples
    --------
    One row; `RollingBall` with `slip=True` has it, too:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0, 0.5))
    >>> axes = {"first_a": (1, 0, 0), "second_a": (0, 1, 0), "third_a": (0, 0, 1), "semi_axes": (0.5, 0.5, 0.5)}
    >>> contact = scene.add(ts.constraints.SmoothContact(ball, scene.ground, normal_b=(0, 0, 1), **axes))
    >>> print(contact.rows, scene.mobility().degrees_of_freedom)
    1 5
    """

    rows = 1
    markers = (
        Point("a", "center_a"),
        Vector("a", "first_a"),
        Vector("a", "second_a"),
        Vector("a", "third_a"),
        Point("b"),
        Vector("b", "normal_b"),
    )
    slots = 22
    normal = "normal_b"

    def __init__(
        self, a: BodyLike, b: BodyLike, *, semi_axes: ArrayLike | None = None, tyre_radius: float = 0.0, **places: Any
    ) -> None:
        super().__init__(a, b, **places)
        self.semi_axes = semi_axes
        self.tyre_radius = tyre_radius

    def check(self):
        """Refuse semi-axes that are negative, or of which two are zero."""
        lengths = floats(self.semi_axes)
        if lengths.shape != (3,) or not (np.isfinite(lengths) & (lengths >= 0.0)).all() or (lengths > 0.0).sum() < 2:
            raise self.error(
                f"{self.name}: semi_axes must be three positive lengths in m, one of them zero for a disc; got "
                f"{shown(self.semi_axes)}."
            )
        not_negative(self.tyre_radius, f"{self.name}: tyre_radius (m)", self.error)

    @property
    def reach(self) -> float:
        """The largest semi-axis, and R, m."""
        return float(floats(self.semi_axes).max()) + float(self.tyre_radius)

    def parameters(self):
        """(a_1^2, a_2^2, a_3^2, R, whether the plane moves)."""
        return (*(floats(self.semi_axes) ** 2).tolist(), float(self.tyre_radius), float(self.b.dimension > 0))

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (4)."""
        gap = 0.0
        for i in range(3):
            gap += x[Z + i] * (x[i] - x[P + i])
        out[0] = gap - support(x, par) - par[3]

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (5)."""
        s = support(x, par)
        for i in range(3):
            out[0, i] = x[Z + i]
            out[0, P + i] = -x[Z + i]
            out[0, Z + i] = x[i] - x[P + i]
        for j in range(3):
            e = E + 3 * j
            c = -par[j] * along(x, e, x, Z) / s
            for i in range(3):
                out[0, e + i] = c * x[Z + i]
                out[0, Z + i] += c * x[e + i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (6)."""
        s, sd, bias = support(x, par), 0.0, 0.0
        for j in range(3):
            e = E + 3 * j
            z = along(x, e, x, Z)
            zd = along(xd, e, x, Z) + along(x, e, xd, Z)
            sd += par[j] * z * zd / s
            bias -= par[j] * (zd * zd + 2.0 * z * along(xd, e, xd, Z))
        bias = (bias + sd * sd) / s
        for i in range(3):
            bias += 2.0 * xd[Z + i] * (xd[i] - xd[P + i])
        out[0] = bias

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (5)."""
        contact_series(x, par, k, s, out)

    @staticmethod
    def arm_series(n, par, k, s, out):
        """Of Eq. (3), c_j - R z_j; rows of `expand`."""
        count = axes(par)
        out[2] = 0.0
        for j in range(count):
            s[15 + j, k] = n[j]
        expand(par, count, k, s)
        for j in range(count):
            out[j] = s[19 + j, k] - par[3] * n[j]

    @staticmethod
    def contact(x, par):
        """Contact point and normal, (3, k) each, of marker coordinates x (len(x), k)."""
        s, point = support(x, par), x[:3] - par[3] * x[Z : Z + 3]
        for e, length in zip((E, E + 3, E + 6), par, strict=False):
            point = point - length * along(x, e, x, Z) / s * x[e : e + 3]
        return point, x[Z : Z + 3]

    @staticmethod
    def singular_place(x, par):
        """What is singular at marker coordinates x, if anything."""
        if support(x, par) > UNDIRECTED * np.sqrt(max(par[:3])):
            return ""
        return "the disc lies flat on its plane, and no point of its rim is the lowest"

    @classmethod
    def example(cls, rng, a, b):
        """A random ellipsoid with a tyre."""
        places = {marker.argument: rng.normal(size=3) for marker in cls.markers}
        places.update(zip(("first_a", "second_a", "third_a"), np.linalg.qr(rng.normal(size=(3, 3)))[0].T, strict=True))
        return cls(a, b, **places, semi_axes=rng.uniform(0.5, 2.0, 3), tyre_radius=rng.uniform(0.1, 0.5))


@kernel
def along(x, i, y, j):
    """The scalar product of the vectors from i in x and from j in y."""
    return x[i] * y[j] + x[i + 1] * y[j + 1] + x[i + 2] * y[j + 2]


@kernel
def support(x, par):
    """s of Eq. (2)."""
    square = 0.0
    for j in range(3):
        z = along(x, E + 3 * j, x, Z)
        square += par[j] * z * z
    return np.sqrt(square)


@kernel
def contact_series(x, par, k, s, out):
    """Coefficient k of Eq. (5), out[0]; rows of e_j, z, d, z_j, s, c_j.

    The third axis of a thin disc is left out, and what is for a plane that moves where it is the ground's.
    """
    count = axes(par)
    for i in range(9):
        s[i, k] = x[E + i]
    for i in range(3):
        s[9 + i, k], s[12 + i, k] = x[Z + i], x[i] - x[P + i]
        out[0, i], out[0, P + i], out[0, Z + i] = x[Z + i], -x[Z + i], x[i] - x[P + i]
    for j in range(count):
        s[15 + j, k] = dot_plane(s, 3 * j, 9, k, par)
    expand(par, count, k, s)
    for j in range(count):
        e = E + 3 * j
        out[0, e], out[0, e + 1], out[0, e + 2] = scaled_plane(s, 9, 19 + j, k, par)
        if moves(par):
            f0, f1, f2 = scaled(s, 3 * j, 19 + j, k)
            out[0, Z] += f0
            out[0, Z + 1] += f1
            out[0, Z + 2] += f2


@kernel
def expand(par, count, k, s):
    """Coefficients k of s and c_j, Eqs. (2) and (3), in one loop: their sums don't wait for each other."""
    x, y, z, r = s[15], s[16], s[17], s[18]
    xx, yy, zz, rr, xr, yr, zr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for l in range(1, k):
        u = r[k - l]
        xx += x[l] * x[k - l]
        yy += y[l] * y[k - l]
        rr += r[l] * u
        xr += s[19, l] * u
        yr += s[20, l] * u
        if count == 3:
            zz += z[l] * z[k - l]
            zr += s[21, l] * u
    ends = 2.0 if k > 0 else 1.0
    square = par[0] * (ends * x[0] * x[k] + xx) + par[1] * (ends * y[0] * y[k] + yy)
    square += par[2] * (ends * z[0] * z[k] + zz) if count == 3 else 0.0
    if k == 0:
        r[0] = np.sqrt(square)
    else:
        # 2 s_0 s_k + rr = square,  c_0 s_k + c_k s_0 + xr = -a^2 z_k
        r[k] = 0.5 * (square - rr) / r[0]
        xr += s[19, 0] * r[k]
        yr += s[20, 0] * r[k]
        zr += s[21, 0] * r[k]
    s[19, k] = -(par[0] * x[k] + xr) / r[0]
    s[20, k] = -(par[1] * y[k] + yr) / r[0]
    s[21, k] = -(par[2] * z[k] + zr) / r[0] if count == 3 else 0.0


@kernel
def axes(par):
    """How many e_j matter."""
    return 3 if some(par[2] + par[3]) else 2


@kernel
def moves(par):
    """Whether the plane is one of a body."""
    return some(par[4])


@kernel
def dot_plane(s, i, j, k, par):
    """Coefficient k of the scalar product of the vector in rows i on of s and one of the plane, in rows j on."""
    if moves(par):
        return dot(s, i, j, k)
    return s[i, k] * s[j, 0] + s[i + 1, k] * s[j + 1, 0] + s[i + 2, k] * s[j + 2, 0]


@kernel
def scaled_plane(s, i, j, k, par):
    """Coefficient k of the vector of the plane in rows i on of s times the number in row j."""
    if moves(par):
        return scaled(s, i, j, k)
    return s[i, 0] * s[j, k], s[i + 1, 0] * s[j, k], s[i + 2, 0] * s[j, k]
