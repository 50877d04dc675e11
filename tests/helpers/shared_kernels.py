"""The kernels that most tests need: explicit methods and Taylor, every form, all constraints and most forces.

What is rare isn't among them, and most tests of it are `slow`: implicit methods, lanes, series of a thousand bodies,
friction of joints.
"""

import tsdyn as ts
from tests.helpers.built_in import FORCES, PRIMITIVES
from tsdyn.ahead import of_constraint, of_force, of_method
from tsdyn.configuration import initial_conditions
from tsdyn.formulations.registry import FORMULATIONS
from tsdyn.jit.compiled import is_declared
from tsdyn.motions.program import run_program
from tsdyn.observables import evaluate
from tsdyn.observables.reactions import solve_multipliers
from tsdyn.rows.row_selection import reselect_rows


def shared_kernels():
    """Yield them, with repetitions."""
    I, (tangent, *others) = ts.integrators, FORMULATIONS.values()
    explicit = I.DOP853(1e-8, 1e-8), I.RK45(1e-6, 1e-6), I.Nystrom4()
    for method in (I.Taylor(1e-8), *explicit):
        yield from of_method(method, tangent, True)
    for form in others:
        for method in explicit:
            yield from of_method(method, form, True)
    yield from filter(is_declared, vars(initial_conditions).values())  # those of assembly
    yield from (reselect_rows, run_program, solve_multipliers, evaluate._choose)
    for kind in PRIMITIVES:
        for moving in (False, *[True] * ("phi_t" in kind.kernels)):
            yield from of_constraint(kind, moving)
    for kind in FORCES:
        if not issubclass(kind, ts.JointFriction):
            yield from of_force(kind.own_kernels)
