"""The kernels that most tests need: every method and form once, and all constraints and forces with the default method.

What is rare (Hessians of most constraints, series of a thousand bodies, friction by every form) isn't among them: tests
of it are `slow`, or compile what they need.
"""

import tsdyn as ts
from tests.helpers.built_in import FORCES, PRIMITIVES
from tsdyn.ahead.first_run import of_constraint, of_force, of_method
from tsdyn.formulations.registry import FORMULATIONS

IMPLICIT = ("Spherical", "Dot1", "Distance", "EulerNormalization")  # constraints with implicit methods


def shared_kernels():
    """Yield them, with repetitions."""
    I, (tangent, *others) = ts.integrators, FORMULATIONS.values()
    for method in (I.Taylor(1e-8), I.DOP853(1e-8, 1e-8), I.Nystrom4(), I.RK45(1e-6, 1e-6), I.SDIRK54(1e-6, 1e-6)):
        yield from of_method(method, tangent, True)
    for form in others:
        yield from of_method(I.DOP853(1e-8, 1e-8), form, True)
    for kind in PRIMITIVES:
        for moving in (False, *[True] * ("phi_t" in kind.kernels)):
            yield from of_constraint(kind, moving, implicit=kind.__name__ in IMPLICIT)
    for kind in FORCES:
        yield from of_force(kind.own_kernels)
