"""SUNDIALS IDA (variable-order BDF) on the stabilised index-2 form; residual and Jacobian compiled."""

import warnings

import numpy as np

from ..contender import Contender, timed


class IDA(Contender):
    """Through scikit-sundae; sparse factors where they pay; multipliers are left out of the error test."""

    name = "SUNDIALS IDA"
    largest = 64
    values = tuple(10.0**-k for k in range(3, 13))
    get = "pip install scikit-sundae"

    def version(self):
        """The package's, and SUNDIALS'."""
        import sksundae

        return f"scikit-sundae {sksundae.__version__}, SUNDIALS {getattr(sksundae, 'SUNDIALS_VERSION', '')}".strip(", ")

    def prepare(self, scene):
        """Compile, and find the pattern."""
        from sksundae.ida import IDA as Solver

        from .ggl import System

        system = System(scene.definition())
        n, band = system.n, system.band
        if 4 * band < n:
            how = {"linsolver": "band", "lband": band, "uband": band}
        elif n < 200:
            how = {"linsolver": "dense"}
        else:
            how = {"linsolver": "sparse", "sparsity": system.pattern}

        def f(t, y, yd, out):
            system.residual(y, yd, out)

        def jacobian(t, y, yd, out, shift, J):
            values = system.jacobian(y, yd, shift)
            if J.ndim == 1:
                J[:] = values
            else:
                J[system.rows, system.columns] = values

        def run(tol):
            atol = np.full(system.n, tol)
            atol[system.algebraic] = 1e6
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # that a pattern is given with a Jacobian
                solver = Solver(
                    f, jacfn=jacobian, algebraic_idx=system.algebraic, rtol=tol, atol=atol, max_num_steps=10_000_000,
                    first_step=1e-6, **how,
                )  # fmt: skip
            seconds, found = timed(solver.solve, [0.0, 0.5 * scene.end, scene.end], system.y, system.yd)
            if not found.success:
                raise RuntimeError(str(found.message))
            return system.outcome(seconds, found.y[-1])

        return run
