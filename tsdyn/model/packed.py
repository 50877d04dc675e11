"""The packed system: the arrays that kernels read, in a named tuple whose type is the same for every scene."""

import os
from typing import NamedTuple

import numpy as np

from ..elements.element import address, checked_parameters
from ..elements.loops.coordinate_rows import BLOCK, INTS, ROW, STRIDE
from ..elements.loops.template import AT, DIMENSION
from ..errors import InvalidConstraint
from ..jit.interrupts import CollectionsDeferred
from ..jit.kernels import records, row_of
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from .derived import Derived
from .lengths import size_of
from .packed_forces import find_forces, pack_forces
from .tables import ConstraintKind, ForceKind, MotionPlace, SignalPlace


class System(NamedTuple):
    """All that a scene says, as arrays; built by `pack`, constant during a run but for the motions' places in reals."""

    bodies: np.ndarray  # int64 (nb, 2): where q_i begins, its length 7 or 3
    mass: np.ndarray  # float64 (nb,)
    inertia: np.ndarray  # float64 (nb, 9): J' row by row; zero for a point mass
    gravity: np.ndarray  # float64 (3,)
    kinds: np.ndarray  # (kinds,) of tables.ConstraintKind
    table: np.ndarray  # int64: for each instance the places in q and Phi_q, primitive.INTS numbers
    reals: np.ndarray  # float64: for each instance marker coordinates, then parameters
    motions: np.ndarray  # (motions,) of tables.MotionPlace
    rheonomic: np.ndarray  # int64 (1,): whether any row depends on time
    segments: np.ndarray  # int64 (m, 4): the nonzero columns of a row of Phi_q: begin, length, twice
    forces: np.ndarray  # (kinds,) of tables.ForceKind
    signals: np.ndarray  # (signals,) of tables.SignalPlace
    memory: np.ndarray  # int64 (slots,): places in reals of what forces, then constraints remember from step to step
    normals: np.ndarray  # int64 (frictions,): places in reals of the normal loads of joints' frictions


def no_system():
    """An example of its type."""
    whole, wholes = np.zeros(1, np.int64), np.zeros((1, 1), np.int64)
    return System(
        bodies=wholes,
        mass=np.zeros(1),
        inertia=np.zeros((1, 1)),
        gravity=np.zeros(1),
        kinds=records(ConstraintKind),
        table=whole,
        reals=np.zeros(1),
        motions=records(MotionPlace),
        rheonomic=whole,
        segments=wholes,
        forces=records(ForceKind),
        signals=records(SignalPlace),
        memory=whole,
        normals=whole,
    )


class Member(NamedTuple):
    """A constraint of a scene as it was when it was packed: where it is among the primitives and the rows."""

    constraint: object  # a Primitive, or a Joint
    coordinates: tuple  # where its markers are, (3,) each
    parts: slice
    rows: slice


class Packed(NamedTuple):
    """A scene as it was when it was packed; a solution keeps it, whatever happens to the scene later."""

    system: System
    bodies: tuple
    constraints: tuple  # primitives, in the order of their rows
    parameters: tuple  # of each constraint: floats and Motions
    coordinates: tuple  # of each constraint: where its markers are, (3,) each
    size: float  # largest number among the coordinates; of small scenes the largest length, m
    loads: tuple  # a packed_forces.Load for each force, in the order added
    members: tuple  # a Member for each constraint of the scene, in the order of their rows
    slots: tuple  # of System.memory, for each constraint; -1 for none
    derived: Derived  # what has been worked out from it

    def __reduce__(self):
        """In another process the kernels have other addresses."""
        return _found_again, (os.getpid(), *self)


