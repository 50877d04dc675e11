"""Joint friction in the constraint graph: the joint whose reaction enters, and the bodies on which friction acts."""

import numpy as np

from ..elements.element import address
from ..elements.loops.forces import INTS
from ..errors import InvalidForce
from ..jit.kernels import Record, records


class FrictionPlace(Record):
    """A joint friction among the bodies and rows of a constraint graph."""

    body_a: int
    body_b: int
    on: int  # the side, 0 for a and 1 for b, on which the reaction is taken
    first: int  # where its rows begin in ConstraintGraph.friction_rows
    count: int  # and how many they are
    kind: int  # row of System.forces
    index: int  # and its instance there
    unit: int  # addresses of friction.unit_friction and friction.normal_load
    normal: int


def frictions_of(packed, bodies, rows_of, sides):
    """Rows of ConstraintGraph.frictions, in the order of System.normals, and of ConstraintGraph.friction_rows.

    bodies gives the place of a body by its id, rows_of those of a primitive's rows, sides (m, 2) their bodies.
    """
    found = sorted((load for load in packed.loads if load.normal >= 0), key=lambda load: load.normal)
    members = {id(member.constraint): member for member in packed.members} if found else {}
    frictions, rows = [], []
    for load in found:
        force, first = load.force, len(rows)
        on = 0 if force.on is force.a else 1
        for part in packed.constraints[members[id(force.joint)].parts]:
            rows += [(e, int(sides[e, 1] == bodies[id(force.on)])) for e in rows_of(part)]
        kind, index = _place(packed.system.forces, load.alone[0])
        loops = (address(force.kernels, name, force.name, InvalidForce) for name in ("unit_friction", "normal_load"))
        pair = (bodies.get(id(body), len(bodies)) for body in (force.a, force.b))
        frictions.append([*pair, on, first, len(rows) - first, kind, index, *loops])
    return records(FrictionPlace, frictions), np.array(rows, np.int64).reshape(-1, 2)


def _place(kinds, row):
    """Return the row of System.forces that runs a load, and the index of the load in it."""
    for i, kind in enumerate(kinds):
        index = (row.table - kind.table) // INTS
        if kind.stride == row.stride and 0 <= index < kind.count:
            return i, int(index)
    raise AssertionError("a load has a row")
