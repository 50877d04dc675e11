"""Methods of every kind, as options of `simulate`."""

import tsdyn as ts

I = ts.integrators


def one_of_each(tol, step):
    """Series, stages in two forms at a tolerance, fixed steps, an implicit method; by name."""
    return {
        "taylor": {"integrator": I.Taylor(tol=1e-12)},
        "dop853": {"integrator": I.DOP853(tol, tol)},
        "null-space": {"integrator": I.DOP853(tol, tol), "formulation": "null-space"},
        "nystrom4": {"integrator": I.Nystrom4(step=step)},
        "sdirk54": {"integrator": I.SDIRK54(1e-9, 1e-9)},
    }
