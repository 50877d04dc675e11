"""The packed system: the arrays that kernels read, in a named tuple whose type is the same for every scene."""

import os
from dataclasses import dataclass, field
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from ..elements.element import address, checked_parameters
from ..elements.laws import SceneLaw
from ..elements.loops.coordinate_rows import BLOCK, INTS, ROW, STRIDE
from ..elements.loops.forces import FORCE_INTS
from ..elements.loops.friction import STAND
from ..elements.loops.template import AT, DIMENSION
from ..elements.markers import POINT
from ..elements.unilateral import contacts_of
from ..errors import InvalidConstraint, InvalidForce
from ..jit.interrupts import CollectionsDeferred
from ..jit.kernels import Record, records, row_of
from ..motions.of_coordinates import PLACES, CoordinateFunction
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from ..motions.tracing import Untraceable
from .handles import Handles, classes, first_rows, inertia_classes, instances_of_kinds
from .laws import Law

# Rows of the tables of a packed system, each a record: what runs over the instances of a kind, and where they are.
#
# Addresses are those of kernels of this process; zero stands for none.


class ConstraintKind(Record):
    """All instances of one class of primitive."""

    phi: int  # addresses of the loops of coordinate_rows.py
    jacobian: int
    gamma: int
    phi_t: int
    remember: int
    stiffness: int  # addresses of the loops of constraint_hessians.py; implicit methods load them
    slopes: int
    count: int  # instances
    stride: int  # reals of each
    table: int  # where the entries of the first begin in System.table
    reals: int  # and in System.reals


class ForceKind(Record):
    """All instances of one kind of force; user functions have kinds of their own."""

    count: int  # these three are a `ForceExtent`
    stride: int
    columns: int  # of Q_q; set with the address of the loop
    force: int  # addresses of the loops of forces.py
    jacobian: int  # implicit methods load it
    remember: int
    table: int
    reals: int
    kept: int  # where its derivatives begin among those that implicit methods keep


class MotionPlace(Record):
    """A prescribed motion: a program of `ts.motions`, or three functions of a user's."""

    value: int  # address of f, or of what runs a program
    rate: int  # address of fd; zero for a program
    acceleration: int  # address of fdd; zero for a program
    place: int  # where value, rate and acceleration at t are in System.reals
    program: int  # where the program begins there


class SignalPlace(Record):
    """A load that is a function of time."""

    address: int  # of the function, or of what runs a program
    place: int  # where its values at t are in System.reals
    width: int  # how many they are
    program: int  # where the program begins there; -1 for a function


# What has been worked out from a packed scene, once, for whoever asks next.