def _found_again(process, *parts):
    """A `Packed` from a pickle, its addresses those of this process."""
    packed = Packed(*parts)
    if process == os.getpid():
        return packed
    system = packed.system
    kinds = classes(packed)
    for row, kind in zip(system.kinds, kinds, strict=True):
        for name in ("phi", "jacobian", "gamma", "phi_t", "remember"):
            row[name] = _address(kind, name) if row[name] else 0
        row["curvature"] = 0
    values = [
        value
        for kind in kinds
        for constraint, given in zip(packed.constraints, packed.parameters, strict=True)
        if type(constraint) is kind
        for value in given
        if isinstance(value, Motion)
    ]
    for row, motion in zip(system.motions, values, strict=True):
        row.value, row.rate, row.acceleration = motion.addresses
    return packed._replace(loads=find_forces(system, packed.loads))


@CollectionsDeferred()
def pack(scene):
    """Pack a scene; loads (at the very first use compiles) the kernels of the kinds it uses.

    Raises
    ------
    InvalidConstraint
        If a plug-in's parameters are no finite numbers or Motions, or Numba can't compile its kernels.
    """
    starts = np.cumsum([0, *(body.dimension for body in scene.bodies)])
    where = {id(body): (int(at), body.dimension) for at, body in zip(starts, scene.bodies, strict=False)}
    primitives = scene.primitives
    parameters = {constraint: checked_motions(constraint) for constraint in primitives}
    table, reals = [], []
    kinds, motions, kept = _pack_constraints(parameters, int(starts[-1]), where, table, reals)
    forces, signals, memory, normals, loads = pack_forces(scene.forces, where, table, reals)
    _append_programs(motions, reals)
    inertias = [body.values.get("inertia", np.zeros((3, 3))).ravel() for body in scene.bodies]
    system = System(
        bodies=np.array(list(where.values()), np.int64).reshape(-1, 2),
        mass=np.array([body.values["mass"] for body in scene.bodies]),
        inertia=np.array(inertias).reshape(-1, 9),
        gravity=np.array(scene.gravity),  # writable, as all arrays here: what is read-only is another type to a kernel
        kinds=records(ConstraintKind, kinds),
        table=np.array(table, np.int64),
        reals=np.array(reals),
        motions=records(MotionPlace, [row for row, _ in motions]),
        rheonomic=np.array([any(constraint.rheonomic for constraint in primitives)], np.int64),
        segments=np.array(_segments(primitives, where), np.int64).reshape(-1, 4),
        forces=forces,
        signals=signals,
        memory=np.array([*memory, *kept.values()], np.int64),
        normals=np.array(normals, np.int64),
    )
    coordinates = tuple(constraint.coordinates for constraint in primitives)
    size = size_of(primitives, coordinates)
    members = tuple(_members(scene.constraints))
    order = {constraint: len(memory) + i for i, constraint in enumerate(kept)}
    slots = tuple(order.get(constraint, -1) for constraint in primitives)
    given = tuple(parameters.values())
    return Packed(system, scene.bodies, primitives, given, coordinates, size, loads, members, slots, Derived())


def _segments(primitives, where):
    """The two spans of columns of each row of Phi_q that are not zero."""
    found = []
    for constraint in primitives:
        spans = [where.get(id(body), (0, 0)) for body in (constraint.a, constraint.b)]
        found += [[*spans[0], *spans[1]]] * constraint.rows
    return found


def _pack_constraints(parameters, n, where, table, reals):
    """Append the instances, kind by kind, to `table` and `reals`.

    Returns rows of System.kinds, of System.motions each with its Motion, and {constraint: place of what it remembers}.
    """
    groups, row = {}, 0
    for constraint in parameters:
        groups.setdefault(type(constraint), []).append((constraint, row))
        row += constraint.rows
    kinds, motions, kept = [], [], {}
    for kind, members in groups.items():
        first = len(table), len(reals)
        for constraint, at_row in members:
            begin = len(reals)
            table += _places(constraint, at_row, n, where)
            _append_reals(constraint, parameters[constraint], reals, motions)
            if kind.memory:
                kept[constraint] = len(reals)
                reals.append(0.0)
            if begin == first[1]:
                stride = len(reals) - begin
            if len(reals) - begin != stride:
                raise InvalidConstraint(
                    f"{constraint.name}: parameters() must return as many values as for every other {kind.__name__}."
                )
        moving = any(constraint.rheonomic for constraint, _ in members)
        loops = ["phi", "jacobian", "gamma", *["phi_t"] * moving, *["remember"] * bool(kind.memory)]
        kinds.append(
            row_of(
                ConstraintKind,
                **{name: _address(kind, name) for name in loops},
                count=len(members),
                stride=stride,
                table=first[0],
                reals=first[1],
            )
        )
    return kinds, motions, kept


