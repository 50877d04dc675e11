"""What follows from the packed scene, asked of that of each phase of a run."""

from functools import wraps

import numpy as np


def in_phases(method):
    """Decorate a method without arguments that returns arrays over the outputs, a tuple of them, or a named tuple."""

    @wraps(method)
    def call(self):
        return by_phase(self, method)

    return call


def by_phase(solution, ask, whole=False):
    """What a solution says; where phases differ in forces or numbers, what the outputs of each packed scene say.

    whole: as of `Phases.parts`, to ask about a constraint.
    """
    phases = getattr(solution, "_phases", None)
    return ask(solution) if phases is None or not phases.varies else gathered(solution, ask, whole)


def gathered(solution, ask, whole=False):
    """What the outputs of each packed scene say, in the order of the outputs."""
    found, order = [], []
    for part, mine in solution._phases.parts(solution, whole):
        found.append(ask(part))
        order.append(mine)
    back = np.argsort(np.concatenate(order), kind="stable")
    if isinstance(found[0], tuple):
        columns = [np.concatenate(column)[back] for column in zip(*found, strict=True)]
        return type(found[0])(*columns) if hasattr(found[0], "_fields") else tuple(columns)
    return np.concatenate(found)[back]