@dataclass(slots=True)
class Derived:
    """Of one `Packed`: each entry is None, or empty, until the function named beside it has been called."""

    redundant: object = None  # int64 (k,): redundant rows of the constraint graph; constraint_graph.set_redundant
    switched: object = None  # int64 (k,): of a phase, rows of Phi that may hold frictions; those that don't: redundant
    turning: set = field(default_factory=set)  # bodies that count as turning; locked_orientations.keep_turning
    handles: object = None  # handles.handles_of
    body_indices: dict = None  # handles.index_of
    members: dict = None  # packed.member_of
    short_rows: object = None  # a `System`: equations.with_short_rows
    graph: tuple = None  # constraint_graph.graph_of, and by the loops asked for:
    graphs: dict = field(default_factory=dict)
    locked: object = None  # a `Still`: locked_orientations.still
    moving_graph: tuple = None  # locked_orientations.moving_graph, and by the loops asked for:
    moving_networks: dict = field(default_factory=dict)
    saddle: tuple = None  # a graph, a system, and their `SaddleGraph`: saddle_matrix.saddle_of
    examined: object = None  # a `Packed` without redundant rows so far: evaluate.dependent_rows
    start_workspaces: list = field(default_factory=list)  # idle: initial_conditions.taken
    aligned: tuple = None  # motor_starts.demand_aligned
    holonomic: bool = False  # whether plug-ins have been found so: motor_starts.demand_holonomic
    loads: dict = None  # reactions.loads_of
    holds: dict = field(default_factory=dict)  # of a phase, phase_scenes.phase_of: slot of a friction -> rows that hold
    places: dict = field(default_factory=dict)  # it; and index of such a row's primitive -> slots, and where they are
    shares: object = None  # of a phase in which frictions at rest share a load: a shared_friction.SharedFriction
    row_parts: list = field(default_factory=list)  # idle: reactions.taken
    reactions: dict = field(default_factory=dict)  # of each thread: contact_rows.reaction_workspace
    with_singular_places: list = None  # indices of primitives: reactions.singular_place
    places_within: list = None  # of each primitive among those of its class: reactions.only
    coordinate_starts: dict = None  # diagnostics.starts
    engines: dict = field(default_factory=dict)  # scene_cache.Prepared.engine
    levers: object = None  # (bodies,), m: inertia_rows.levers, of a phase those of its scene
    arms: object = None  # (bodies,), m, at the start: constraint_graph.arms; likewise
    near: object = None  # the start last found near the origin: local_origin.within_rounding
    grounded: tuple = None  # local_origin.origin_of, and for the start last seen:
    origin: tuple = (None, None)
    local: tuple = None  # the scene from an origin of its own: local_origin
    masks: dict = field(default_factory=dict)  # of primitives, by id, also of the scene of a phase: taylor.layout.masks
    family: object = None  # a parameters.family.Family: variants.family_of
    shared: dict = None  # of a family: what numbers don't change, by the functions that find it; None for one scene

    @property
    def is_of_start(self):
        """Whether some of it holds where runs have started: redundant rows, bodies that turn, a local origin."""
        return self.redundant is not None or bool(self.turning) or self.local is not None

    def forget_graphs(self):
        """The constraint graph is another."""
        self.graph, self.graphs = None, {}  # and not cleared: phases may share them
        self.forget_locked()

    def forget_locked(self):
        """Other bodies turn."""
        self.locked = self.moving_graph = None
        self.moving_networks.clear()
        self.engines = {}  # and not cleared: a run in another thread may be about to add one

    def __reduce__(self):
        """In another process: what doesn't depend on where things are in memory."""
        return _of, tuple(getattr(self, name) for name in KEPT)


KEPT = "redundant", "switched", "turning", "handles", "holds", "places", "shares"


def _of(*kept):
    return Derived(**dict(zip(KEPT, kept, strict=True)))


WIDTH = 14  # floats of a short row of Phi_q; those of body b begin in the middle


# Lengths of a scene: in a small one positions are held to rounding of these, not of the pure numbers beside them.

POINT_SIZE = 1e-3  # m: a scene without longer lengths, or whose points coincide; rounding of one is 1e-12 of it


def is_small(size):
    """Return True for the size of a scene in which pure numbers, such as the coordinates of axes, are no lengths."""
    return 0.0 < size < POINT_SIZE


def has_lengths(primitive):
    """Return True if the rows of a primitive are lengths, or depend on them; False if they are pure numbers."""
    return any(marker.code == POINT for marker in primitive.markers)


def size_of(primitives, coordinates):
    """Size of a scene: the largest number among the coordinates of markers; of a small one, the largest length, m."""
    largest = np.abs(np.array([s for places in coordinates for s in places]).reshape(-1, 3)).max(axis=1)
    codes = np.array([marker.code for primitive in primitives for marker in primitive.markers], int)
    own = max((primitive.reach for primitive in primitives), default=0.0)
    return _size(float(largest[codes == POINT].max(initial=own)), float(largest.max(initial=0.0)))


def reaches_of(primitive, places):
    """The largest numbers among the lengths, and among the coordinates of all markers, of a primitive."""
    sizes = [(marker.code, float(np.abs(s).max())) for marker, s in zip(primitive.markers, places, strict=True)]
    lengths = [primitive.reach, *(size for code, size in sizes if code == POINT)]
    return max(lengths), max((size for _, size in sizes), default=0.0)


def reach_of(packed):
    """The largest distance of a point of constraints and forces from its body's centroid, m; axes are no lengths."""
    places = [*zip(packed.constraints, packed.coordinates, strict=True)]
    places += [(load.force, load.coordinates) for load in packed.loads]
    points = [s for part, own in places for marker, s in zip(part.markers, own, strict=True) if marker.code == POINT]
    return float(np.linalg.norm(points, axis=1).max()) if points else 0.0


def size_of_reaches(reaches):
    """The same as `size_of`, from those of each primitive."""
    length = max((each[0] for each in reaches), default=0.0)
    return _size(length, max((each[1] for each in reaches), default=0.0))


def _size(length, whole):
    return length if is_small(length) else whole


# Forces packed for the kernels: one row a kind; indices and parameters of each instance in shared arrays.