def _append_reals(constraint, parameters, reals, motions):
    """Append where the markers are, then the parameters; three places for a Motion, whose row joins `motions`."""
    reals += np.concatenate(constraint.coordinates).tolist()
    for value in parameters:
        if isinstance(value, Motion):
            motions.append(([*value.addresses, len(reals), 0], value))
            reals += value.value(value.origin)
        else:
            reals.append(float(value))


def _append_programs(motions, reals):
    """Append the programs of `ts.motions`, one for all that move alike, and say in the rows where they begin."""
    begins = {}
    for row, motion in motions:
        if motion.series is not None:
            if id(motion.series) not in begins:
                begins[id(motion.series)] = len(reals)
                reals += motion.series.program()
            row[-1] = begins[id(motion.series)]


def _members(constraints):
    part = row = 0
    for constraint in constraints:
        parts, rows = slice(part, part + len(constraint.parts)), slice(row, row + constraint.rows)
        yield Member(constraint, constraint.coordinates, parts, rows)
        part, row = parts.stop, rows.stop


def index_of(packed, body):
    """Where a body stood among the others when the scene was packed; None where it was not there."""
    known = packed.derived
    if known.body_indices is None:
        known.body_indices = {id(one): i for i, one in enumerate(packed.bodies)}
    return known.body_indices.get(id(body))


def member_of(packed, constraint):
    """The `Member` that a constraint, or a joint's part, is; None where it is not of that scene."""
    known = packed.derived
    if known.members is None:
        found, row = {}, 0
        for i, part in enumerate(packed.constraints):
            found[id(part)] = Member(part, packed.coordinates[i], slice(i, i + 1), slice(row, row + part.rows))
            row += part.rows
        known.members = found | {id(member.constraint): member for member in packed.members}
    return known.members.get(id(constraint))


def classes(packed):
    """The classes of constraints, in the order of System.kinds."""
    return list(dict.fromkeys(type(constraint) for constraint in packed.constraints))


def user_functions(packed):
    """Yield whatever holds compiled functions of a user's, and those functions."""
    for given in packed.parameters:
        for value in given:
            if isinstance(value, Motion) and value.given:
                yield value, value.given
    for load in packed.loads:
        for value in load.parameters:
            if isinstance(value, Signal) and value.is_function:
                yield value, (value.source,)
        if hasattr(load.force, "function_of_state"):
            yield load.force, (load.force.function_of_state,)


def with_curvatures(packed):
    """The system with the kernels of second derivatives, which only implicit methods load."""
    kinds = packed.system.kinds.copy()
    kinds["curvature"] = [_address(kind, "curvature") for kind in classes(packed)]
    return packed.system._replace(kinds=kinds)


def checked_motions(constraint):
    """A primitive's parameters, checked: floats and Motions."""
    given = checked_parameters(constraint, Motion, "Motions")
    if "phi_t" not in constraint.kernels and any(isinstance(p, Motion) for p in given):
        raise InvalidConstraint(f"{constraint.name}: a Motion is among its parameters, so it needs a kernel phi_t.")
    return given


def _address(kind, name):
    return address(kind.kernels, name, kind.__name__, InvalidConstraint)


def _places(constraint, row, n, where):
    """Fill the table entry of one instance; the ground has dimension 0 and no place."""
    entry = np.zeros(INTS, np.int64)
    for i, body in enumerate((constraint.a, constraint.b)):
        at, dimension = where.get(id(body), (0, 0))
        entry[AT + i], entry[DIMENSION + i], entry[BLOCK + i] = at, dimension, row * n + at
    entry[ROW], entry[STRIDE] = row, n
    return entry.tolist()
