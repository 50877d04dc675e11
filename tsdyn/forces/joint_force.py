"""Force along a joint's axis as a function of time, displacement and rate: a linear actuator with a control law.

    f = F e at x_b on b, -F e there on a             (1)  [N]  e: the axis, in the ground frame
    s = e.(x_b - x_a)                                (2)  the displacement
    F = function(t, s, sd)                           (3)  continuous
    F = function(t_k, s(t_k), sd(t_k))               (4)  from t_k = k period to t_{k+1}

The power of (1) is F sd for any motion of the bodies.
"""

from ..constraints.translational import Translational
from ..plugins import ByState, Force, JointLoad, Point, Vector, displacements, dot, load_at, scaled


class JointForce(JointLoad, Force):
    """Force along the axis of a joint, a function of time, displacement and rate; sampled and held if it has a period.

    Parameters
    ----------
    joint : Joint
        Of the scene, with a displacement: Translational, Cylindrical, PointOnLine, Screw, ...
    function : callable (t, displacement, rate) -> float, N
        t in s, the displacement in m, the rate in m/s; else as for JointTorque.
    period : float, s, optional
        As for JointTorque.
    which : int
        Index of the displacement, of a joint with several.

    Raises
    ------
    InvalidForce
        As for JointTorque.

    Notes
    -----
    Its power is applied power.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> table = scene.add_body(mass=2.0, inertia=(1, 1, 1))
    >>> slide = scene.add(ts.constraints.Translational.at(scene.ground, table, point=(0, 0, 0), axis=(1, 0, 0)))
    >>> drive = scene.add(ts.forces.JointForce(slide, function=lambda t, displacement, rate: 4.0, period=0.1))
    >>> print(f"{ts.simulate(scene, (0, 1)).state.displacement(slide):.4f} m")
    1.0000 m
    """

    markers = (Vector("a", "axis"), Point("a", "own_point"), Point("b", "other_point"))
    coordinate = "displacement"
    kind_of_example = Translational
    geometries = staticmethod(displacements)

    @staticmethod
    def directions(geometry):
        """The axis and the two points."""
        return geometry.e, geometry.s_own, geometry.s_other

    @staticmethod
    def law(x, xd, par, t, out):
        """Eqs. (1), (4); conjugate to e is F (x_b - x_a)."""
        for i in range(3):
            out[i], out[3 + i], out[6 + i] = par[0] * (x[6 + i] - x[3 + i]), -par[0] * x[i], par[0] * x[i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (1), F being constant."""
        for i in range(3):
            out[i], out[3 + i], out[6 + i] = par[0] * (x[6 + i] - x[3 + i]), -par[0] * x[i], par[0] * x[i]

    @staticmethod
    def remember(x, xd, par, t):
        """The held force."""
        return par[0]


def _law(x, xd, par, t, out):
    s, rate = 0.0, 0.0
    for i in range(3):
        s += x[i] * (x[6 + i] - x[3 + i])
        rate += x[i] * (xd[6 + i] - xd[3 + i]) + xd[i] * (x[6 + i] - x[3 + i])
    force = load_at(t, s, rate, par)
    for i in range(3):
        out[i], out[3 + i], out[6 + i] = force * (x[6 + i] - x[3 + i]), -force * x[i], force * x[i]


class _ContinuousForce(ByState, JointForce):
    """By the function at every evaluation, Eq. (3)."""

    given = "function"
    template = staticmethod(_law)
    memory, remember = 0, None
    arguments, slots, place = (1, 1, 1), 13, 12
    check, parameters = JointLoad.check, ByState.parameters

    @staticmethod
    def inputs(x, xd, par, k, first, s):
        """Displacement and rate; rows of e, x_b - x_a, and of their rates."""
        for i in range(3):
            s[i, k], s[3 + i, k] = x[i], x[6 + i] - x[3 + i]
            s[6 + i, k], s[9 + i, k] = xd[i], xd[6 + i] - xd[3 + i]
        s[first, k] = dot(s, 0, 3, k)
        s[first + 1, k] = dot(s, 0, 9, k) + dot(s, 6, 3, k)
        for i in range(par.size):
            s[first + 2 + i, k] = par[i] if k == 0 else 0.0

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (1), F in row 12."""
        out[0], out[1], out[2] = scaled(s, 3, 12, k)
        out[6], out[7], out[8] = scaled(s, 0, 12, k)
        out[3], out[4], out[5] = -out[6], -out[7], -out[8]