class Load(NamedTuple):
    """One force as it was when it was packed."""

    force: object
    parameters: tuple  # floats and Signals
    coordinates: tuple  # where its markers are, (3,) each
    alone: np.ndarray  # (1,) of packed.ForceKind: a System.forces that has this instance alone
    slot: int  # of System.memory, the first; -1 for none
    normal: int  # of System.normals; -1 for none
    programs: tuple  # for each number of par: where in System.reals the program of its series begins; -1 for none
    remembers: int = 0  # how many numbers are in System.memory
    slides: tuple = ()  # friction.Sliding of the exact law, each
    law: object = None  # a `laws.Law` of a function that sees the whole scene


def pack_forces(forces, where, table, reals, handles):
    """Append the instances to `table` and `reals`; return rows of System.forces, .signals, .memory, .normals, Loads.

    handles: of the scene, where there are laws of its state.

    Raises
    ------
    InvalidForce
        If a plug-in's parameters are no finite numbers or Signals, or Numba can't compile its kernels.
    """
    groups = {}
    for force in forces:
        key = id(force.kernels), force.taken  # user functions have kernels of their own
        groups.setdefault(key, []).append(force)
    rows, signals, memory, normals, loads = [], [], [], [], {}
    programs, expanded = [], {}
    for members in groups.values():
        kernels = members[0].kernels
        force_address = _force_address(members[0], "force")
        remember = _force_address(members[0], "remember") if "remember" in kernels else 0
        first, stride = (len(table), len(reals)), None
        if isinstance(members[0], SceneLaw):
            (force,), slot = members, len(memory)
            law = Law(force, handles)
            count, stride = law.pack(table, reals, memory)
            row = [count, stride, 0, force_address, 0, remember, *first, 0]
            rows.append(row)
            slot = slot if len(memory) > slot else -1
            alone = records(ForceKind, [row])
            own = force.parameters(), force.coordinates, alone, slot, -1, (), force.memory + force.taken
            loads[id(force)] = Load(force, *own, law=law)
            continue
        for force in members:
            begin = len(table), len(reals)
            parameters = checked_parameters(force, Signal, "loads")
            table += _force_places(force, where)
            reals += np.concatenate(force.coordinates).tolist()
            for value in parameters:
                if not isinstance(value, Signal):
                    reals.append(float(value))
                    continue
                for i, motion in enumerate(value.motions):
                    signals.append([value.address, len(reals) + i, 1, -1])
                    programs.append((signals[-1], motion))
                if not value.motions:
                    signals.append([value.address, len(reals), value.width, -1])
                reals += [np.nan] * value.width  # until the time is set
            remembers = force.memory + force.taken
            memory += range(len(reals), len(reals) + remembers)
            reals += [0.0] * remembers
            if "normal_load" in kernels:
                normals.append(len(reals))
                reals.append(0.0)
            size = len(reals) - begin[1]
            if stride not in (None, size):
                raise InvalidForce(
                    f"{force.name}: parameters() must return as many values as for every other {type(force).__name__}."
                )
            stride = size
            alone = records(ForceKind, [[1, stride, 0, force_address, 0, remember, *begin, 0]])
            slot = len(memory) - remembers if remembers else -1
            normal = len(normals) - 1 if "normal_load" in kernels else -1
            slides = tuple(getattr(force, "slides", ()))
            loads[id(force)] = Load(force, parameters, force.coordinates, alone, slot, normal, (), remembers, slides)
            expanded[id(force)] = [motion for value in parameters for motion in _series(value)]
        rows.append([len(members), stride, 0, force_address, 0, remember, *first, 0])
    begins = {id(None): -1}
    for motion in (*(motion for _, motion in programs), *(motion for each in expanded.values() for motion in each)):
        if id(motion) not in begins:  # one program for all that are given the same
            begins[id(motion)] = len(reals)
            reals += motion.program()
    for signal, motion in programs:
        signal[-1] = begins[id(motion)]
    for force, motions in expanded.items():
        loads[force] = loads[force]._replace(programs=tuple(begins[id(motion)] for motion in motions))
    rows, signals = records(ForceKind, rows), records(SignalPlace, signals)
    return rows, signals, memory, normals, tuple(loads[id(force)] for force in forces)


def _series(value):
    """A parameter's numbers as motions; None for what is constant, or has no series."""
    if not isinstance(value, Signal):
        return (None,)
    try:
        return value.smooth
    except Untraceable:
        return (None,) * value.width


