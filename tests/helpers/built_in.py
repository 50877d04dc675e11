"""Every built-in constraint, joint, force and integrator by its registration: a new one is tested without an edit."""

import tsdyn as ts


def _built_in(registered):
    return [kind for kind in registered if kind.__module__.startswith("tsdyn.")]


PRIMITIVES = _built_in(ts.constraints.registered())
JOINTS = _built_in(ts.constraints.registered_joints())
FORCES = _built_in(ts.forces.registered())
INTEGRATORS = _built_in(ts.integrators.registered())
by_name = {"ids": lambda kind: kind.__name__}
