"""Memory layout of the series of joint friction: which forces of which markers its reaction is made of."""

from typing import NamedTuple

import numpy as np

from ..elements.element import address
from ..elements.loops.constraint_series import force_at
from ..elements.loops.friction_series import REACTION
from ..elements.markers import POINT
from ..errors import InvalidForce
from ..formulations.locked_orientations import instances
from ..jit.kernels import records
from .tables import FrictionSeries, ReactionSource


class FrictionLayout(NamedTuple):
    """Parts of an `Expansion`."""

    frictions: np.ndarray
    sources: np.ndarray


def kept_multipliers(graph):
    """Size of Expansion.kept."""
    return len(graph.row) if len(graph.frictions) else 0


def lay_out_frictions(packed, graph, places, forces, orders):
    """The `FrictionLayout` of a packed scene; places and forces are those of the `Expansion`."""
    found = sorted((load for load in packed.loads if load.normal >= 0), key=lambda load: load.normal)
    frictions, sources = [], []
    if found:
        where = _instances(packed, graph, places)
        index = {id(body): i for i, body in enumerate(packed.bodies)}
        members = {id(member.constraint): member for member in packed.members}
    for load, row in zip(found, graph.frictions, strict=True):
        force, kind, first = load.force, packed.system.forces[row.kind], len(sources)
        series = next(each for each in forces if each.reals == kind.reals)
        size = sum(marker.size for marker in force.markers)
        scratch = series.values + row.index * series.width + 8 * len(force.markers) * orders
        on_a = row.on == 0
        body = force.a if on_a else force.b
        point = kind.reals + kind.stride * row.index + (0 if on_a else 6)
        slope = address(force.kernels, "load_slope", force.name, InvalidForce)
        for part in packed.constraints[members[id(force.joint)].parts]:
            sources += _sources(part, body, index[id(body)], *where[id(part)], orders)
        frictions.append(
            [slope, scratch + (force.slots + size + REACTION) * orders, point, first, len(sources) - first]
        )
    return FrictionLayout(records(FrictionSeries, frictions), records(ReactionSource, sources))


def _instances(packed, graph, places):
    """For each constraint where the series and the floats of its instance begin."""
    found = {}
    for i, (_, members) in enumerate(instances(packed, graph)):
        for at, (constraint, _) in enumerate(members):
            series, reals = places[i].values + at * places[i].width, graph.kinds[i].reals + at * graph.kinds[i].stride
            found[id(constraint)] = int(series), int(reals)
    return found


def _sources(part, body, number, series, reals, orders):
    """Rows of Expansion.sources of the markers that a primitive has on a body."""
    return [
        [series + force_at(j, len(part.markers), part.rows, orders), reals + 3 * j, int(marker.code == POINT), number]
        for j, marker in enumerate(part.markers)
        if part.body_of(marker) is body
    ]