def find_forces(system, loads):
    """Write this process's addresses into the rows of an unpickled system; the loads with theirs."""
    signals, rows = iter(system.signals), {}
    for row in system.forces:
        members = members_of(row, loads)
        row.force, row.jacobian = _force_address(members[0].force, "force"), 0
        row.remember = _force_address(members[0].force, "remember") if row.remember else 0
        for load in members:
            alone = load.alone.copy()
            for name in ("force", "jacobian", "remember"):
                alone[name] = row[name]
            rows[id(load)] = load._replace(alone=alone)
            for value in load.parameters:
                for _ in range(max(len(value.motions), 1) if isinstance(value, Signal) else 0):
                    next(signals).address = value.address
    return tuple(rows[id(load)] for load in loads)


def members_of(row, loads):
    """The loads that a row of System.forces runs."""
    end = row.reals + row.count * row.stride
    return [load for load in loads if row.reals <= load.alone[0].reals < end]


def _force_address(force, name):
    return address(force.kernels, name, force.name, InvalidForce)


def _force_places(force, where):
    """The table entry of one instance; the ground has dimension 0 and no place."""
    entry = np.zeros(FORCE_INTS, np.int64)
    for i, body in enumerate((force.a, force.b)):
        entry[AT + i], entry[DIMENSION + i] = where.get(id(body), (0, 0))
    return entry.tolist()


# Joint friction in the constraint graph: the joint whose reaction enters, and the bodies on which friction acts.


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
    kept: int  # where its floats of Friction.kept begin
    room: int  # and how many they are


def coupled_loads(packed):
    """The loads of friction that depend on reactions, in the order of System.normals."""
    return sorted((load for load in packed.loads if load.normal >= 0), key=lambda load: load.normal)


def frictions_of(packed, bodies, rows_of, sides):
    """Rows of ConstraintGraph.frictions, in the order of System.normals, and of ConstraintGraph.friction_rows.

    bodies gives the place of a body by its id, rows_of those of a primitive's rows, sides (m, 2) their bodies.
    """
    found = coupled_loads(packed)
    members = {id(member.constraint): member for member in packed.members} if found else {}
    frictions, rows, kept = [], [], 0
    for load in found:
        force, first = load.force, len(rows)
        on = 0 if force.on is force.a else 1
        for part in parts_read(packed, members, force):
            rows += [(e, int(sides[e, 1] == bodies[id(force.on)])) for e in rows_of(part)]
        kind, index = _place(packed.system.forces, load.alone[0])
        loops = (address(force.kernels, name, force.name, InvalidForce) for name in ("unit_friction", "normal_load"))
        pair = (bodies.get(id(body), len(bodies)) for body in (force.a, force.b))
        room = STAND + sum(marker.size for marker in force.markers)
        frictions.append([*pair, on, first, len(rows) - first, kind, index, *loops, kept, room])
        kept += room
    return records(FrictionPlace, frictions), np.array(rows, np.int64).reshape(-1, 2)


def parts_read(packed, members, force):
    """Yield the primitives whose reactions a friction depends on; members: by the ids of constraints."""
    for joint in getattr(force, "reads", (force.joint,)):
        yield from packed.constraints[members[id(joint)].parts]


def _place(kinds, row):
    """Return the row of System.forces that runs a load, and the index of the load in it."""
    for i, kind in enumerate(kinds):
        index = (row.table - kind.table) // FORCE_INTS
        if kind.stride == row.stride and 0 <= index < kind.count:
            return i, int(index)
    raise AssertionError("a load has a row")


