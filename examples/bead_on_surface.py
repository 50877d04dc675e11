"""A plug-in constraint in one file: a bead that slides on an implicit surface F(x) = 0, here an ellipsoid.

    F     = (x/a)^2 + (y/b)^2 + (z/c)^2 - 1
    Phi   = F s / 2,  Phi_x = s (x/a^2, y/b^2, z/c^2)    s a length, so that Phi is one
    gamma = s ((xd/a)^2 + (yd/b)^2 + (zd/c)^2)           the second derivative of F along the velocity

Run it: python examples/bead_on_surface.py
"""

import numpy as np
from scipy.integrate import solve_ivp

import tsdyn as ts


class OnEllipsoid(ts.Primitive):
    """Keep a point of a body on an ellipsoid centred at the ground's origin.

    Parameters
    ----------
    a : Body
        The body, or point mass, that slides.
    point_a : array_like (3,), m
        The point, in a's frame.
    semi_axes : array_like (3,), m
        Positive.
    """

    rows = 1
    markers = (ts.Point("a"),)

    def __init__(self, a, *, point_a=(0.0, 0.0, 0.0), semi_axes=(1.0, 1.0, 1.0), name=""):
        super().__init__(a, None, (point_a,), name)
        if not (np.shape(semi_axes) == (3,) and np.isfinite(semi_axes).all() and min(semi_axes) > 0.0):
            raise ts.InvalidConstraint(f"{self.name}: semi_axes must be three positive lengths, got {semi_axes!r}.")
        self.semi_axes = semi_axes

    def parameters(self):
        """(1/a^2, 1/b^2, 1/c^2, s)."""
        return (*(1.0 / length**2 for length in self.semi_axes), min(self.semi_axes))

    @staticmethod
    def phi(x, par, t, out):
        """F s / 2."""
        out[0] = 0.5 * par[3] * (par[0] * x[0] ** 2 + par[1] * x[1] ** 2 + par[2] * x[2] ** 2 - 1.0)

    @staticmethod
    def jacobian(x, par, t, out):
        """Its gradient."""
        for i in range(3):
            out[0, i] = par[3] * par[i] * x[i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Its second derivative along xd."""
        out[0] = par[3] * (par[0] * xd[0] ** 2 + par[1] * xd[1] ** 2 + par[2] * xd[2] ** 2)


SEMI_AXES = (2.0, 1.0, 1.5)


def build():
    """Return the scene: a bead of 0.2 kg at the end of the long axis, pushed sideways and down."""
    scene = ts.Scene()
    bead = scene.add_point_mass(mass=0.2, position=(SEMI_AXES[0], 0.0, 0.0), velocity=(0.0, 3.0, -1.0), name="bead")
    scene.add(OnEllipsoid(bead, semi_axes=SEMI_AXES, name="surface"))
    return scene


def reference(times):
    """Positions by SciPy at 1e-12, from the index-1 form xdd = g - grad F (...): independent of tsdyn."""
    weights, g = 1.0 / np.square(SEMI_AXES), np.array([0.0, 0.0, -9.81])

    def rates(t, y):
        normal = weights * y[:3]
        push = (normal @ g + weights @ y[3:] ** 2) / (normal @ normal)
        return np.concatenate((y[3:], g - normal * push))

    start = [SEMI_AXES[0], 0.0, 0.0, 0.0, 3.0, -1.0]
    return solve_ivp(rates, (0.0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-12).y[:3].T


def check(solution):
    """The bead stays on the surface to rounding, keeps its energy, and is where SciPy says."""
    assert solution.success, solution.message
    errors = [error.max() for error in solution.constraint_error]
    assert np.less(errors, (1e-14, 1e-13, 1e-12)).all(), errors
    assert np.ptp(solution.energy) < 1e-8
    position = solution.position(solution.scene.body("bead"))
    assert np.abs(position - reference(solution.t)).max() < 1e-7


def main():
    """Check the plug-in, then run it for 5 s."""
    ts.testing.check_primitive(OnEllipsoid)
    solution = ts.simulate(build(), (0.0, 5.0), integrator=ts.integrators.Nystrom4(step=1e-3))
    print(solution, f"  distance from SciPy {np.abs(solution.q - reference(solution.t)).max():.1e} m", sep="\n")
    check(solution)


if __name__ == "__main__":
    main()
