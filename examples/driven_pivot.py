"""A time-dependent plug-in constraint: a pendulum on a vibrating pivot, here fast enough to stand upside down.

    c(t)  = (0, 0, h cos(w t))                   position of the pivot
    Phi   = x_a - c(t),   Phi_x = I
    Phi_t = -cd = (0, 0, h w sin(w t))
    gamma = -cdd = (0, 0, h w^2 cos(w t))

`build_driven` is the same scene without a plug-in, by a `PointDriver` and one of ts.motions; Taylor runs it, too.

Kapitza's pendulum: the inverted position is stable if h w > sqrt(2 g L'), L' = (I + m L^2) / (m L).

Run it: python examples/driven_pivot.py
"""

import numpy as np
from scipy.integrate import solve_ivp

import tsdyn as ts

MASS, INERTIA, LENGTH = 1.0, 0.1, 0.5
HEIGHT, FREQUENCY, START = 0.05, 120.0, 0.3


class DrivenPivot(ts.Primitive):
    """Hold a point of a body at a point that moves up and down as h cos(w t).

    Parameters
    ----------
    a : Body
        The body.
    point_a : array_like (3,), m
        The point, in a's frame.
    height : float, m
        Amplitude h.
    frequency : float, rad/s
        Angular frequency w.
    """

    rows = 3
    markers = (ts.Point("a"),)

    def __init__(self, a, *, point_a=(0.0, 0.0, 0.0), height=HEIGHT, frequency=FREQUENCY, name=""):
        super().__init__(a, None, (point_a,), name)
        self.height, self.frequency = float(height), float(frequency)

    def parameters(self):
        """(h, w)."""
        return self.height, self.frequency

    @staticmethod
    def phi(x, par, t, out):
        """x_a - c."""
        out[0] = x[0]
        out[1] = x[1]
        out[2] = x[2] - par[0] * np.cos(par[1] * t)

    @staticmethod
    def jacobian(x, par, t, out):
        """The identity."""
        for i in range(3):
            out[i, i] = 1.0

    @staticmethod
    def phi_t(x, par, t, out):
        """-cd."""
        out[0] = 0.0
        out[1] = 0.0
        out[2] = par[0] * par[1] * np.sin(par[1] * t)

    @staticmethod
    def gamma(x, xd, par, t, out):
        """-cdd."""
        out[0] = 0.0
        out[1] = 0.0
        out[2] = par[0] * par[1] ** 2 * np.cos(par[1] * t)


def build():
    """Return the scene: a rod nearly upside down, 0.3 rad off, at rest on its shaken pivot."""
    scene, rod = standing()
    scene.add(DrivenPivot(rod, point_a=(0.0, 0.0, -LENGTH), name="pivot"))
    return scene


def build_driven():
    """Return the same scene with a built-in driver."""
    scene, rod = standing()
    path = 0.0, 0.0, ts.motions.Sine(HEIGHT, FREQUENCY, phase=np.pi / 2)
    scene.add(ts.constraints.PointDriver(scene.ground, rod, point_b=(0.0, 0.0, -LENGTH), path=path, name="pivot"))
    return scene


def standing():
    """Return a scene and its rod, without the pivot."""
    scene = ts.Scene()
    rod = scene.add_body(
        mass=MASS,
        inertia=(INERTIA, INERTIA, 0.02),
        position=(LENGTH * np.sin(START), 0.0, HEIGHT + LENGTH * np.cos(START)),
        orientation=(np.cos(START / 2), 0.0, np.sin(START / 2), 0.0),
        name="rod",
    )
    return scene, rod


def reference(times):
    """The angle from the upright by SciPy at 1e-12, in this minimal coordinate."""
    inertia = INERTIA + MASS * LENGTH**2

    def rates(t, y):
        lift = 9.81 - HEIGHT * FREQUENCY**2 * np.cos(FREQUENCY * t)
        return [y[1], MASS * LENGTH * lift * np.sin(y[0]) / inertia]

    return solve_ivp(rates, (0.0, times[-1]), [START, 0.0], "DOP853", times, rtol=1e-12, atol=1e-12).y[0]


def angle(solution):
    """The rod's angle from the upright, rad."""
    axis = solution.rotation(solution.scene.body("rod"))[:, :, 2]
    return np.arctan2(axis[:, 0], axis[:, 2])


def check(solution, tol=1e-6):
    """The pivot is where it should be on all three levels, the angle is SciPy's, and the rod stays up."""
    assert solution.success, solution.message
    errors = [error.max() for error in solution.constraint_error]
    bounds = (1e-14, 1e-13 * (1.0 + np.abs(solution.qd).max()), 1e-12 * (1.0 + np.abs(solution.qdd).max()))
    assert np.less(errors, bounds).all(), errors
    assert np.abs(angle(solution) - reference(solution.t)).max() < tol
    assert np.abs(angle(solution)).max() < 0.5


def main():
    """Check the plug-in, then run it for 3 s."""
    ts.testing.check_primitive(DrivenPivot)
    solution = ts.simulate(build(), (0.0, 3.0), integrator=ts.integrators.Nystrom4(step=2e-4))
    check(solution)
    print(solution)
    print(f"  stays within {np.abs(angle(solution)).max():.3f} rad of upside down")
    print(f"  distance from SciPy {np.abs(angle(solution) - reference(solution.t)).max():.1e} rad")


if __name__ == "__main__":
    main()