class System(NamedTuple):
    """All that a scene says, as arrays; built by `pack`, constant during a run but for the motions' places in reals."""

    bodies: np.ndarray  # int64 (nb, 2): where q_i begins, its length 7 or 3
    mass: np.ndarray  # float64 (nb,)
    inertia: np.ndarray  # float64 (nb, 9): J' row by row; zero for a point mass
    gravity: np.ndarray  # float64 (3,)
    kinds: np.ndarray  # (kinds,) of packed.ConstraintKind
    table: np.ndarray  # int64: for each instance the places in q and Phi_q, coordinate_rows.INTS numbers
    reals: np.ndarray  # float64: for each instance marker coordinates, then parameters
    motions: np.ndarray  # (motions,) of packed.MotionPlace
    rheonomic: np.ndarray  # int64 (1,): whether any row depends on time
    segments: np.ndarray  # int64 (m, 4): the nonzero columns of a row of Phi_q: begin, length, twice; of a sum one span
    sums: np.ndarray  # int64 (sums,): rows that several instances add to
    tails: np.ndarray  # int64 (tails,): of every instance but the first of a sum, its row
    forces: np.ndarray  # (kinds,) of packed.ForceKind
    signals: np.ndarray  # (signals,) of packed.SignalPlace
    memory: np.ndarray  # int64 (slots,): places in reals of what forces, then constraints remember from step to step
    normals: np.ndarray  # int64 (frictions,): places in reals of the normal loads of joints' frictions
    inertias: np.ndarray  # (kinds,) of packed.ConstraintKind: the rows h of M + h^T h, short; see rows/inertia_rows.py
    inertia_segments: np.ndarray  # int64 (i, 4): as segments, of these rows


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
        sums=whole,
        tails=whole,
        forces=records(ForceKind),
        signals=records(SignalPlace),
        memory=whole,
        normals=whole,
        inertias=records(ConstraintKind),
        inertia_segments=wholes,
    )


class Member(NamedTuple):
    """A constraint of a scene as it was when it was packed: where it is among the primitives and the rows."""

    constraint: object  # a Primitive, or a Joint
    coordinates: tuple  # where its markers are, (3,) each
    parts: slice
    rows: slice


class ContactLaw(NamedTuple):
    """What no row has of a constraint that opens, as it was when it was packed."""

    contact: object
    coefficients: tuple  # restitution, kinetic, static; None for what it hasn't
    labels: tuple  # of its rows


class Packed(NamedTuple):
    """A scene as it was when it was packed; a solution keeps it, whatever happens to the scene later."""

    system: System
    bodies: tuple
    constraints: tuple  # primitives, in the order of their rows
    parameters: tuple  # of each constraint: floats and Motions
    coordinates: tuple  # of each constraint: where its markers are, (3,) each
    size: float  # largest number among the coordinates; of small scenes the largest length, m
    loads: tuple  # a packed.Load for each force, in the order added
    members: tuple  # a Member for each constraint of the scene, in the order of their rows
    slots: tuple  # of System.memory, the first of each constraint; -1 for none
    contacts: tuple  # of contacts with friction, each with the first slot of its numbers
    laws: tuple  # a ContactLaw for each constraint that opens
    inertias: tuple  # primitives whose rows add inertia to a joint coordinate, in the order of their forces
    derived: Derived  # what has been worked out from it

    def __reduce__(self):
        """In another process the kernels have other addresses."""
        return _found_again, (os.getpid(), *self)


def _found_again(process, *parts):
    """A `Packed` from a pickle, its addresses those of this process."""
    packed = Packed(*parts)
    for load in packed.loads:
        if load.law is not None and load.law.address >= 0:
            packed.system.reals[load.law.address] = load.law.callback
    if process == os.getpid():
        return packed
    system = packed.system
    kinds = classes(packed)
    rows = [*zip(system.kinds, kinds, strict=True), *zip(system.inertias, inertia_classes(packed), strict=True)]
    for row, kind in rows:
        for name in ("phi", "jacobian", "gamma", "phi_t", "remember"):
            row[name] = _address(kind, name) if row[name] else 0
        row["stiffness"] = row["slopes"] = 0
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
    for function, begin, at in _functions(packed):
        system.reals[at : at + PLACES] = function.addresses(begin, begin + int(system.reals[at + 1]))
    return packed._replace(loads=find_forces(system, packed.loads))


