"""Torque about a joint's axis as a function of time, angle and rate: a motor with a control law.

    N = T u on b, -T u on a                          (1)  [N m]  u: the axis, in the ground frame
    T = function(t, angle, rate)                     (2)  continuous
    T = function(t_k, angle(t_k), rate(t_k))         (3)  from t_k = k period to t_{k+1}

The power of (1) is T times the rate of the angle if the joint holds the axis.
"""

import numpy as np

from ..constraints.revolute import Revolute
from ..plugins import ByState, Force, JointLoad, Turn, Vector, angle_about, angle_series, angles, dot, load_at, scaled


class JointTorque(JointLoad, Force):
    """Torque about the axis of a joint, a function of time, angle and rate; sampled and held if it has a period.

    Parameters
    ----------
    joint : Joint
        Of the scene, with an angle: Revolute, Cylindrical, Universal, ... The torque has the sign of the angle.
    function : callable (t, angle, rate) -> float, N m
        t in s, the angle in rad, counted over full turns, the rate in rad/s. Without a period, a plain Python function
        that Numba can compile. With a period, any callable: it is called in Python at the sampling times only, in
        their order, and may have a state of its own, such as the integral of a PID controller. Its method `reset()`,
        if any, is called before each run that doesn't continue from a state.
    period : float, s, optional
        Sampling period: the function is called at k period, and the torque is held in between. Steps end at sampling
        times, so every method keeps its order.
    which : int
        Index of the angle, of a joint with several (Universal).

    Raises
    ------
    InvalidForce
        If the joint has no such angle or isn't in the scene, the period is not positive, or the function has other
        arguments.

    Notes
    -----
    Its power is applied power. Turns are counted as for `solution.angle(joint)`. An exception of the function, or a
    value that is not finite, ends the run.

    Examples
    --------
    A controller with a sampling period of 10 ms holds a wheel at 1 rad:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> def controller(t, angle, rate):
    ...     return 50.0 * (1.0 - angle) - 20.0 * rate
    >>> drive = scene.add(ts.forces.JointTorque(hinge, function=controller, period=0.01))
    >>> print(f"{ts.simulate(scene, (0, 3)).state.angle(hinge):.3f} rad")
    1.000 rad
    """

    markers = (Vector("a", "axis"), Turn("a"), Turn("b"))
    coordinate = "angle"
    kind_of_example = Revolute
    geometries = staticmethod(angles)

    @staticmethod
    def directions(geometry):
        """The axis."""
        return (np.cross(geometry.f, geometry.g),)

    @staticmethod
    def law(x, xd, par, t, out):
        """Eqs. (1), (3)."""
        for i in range(3):
            out[i] = 0.0 * x[i]
            out[3 + i], out[6 + i] = -par[0] * x[i], par[0] * x[i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (1), T being constant."""
        for i in range(3):
            out[3 + i], out[6 + i] = -par[0] * x[i], par[0] * x[i]

    @staticmethod
    def remember(x, xd, par, t):
        """The held torque."""
        return par[0]


def _law(x, xd, par, t, out):
    turned = angle_about(x, par[par.size - 1])
    rate = x[0] * (xd[12] - xd[9]) + x[1] * (xd[13] - xd[10]) + x[2] * (xd[14] - xd[11])
    torque = load_at(t, turned, rate, par)
    for i in range(9):
        out[i] = 0.0
    for i in range(3):
        out[9 + i], out[12 + i] = -torque * x[i], torque * x[i]


class _ContinuousTorque(ByState, JointTorque):
    """By the function at every evaluation, Eq. (2); what it remembers is the angle."""

    remembers_angle = True
    markers = (Vector("a", "axis"), Vector("a", "reference"), Vector("b", "direction"), Turn("a"), Turn("b"))
    given = "function"
    template = staticmethod(_law)
    arguments, slots, place = (1, 1, 1), 20, 19
    check, parameters = JointLoad.check, ByState.parameters

    @staticmethod
    def directions(geometry):
        """The axis, and the two directions that enclose the angle."""
        return np.cross(geometry.f, geometry.g), geometry.f, geometry.h

    @staticmethod
    def inputs(x, xd, par, k, first, s):
        """Angle and rate; rows of u, f, g, those of `angle_series`, and of the omegas' difference."""
        for i in range(9):
            s[i, k] = x[i]
        for i in range(3):
            s[12 + i, k] = xd[12 + i] - xd[9 + i]
        angle_series(par[par.size - 1], k, s)
        s[first, k] = s[18, k]
        s[first + 1, k] = dot(s, 0, 12, k)
        for i in range(par.size - 1):
            s[first + 2 + i, k] = par[i] if k == 0 else 0.0

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (1), T in row 19."""
        out[12], out[13], out[14] = scaled(s, 0, 19, k)
        out[9], out[10], out[11] = -out[12], -out[13], -out[14]

    @staticmethod
    def remember(x, xd, par, t):
        """The angle."""
        return angle_about(x, par[par.size - 1])
