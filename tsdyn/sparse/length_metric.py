"""The metric of lengths, in which the rank of constraint rows is judged: geometry alone, whatever the masses.

    |x|^2 = sum |dr|^2 + L^2 |w'|^2

L is the longest arm of a body's joints, m.
"""

import numpy as np

from .constraint_graph import W_MASS, W_ROTATION, WEIGHTS
from .massless_axes import AXIS_OWN, levers
from .tolerances import LEAST_ARM, UNEQUAL

MASS_REMEDY = "Give light bodies that carry heavy ones more mass, or make them one body with what they carry."


def arms(packed):
    """L of each body, (bodies,), m: no less than a share of the longest; one in a scene without arms."""
    found = levers(packed)
    longest = found.max(initial=0.0)
    return np.maximum(found, LEAST_ARM * longest) if longest > 0.0 else np.ones(found.size)


def coordinate_scales(packed):
    """Factors (n,) that make columns of Phi_q those of dr and of 2 L dp, whose length is that of L w'."""
    bodies, L = packed.system.bodies, arms(packed)
    scales = np.ones(int(bodies[:, 1].sum()))
    rigid = bodies[:, 1] == 7
    scales[bodies[rigid, :1] + np.arange(3, 7)] = 0.5 / L[rigid, None]
    return scales


def by_lengths(packed, graph):
    """The constraint graph with the inverse of this metric for W, and without axis rows but in name."""
    inverse, values = np.zeros((len(graph.bodies) + 1, WEIGHTS)), np.zeros_like(graph.axes.values)
    inverse[:-1, W_MASS] = 1.0
    rigid = np.flatnonzero(graph.bodies[:, 1] == 7)
    inverse[rigid[:, None], W_ROTATION + np.array([0, 5, 10])] = arms(packed)[rigid, None] ** -2.0
    values[:, AXIS_OWN] = -1.0
    return graph._replace(inverse=inverse.ravel(), axes=graph.axes._replace(values=values))


def are_unequal(system):
    """Whether heavy bodies may load light ones: the factors of S, and accelerations, lose digits to their ratio."""
    largest = np.abs(system.inertia).max(axis=1)  # zero for a point mass
    return any(x.max() > UNEQUAL * x.min() for x in (system.mass, largest[largest > 0.0]) if x.size)


def mass_ratio(packed, least=0.0):
    """The lightest and the heaviest body by mass or inertia, for messages; empty where their ratio is below `least`."""
    system, bodies = packed.system, np.arange(len(packed.bodies))
    rigid = bodies[system.bodies[:, 1] == 7]
    found = [(bodies, system.mass, "kg"), (rigid, np.abs(system.inertia[rigid]).max(axis=1), "kg m^2")]
    which, sizes, unit = min((each for each in found if each[0].size), key=lambda each: each[1].min() / each[1].max())
    light, heavy = sizes.argmin(), sizes.argmax()
    if sizes[heavy] < least * sizes[light]:
        return ""
    one, other = (f"{packed.bodies[which[i]].name} ({sizes[i]:.3g} {unit})" for i in (light, heavy))
    return f"the mass ratio of these bodies is too large for accelerations in double precision: {one} beside {other}"