@CollectionsDeferred()
def pack(scene, handles=None, whole=None):
    """Pack a scene; loads (at the very first use compiles) the kernels of the kinds it uses.

    handles: `Handles` to look its parts up by, where they are not its own. whole: a `Packed` that has some of its
    primitives as they are now.

    Raises
    ------
    InvalidConstraint
        If a plug-in's parameters are no finite numbers or Motions, or Numba can't compile its kernels.
    """
    starts = np.cumsum([0, *(body.dimension for body in scene.bodies)])
    where = {id(body): (int(at), body.dimension) for at, body in zip(starts, scene.bodies, strict=False)}
    primitives = scene.primitives
    known = {} if whole is None else dict(zip(map(id, whole.constraints), whole.parameters, strict=True))
    parameters = {each: known[id(each)] if id(each) in known else checked_motions(each) for each in primitives}
    table, reals = [], []
    kinds, motions, kept, functions = _pack_constraints(parameters, int(starts[-1]), where, table, reals)
    members, derived = tuple(_members(scene.constraints)), Derived(handles=handles)
    if handles is None and any(isinstance(force, SceneLaw) for force in scene.forces):
        derived.handles = Handles(scene.bodies, list(where.values()), members, scene.forces)
        for pairs in (scene._twins, scene._aliases):  # functions may hold handles of the scene that this is a copy of
            derived.handles.add_aliases((pairs or {}).items())
    forces, signals, memory, normals, loads = pack_forces(scene.forces, where, table, reals, derived.handles)
    added = [force.inertia_row for force in scene.forces if force.adds_inertia]
    inertia_kinds, *_ = _pack_constraints({row: row.parameters() for row in added}, 0, where, table, reals)
    kinds, inertias = records(ConstraintKind, kinds), records(ConstraintKind, inertia_kinds)
    for kind in inertias:
        _shorten(table, kind)
    _append_programs(motions, reals)
    for function, begin, at in functions:
        reals[at : at + PLACES] = function.addresses(begin, len(reals))
        reals += function.numbers()
    contacts = [each for each in scene.constraints if each.taken]
    for contact in contacts:
        kept[contact] = range(len(reals), len(reals) + contact.taken)
        reals += [0.0] * contact.taken
    moments = [body.values.get("inertia", np.zeros((3, 3))).ravel() for body in scene.bodies]
    system = System(
        bodies=np.array(list(where.values()), np.int64).reshape(-1, 2),
        mass=np.array([body.values["mass"] for body in scene.bodies]),
        inertia=np.array(moments).reshape(-1, 9),
        gravity=np.array(scene.gravity),  # writable, as all arrays here: what is read-only is another type to a kernel
        kinds=kinds,
        table=np.array(table, np.int64),
        reals=np.array(reals),
        motions=records(MotionPlace, [row for row, _ in motions]),
        rheonomic=np.array([(kinds["phi_t"] != 0).any()], np.int64),
        segments=np.array(_segments(primitives, where), np.int64).reshape(-1, 4),
        sums=np.array([row for part, row in first_rows(primitives) if part.summed and part.all_rows], np.int64),
        tails=np.array([row for part, row in first_rows(primitives) if not part.all_rows], np.int64),
        forces=forces,
        signals=signals,
        memory=np.array([*memory, *(at for places in kept.values() for at in places)], np.int64),
        normals=np.array(normals, np.int64),
        inertias=inertias,
        inertia_segments=np.array(_segments(added, where), np.int64).reshape(-1, 4),
    )
    coordinates = tuple(constraint.coordinates for constraint in primitives)
    size = size_of(primitives, coordinates)
    firsts = accumulate(map(len, kept.values()), initial=len(memory))
    order = dict(zip(kept, firsts, strict=False))
    slots = tuple(order.get(constraint, -1) for constraint in primitives)
    own = tuple((contact, order[contact]) for contact in contacts)
    laws = tuple(_law_of(contact) for contact in contacts_of(scene.constraints))
    return Packed(
        system, scene.bodies, primitives, tuple(parameters.values()), coordinates, size, loads, members, slots, own,
        laws, tuple(added), derived,
    )  # fmt: skip


def _law_of(contact):
    given = (getattr(contact, name, None) for name in ("restitution", "kinetic", "static"))
    coefficients = tuple(value if value is None else float(value) for value in given)
    return ContactLaw(contact, coefficients, tuple(contact.row_labels))


def has_friction(packed, contact):
    """Whether a constraint was a contact with friction when it was packed."""
    return any(contact is own for own, _ in packed.contacts)


def _shorten(table, kind):
    """Let the rows of Phi_q of a kind be short."""
    for own in range(int(kind.table), int(kind.table + INTS * kind.count), INTS):
        line = WIDTH * table[own + ROW]
        table[own + BLOCK], table[own + BLOCK + 1], table[own + STRIDE] = line, line + WIDTH // 2, WIDTH


