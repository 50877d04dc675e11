"""Radau IIA of order 5 for differential-algebraic equations (scipy_dae), on the stabilised index-2 form."""

import numpy as np

from ..contender import Contender, timed


class Radau(Contender):
    """Residual and Jacobian compiled; dense factors, sparse for many unknowns."""

    name = "Radau (scipy_dae)"
    largest = 64
    values = tuple(10.0**-k for k in range(3, 13))
    package, get = "scipy_dae", "pip install scipy-dae"

    def prepare(self, scene):
        """Compile, and find the pattern."""
        from scipy.sparse import csc_matrix
        from scipy_dae.integrate import solve_dae

        from .ggl import System

        system = System(scene.definition())
        n, sparse = system.n, system.n > 300
        kept = np.zeros(n)
        kept[system.state] = 1.0
        Jd = np.diag(kept)
        Jd = csc_matrix(Jd) if sparse else Jd

        def f(t, y, yd):
            out = np.empty(n)
            system.residual(y, yd, out)
            return out

        def jacobian(t, y, yd):
            J = csc_matrix((system.jacobian(y, yd, 0.0).copy(), system.rows, system.first), shape=(n, n))
            return J if sparse else J.toarray(), Jd

        def run(tol):
            span = (0.0, scene.end)
            atol = np.where(kept > 0.0, tol, 1e6)
            seconds, found = timed(
                lambda: solve_dae(
                    f,
                    span,
                    system.y,
                    system.yd,
                    method="Radau",
                    rtol=max(tol, 1e-13),
                    atol=atol,
                    jac=jacobian,
                )
            )
            if not found.success:
                raise RuntimeError(str(found.message))
            return system.outcome(seconds, found.y[:, -1])

        return run
