"""SciPy's DOP853 on the index-1 form in absolute coordinates: multipliers eliminated, the constraints left to drift."""

import scipy

from ..contender import Contender, Outcome, rotation, timed


class Index1(Contender):
    """Compiled right-hand side, SciPy's loop."""

    name = "SciPy DOP853, index 1"
    largest = 64

    def version(self):
        """SciPy's."""
        return f"SciPy {scipy.__version__}"

    def prepare(self, scene):
        """Compile, and pack the definition."""
        import numpy as np
        from scipy.integrate import solve_ivp

        from .absolute import accelerate, pack

        packed, x = pack(scene.definition())
        xd, lam = np.empty_like(x), np.empty(packed[0][2])

        def f(t, y):
            accelerate(*packed, y.reshape(x.shape), xd, lam)
            return xd.ravel().copy()

        f(0.0, x.ravel())

        def run(tol):
            span = (0.0, scene.end)
            seconds, found = timed(
                lambda: solve_ivp(f, span, x.ravel(), method="DOP853", rtol=max(tol, 3e-14), atol=tol, t_eval=span)
            )
            if not found.success:
                raise RuntimeError(found.message)
            end = found.y[:, -1].reshape(x.shape)
            return Outcome(seconds, end[:, :3], rotation(end[:, 3:7]))

        return run