def _segments(primitives, where):
    """The two spans of columns of each row of Phi_q that are not zero; of a sum, one that covers all its bodies."""
    found = []
    for constraint in primitives:
        spans = [where.get(id(body), (0, 0)) for body in (constraint.a, constraint.b)]
        if constraint.summed:
            begin, length = found.pop()[:2] if not constraint.all_rows else (0, 0)
            used = [span for span in (*spans, (begin, length)) if span[1]]
            begin, end = min(at for at, _ in used), max(at + size for at, size in used)
            spans = (begin, end - begin), (0, 0)
        found += [[*spans[0], *spans[1]]] * (1 if constraint.summed else constraint.all_rows)
    return found


def _pack_constraints(parameters, n, where, table, reals):
    """Append the instances, kind by kind, to `table` and `reals`.

    Returns rows of System.kinds, of System.motions each with its Motion, {constraint: places of what it remembers}, and
    of each CoordinateFunction where its parameters begin and where it is.
    """
    groups, order = {}, {body: i for i, body in enumerate(where)}
    for constraint, row in first_rows(parameters):
        groups.setdefault(type(constraint), []).append((constraint, row))
    kinds, motions, kept, functions = [], [], {}, []
    for kind, members in groups.items():
        first = len(table), len(reals)
        for constraint, at_row in members:
            begin = len(reals)
            table += _places(constraint, at_row, n, where)
            _append_reals(constraint, parameters[constraint], reals, motions, functions)
            for i, body in enumerate(constraint.others):
                at = begin + 3 * len(kind.markers) + kind.others_at + 3 * i
                reals[at : at + 3] = *where.get(id(body), (0, 0)), order.get(id(body), len(order))
            if kind.memory:
                kept[constraint] = range(len(reals), len(reals) + kind.memory)
                reals += constraint.first_memory
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
    return kinds, motions, kept, functions


def _append_reals(constraint, parameters, reals, motions, functions):
    """Append where the markers are, then the parameters; three places for a Motion, whose row joins `motions`."""
    for place in constraint.coordinates:
        reals += place.tolist()
    begin = len(reals)
    for value in parameters:
        if isinstance(value, CoordinateFunction):
            functions.append((value, begin, len(reals)))
            value = 0.0  # its places are written when its program has one
        if isinstance(value, Motion):
            motions.append(([*value.addresses, len(reals), 0], value))
            reals += value.value(value.origin)
        else:
            reals.append(float(value))


def _functions(packed):
    """Yield each `CoordinateFunction`, where in System.reals the parameters of its term begin, and where it is."""
    given = {id(part): values for part, values in zip(packed.constraints, packed.parameters, strict=True)}
    for kind, members in zip(packed.system.kinds, instances_of_kinds(packed), strict=True):
        for i, part in enumerate(members):
            begin = at = int(kind.reals + i * kind.stride) + 3 * len(part.markers)
            for value in given[id(part)]:
                if isinstance(value, CoordinateFunction):
                    yield value, begin, at
                at += 3 if isinstance(value, Motion) else 1


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
        own = constraint.parts
        parts, rows = slice(part, part + len(own)), slice(row, row + sum(each.all_rows for each in own))
        yield Member(constraint, constraint.coordinates, parts, rows)
        part, row = parts.stop, rows.stop


def member_of(packed, constraint):
    """The `Member` that a constraint, or a joint's part, is; None where it is not of that scene."""
    known = packed.derived
    if known.members is None:
        found = {}
        for i, (part, row) in enumerate(first_rows(packed.constraints)):
            rows = slice(row, row + max(part.all_rows, 1))
            found[id(part)] = Member(part, packed.coordinates[i], slice(i, i + 1), rows)
        known.members = found | {id(member.constraint): member for member in packed.members}
    return known.members.get(id(constraint))


def checked_motions(constraint):
    """A primitive's parameters, checked: floats and Motions."""
    given = checked_parameters(constraint, (Motion, CoordinateFunction), "Motions")
    if "phi_t" not in constraint.kernels and any(isinstance(p, Motion) for p in given):
        raise InvalidConstraint(f"{constraint.name}: a Motion is among its parameters, so it needs a kernel phi_t.")
    return given


def _address(kind, name):
    return address(kind.kernels, name, kind.__name__, InvalidConstraint)


def _places(constraint, row, n, where):
    """The table entry of one instance; the ground has dimension 0 and no place."""
    entry = [0] * INTS
    for i, body in enumerate((constraint.a, constraint.b)):
        at, dimension = where.get(id(body), (0, 0))
        entry[AT + i], entry[DIMENSION + i], entry[BLOCK + i] = at, dimension, row * n + at
    entry[ROW], entry[STRIDE] = row, n
    return entry
