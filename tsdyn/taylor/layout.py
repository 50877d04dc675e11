"""The Taylor workspace: its memory layout, that of forces and friction; parts of a scene without series."""

from functools import lru_cache
from itertools import groupby
from typing import NamedTuple

import numpy as np

from ..elements.element import address
from ..elements.loops import force_series
from ..elements.loops.constraint_rows import INTS, MASK, STILL
from ..elements.loops.constraint_series import BODY_ROW, GROUND, UNTURNED, force_at, instance_width, scratch_at
from ..elements.loops.friction import FRICTION_ROWS, REACTION
from ..elements.loops.ground_contacts import is_ground_contact
from ..elements.markers import POINT
from ..errors import InvalidConstraint, InvalidForce
from ..formulations.locked_orientations import instances
from ..jit.kernels import Record, loader, records, twin
from ..jit.resident import zeros
from ..model.equations import changes_with_state
from ..model.packed import System, coupled_loads, members_of, parts_read
from ..motions.of_coordinates import CoordinateFunction
from ..motions.prescribed import Motion
from ..motions.program import run_program
from ..motions.signals import Signal
from ..motions.tables import is_data
from ..motions.tracing import ROWS, Untraceable, run_order
from ..rows.constraint_graph import ConstraintGraph
from ..rows.interface import TangentWorkspace
from ..workspaces import Work, plain_context
from .tolerances import FAR

# Rows of the tables of an `Expansion`, each a record; addresses are those of kernels of this process.


class ConstraintSeries(Record):
    """All instances of one class of primitive; it begins as an `Extent`."""

    count: int
    stride: int  # reals of each
    width: int  # floats of each one's series
    orders: int  # that there is room for
    loop: int  # address of constraint_series.series
    values: int  # where the series of the first begin in Expansion.constraints


class ForceSeries(Record):
    """All instances of one kind of force; it begins as an `Extent`."""

    count: int
    stride: int  # reals of each
    width: int  # floats of each one's series
    orders: int  # that there is room for
    loop: int  # address of force_series.series
    values: int  # where the series of the first begin in Expansion.loads
    table: int  # where the entries of the first begin in Expansion.table
    reals: int  # and in System.reals
    check: int  # address of law_check.check; 0 where the law is analytic everywhere
    margin: int  # address of law_check.margin; 0 for a law without a known margin of analyticity
    sharp: int  # whether every step is checked at all places
    near: int  # whether the step tried is, too
    run: int  # address of what runs the program of a traced function; 0 for none
    users: int  # whether the law is a user's, and may change within any part of a step


class FrictionSeries(Record):
    """A friction of a joint, in the order of ConstraintGraph.frictions."""

    slope: int  # address of friction.load_slope
    reaction: int  # where the series of its reaction begins in Expansion.loads: force and torque, one after the other
    point: int  # where the body-frame coordinates of the joint's point begin in System.reals
    first: int  # of its rows of Expansion.sources
    count: int


class ReactionSource(Record):
    """A marker of a joint, whose force is a part of the reaction that a friction depends on."""

    forces: int  # where the series of the force begins in Expansion.constraints
    coordinates: int  # where its body-frame coordinates begin in System.reals
    is_point: int  # 1 for a Point, 0 for a Vector
    body: int


class MotionSeries(Record):
    """A prescribed motion, or a number of a load."""

    run: int  # address of what runs its program
    program: int  # where the program begins in System.reals
    values: int  # where its series begins in Expansion.constraints or, of a load, in Expansion.loads


# The Taylor workspace: the series of one step and everything else that the kernels use.

# floats of a body in Expansion.low, and where those of its parts begin
LOW, L_R, L_RD, L_OMEGA, L_P = 16, 0, 4, 8, 12


class Orders(Record):
    """Orders of the series: those of omega' are one less than those of r and A; and the time that they are about."""

    top: int  # of omega', in this step
    room: int  # for so many, from zero on
    next: int  # top of the next step
    lowest: int  # bounds of top
    highest: int
    refined: int  # how many orders of lam, from zero on, are refined
    sweeps: int  # how often they are
    time: float  # about which the series are, s


class Expansion(NamedTuple):
    """The series of a step; orders is what fits, from zero to two above the order of the method."""

    order: Orders
    bodies: np.ndarray  # (b + 1, orders, 24)  see series_loops
    low: np.ndarray  # (b, 16)  what r, rd, omega' and p lack to rounding at the start of the step; step_parts.py
    low_end: np.ndarray  # (b, 16)  the same at the end of the step tried
    start: np.ndarray  # (b, 4)  p at the start of the step
    low_r2: np.ndarray  # (b, 4)  what r_2 lacks to rounding; coefficients.py
    constraints: np.ndarray  # each kind's instances; constraint_series.series
    places: np.ndarray  # (kinds,) of layout.ConstraintSeries
    forces: np.ndarray  # (kinds,) of layout.ForceSeries
    table: np.ndarray  # int64: the bodies of each force
    loads: np.ndarray  # each kind of force's instances
    motions: np.ndarray  # (motions,) of layout.MotionSeries
    drives: np.ndarray  # (numbers of loads,) of layout.MotionSeries
    frictions: np.ndarray  # (frictions,) of layout.FrictionSeries
    sources: np.ndarray  # of layout.ReactionSource
    kept: np.ndarray  # (m,)  multipliers of the step's start, in scenes with joint friction; series_engine.py


class Trial(Record):
    """The step that is tried."""

    h: float
    limit: float  # of h, but by the series
    tol: float  # that the step is held to
    own_h: float  # by the tolerance of the run: to go back to when no longer one passes a singular configuration
    own_tol: float
    own_top: int
    highest: int  # order that has been expanded
    share: float  # singularity indicator at the end of the try before; inf for none
    looser: int  # whether longer steps at looser tolerances are tried
    serves: int  # whether the own step is a good one
    failed: int  # Status of the try before
    shorter: int  # times that it was shortened, not to end near a singular configuration
    t1: float  # its end
    last: int  # whether that is the run's
    cut: int  # whether a stop cuts a fixed step
    singular: int  # whether it ends in a singular configuration
    check: int  # address of step_parts.check_laws; 0 where all laws are analytic everywhere
    sharp: int  # whether a force is sharp
    spacing: float  # s, of the places at which laws of users are compared with their series, at most
    rate: float  # 1 + the largest of its start, m/s or rad/s
    left: float  # margin of analyticity of the force laws along the step; 1 where they are analytic everywhere
    hops: int  # in close succession, over places where a law is not analytic
    hopped: float  # time of the last one
    good: float  # share of the step up to which the series of forces are those of their laws


class SeriesContext(NamedTuple):
    """All that the driver's kernels use."""

    system: System
    work: Work
    graph: ConstraintGraph
    tangent: TangentWorkspace
    expansion: Expansion
    trial: Trial


def empty_series(orders, bodies, kept=0):
    """An `Expansion` with the series of bodies alone, and room for so many orders; kept: size of that array."""
    count = bodies.size // (orders * BODY_ROW)
    low, start, low_r2 = np.zeros((2, LOW * count)), *np.zeros((2, 4 * count))
    none, kinds = np.zeros(0), (records(kind, []) for kind in (ConstraintSeries, ForceSeries))
    return Expansion(
        Orders(room=orders), bodies, *low, start, low_r2, none, *kinds, np.zeros(0, np.int64), none,
        *(records(kind, []) for kind in (MotionSeries, MotionSeries, FrictionSeries, ReactionSource)), np.zeros(kept),
    )  # fmt: skip


def _example():
    """One of the right types."""
    expansion = empty_series(1, np.zeros(1))
    plain = plain_context()
    return SeriesContext(plain.system, plain.work, plain.graph, plain.tangent, expansion, Trial())


load_series = loader(_example())


# Memory layout of the series of forces: what each kind runs, and where its instances are.


class ForceLayout(NamedTuple):
    """Parts of an `Expansion`."""

    forces: np.ndarray
    table: np.ndarray
    loads: np.ndarray
    drives: np.ndarray


class _Kind(NamedTuple):
    """How the series of some instances of a kind are run."""

    names: tuple  # of the kernels of series, check and margin; None for none
    sharp: bool  # whether every step is checked at all places
    rows: int  # of the scratch of each
    program: list  # of a traced function


def lay_out_forces(packed, orders):
    """The `ForceLayout` of a packed scene, with what is constant in it."""
    nb = len(packed.bodies)
    index = {id(body): i for i, body in enumerate(packed.bodies)}
    rows, table, drives, written, total = [], [], [], [], 0
    for row in packed.system.forces:
        reals = int(row.reals)
        for _, group in groupby(members_of(row, packed.loads), _is_driven):  # instances of a kind are run together
            # Instances that run the same loop in one go
            members = list(group)
            force = members[0].force
            if members[0].law is not None:
                row, width = _lay_out_law(members[0], row, total, table, orders)
                rows.append(row)
                written.append((total, members[0].law.program))
                total += width
                continue
            kind = _kind(members)
            found = (address(force.kernels, name, force.name, InvalidForce) if name else 0 for name in kind.names)
            loop, check, margin = found
            width = _width(force, kind, orders, force.sharp or _is_driven(members[0]))
            run = run_order.address if kind.program else 0
            rows.append([len(members), row.stride, width, orders, loop, total, len(table), reals])
            rows[-1] += [check, margin, int(kind.sharp), 0, run, int(kind.sharp and changes_with_state(members[0]))]
            written.append((total, kind.program))
            total += len(kind.program)
            for i, load in enumerate(members):
                # A driven force reads the series of its loads from its scratch
                pair = [index.get(id(body), nb) for body in (load.force.a, load.force.b)]
                table += [*pair, (pair[0] == nb) | (pair[1] == nb) << 1]
                if _is_driven(load):
                    first = total + i * width + orders * (8 * len(force.markers) + force.slots)
                    _drive(load, first, orders, drives, written)
            total += len(members) * width
            reals += len(members) * int(row.stride)
    loads = zeros(total + 4)
    for at, numbers in written:
        loads[at : at + len(numbers)] = numbers
    return ForceLayout(records(ForceSeries, rows), np.array(table, np.int64), loads, records(MotionSeries, drives))


CHECKS = "check", "margin"


def _lay_out_law(load, kind, values, table, orders):
    """The row of Expansion.forces of a law of the whole scene, and its floats: program, rows, Euler parameters."""
    law, loop = load.law, address(load.force.kernels, "series", load.force.name, InvalidForce)
    width = len(law.program) + -(-law.rows * orders // 4) * 4 + 4 * (orders + 1) * len(law.bodies)
    count = -(-len(law.bodies) // force_series.INTS)  # entries of the table that its bodies fill
    kernels, name = load.force.kernels, load.force.name
    check, margin = (address(kernels, each, name, InvalidForce) if load.force.checked else 0 for each in CHECKS)
    row = [count, kind.stride, width, orders, loop, values, len(table), kind.reals]
    row += [check, margin, 0, 0, run_order.address, 0]
    table += [*law.bodies, *[0] * (count * force_series.INTS - len(law.bodies))]
    return row, width


def _is_driven(load):
    return any(isinstance(value, Signal) for value in load.parameters)


def _kind(members):
    """The `_Kind` of instances that are alike."""
    load, force = members[0], members[0].force
    # A traced function: every step is checked
    if hasattr(force.kernels, "program"):
        program = force.kernels.program(len(load.parameters))
        return _Kind(("series", "check", None), True, int(program[ROWS]), program)
    # Friction in proportion to a normal load: the same
    if load.normal >= 0:
        size = sum(marker.size for marker in force.markers)
        return _Kind(("series", "check", None), True, force.slots + size + FRICTION_ROWS, [])
    # Other laws: checked everywhere if sharp, or where the margin of analyticity is used up
    signals = [value for each in members for value in each.parameters if isinstance(value, Signal)]
    sharp = force.sharp or not all(signal.entire for signal in signals)
    before, numbers = ("driven_", load.alone[0].stride - 3 * len(force.markers)) if signals else ("", 0)
    check = before + "check" if sharp or force.positive != () else None
    margin = before + "margin" if force.positive and not sharp else None
    return _Kind((before + "series", check, margin), sharp, force.slots + numbers, [])


def _width(force, kind, orders, keeps):
    """Floats of an instance; keeps: whether x and xd are kept."""
    size = sum(marker.size for marker in force.markers)
    rows = kind.rows + (2 * size if keeps else 0) + (-(-kind.rows // orders) if kind.program else 0)
    return force_series.instance_width(len(force.markers), rows, orders)


def _drive(load, first, orders, drives, written):
    """The rows of the series of par, from `first` on: what a program writes, and what is constant."""
    numbers = [x for value in load.parameters for x in ([None] * value.width if isinstance(value, Signal) else [value])]
    for j, (number, program) in enumerate(zip(numbers, load.programs, strict=True)):
        if number is None:
            drives.append([run_program.address, program, first + j * orders])
        else:
            written.append((first + j * orders, [float(number)]))


# Memory layout of the series of joint friction: which forces of which markers its reaction is made of.


class FrictionLayout(NamedTuple):
    """Parts of an `Expansion`."""

    frictions: np.ndarray
    sources: np.ndarray


def kept_multipliers(graph):
    """Size of Expansion.kept."""
    return len(graph.row) if len(graph.frictions) else 0


def lay_out_frictions(packed, graph, places, forces, orders):
    """The `FrictionLayout` of a packed scene; places and forces are those of the `Expansion`."""
    found = coupled_loads(packed)
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
        for part in parts_read(packed, members, force):
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
        [
            series + force_at(j, len(part.markers), part.all_rows, orders),
            reals + 3 * j,
            int(marker.code == POINT),
            number,
        ]
        for j, marker in enumerate(part.markers)
        if part.body_of(marker) is body
    ]


# Memory layout of a Taylor run, and the parts of a scene that have no series.

SHOWN = 5  # in a message


def refusal(packed):
    """Why a scene can't be run by Taylor series, naming each part that has none; empty where it can."""
    found = without_series(packed)
    if not found:
        return ""
    shown = found[:SHOWN] + ([f"and {len(found) - SHOWN} more"] if len(found) > SHOWN else [])
    return (
        f"Taylor needs the series of every constraint and force, and these have none: {'; '.join(shown)}. All other "
        "methods serve: DOP853 is the nearest to it, Radau is for stiff scenes. A plug-in may be given a kernel "
        "`series` (docs/plug-ins.md); a function of time or state has one if it is arithmetic and functions of NumPy, "
        "without branches."
    )


def without_series(packed):
    """The constraints and forces that have no series, each as `name: why`."""
    return [f"{_label(item)}: {why}" for item, why in lacking(packed)]


def lacking(packed):
    """The constraints and forces that have no series, each with why."""
    found = []
    for constraint, given in zip(packed.constraints, packed.parameters, strict=True):
        if constraint.normalises:
            continue
        if any(isinstance(value, Motion) and not value.has_series for value in given):
            found.append((constraint, _given_by(constraint, Motion)))
        elif "driven_series" not in constraint.kernels and (
            constraint.rheonomic or any(isinstance(value, Motion) for value in given)
        ):
            found.append((constraint, "it depends on time"))
        elif any(isinstance(value, CoordinateFunction) and value.no_series for value in given):
            why = next(value.no_series for value in given if isinstance(value, CoordinateFunction) and value.no_series)
            found.append((constraint, why))
        elif "series" not in constraint.kernels:
            found.append((constraint, f"{constraint._kind()} has no kernel `series`"))
    for load in packed.loads:
        why = no_series(load.force, load.parameters) if load.law is None else load.law.no_series
        if why:
            found.append((load.force, why))
    return found


def no_series(force, parameters):
    """Why a force has no series; empty where it has one."""
    kind, signals = force._kind(), [value for value in parameters if isinstance(value, Signal)]
    try:
        for signal in signals:
            _ = signal.smooth
        if hasattr(force.kernels, "program"):
            force.kernels.program(len(parameters))
    except Untraceable as reason:
        what = _given_by(force, Signal) if signals else f"its {force.given} is a function of the state"
        return f"{what} that can't be traced, {reason}"
    if signals and "driven_series" not in force.kernels:
        return f"{_given_by(force, Signal)}, and {kind} has no kernel `driven_series`"
    if "series" in force.kernels:
        return ""
    needed = "`series` and `normal_series`" if "normal_load" in force.kernels else "`series`"
    return force.no_series or f"{kind} has no kernel {needed}"


def pays(constraints, forces):
    """Whether series are quicker than stages: not where sharp forces cut steps that solve for no reactions."""
    return not any(force.sharp for force in forces) or any(not constraint.normalises for constraint in constraints)


def _label(item):
    return item.name if item.name.startswith(item._kind()) else f"{item._kind()} {item.name!r}"


def _given_by(item, kind):
    """Which attribute is a function of time, or a table."""
    for name, value in vars(item).items():
        if isinstance(value, kind) and not getattr(value, "has_series", False):
            table = is_data(getattr(value, "source", None))
            return f"its {name} is {'a table' if table else 'a function of time'}"
    return "it has a function of time"


def room(highest):
    """Orders that there is room for, the highest being that of omega'."""
    return (highest + 3) | 1  # odd: parts that are powers of two apart would share their places in the cache


def series_width(packed, highest):
    """Floats of a step's series as dense output keeps them: the order, q, the series of bodies and the ground."""
    n = int(packed.system.bodies[:, 1].sum())
    return 1 + n + (len(packed.bodies) + 1) * BODY_ROW * room(highest)


def is_far(graph, highest):
    """Return True if the series exceed the near caches."""
    return len(graph.bodies) * room(highest) > FAR


def allocate_expansion(graph, kinds, packed, highest):
    """Lay out the series of a run, room for orders up to the highest (of omega'); the loops are loaded now."""
    orders, nb = room(highest), len(graph.bodies)
    loops = ("far_series", "far_driven_series") if is_far(graph, highest) else ("series", "driven_series")
    bodies = zeros((nb + 1) * orders * BODY_ROW)
    bodies.reshape(nb + 1, -1)[:, [0, 5, 10]] = 1.0  # A_0 of what never turns
    rows, total = [], 0
    for i, kind in enumerate(kinds):
        count = int(graph.kinds[i].count)
        # Columns of Phi_x that vary in no instance need no series
        masks = masks_of(graph, i)
        varies = bool((masks & ((1 << GROUND) - 1)).any())
        driven = bool(graph.kinds[i].drift)
        slots = kind.slots + (len(kind.quantities()) if driven else 0)
        width = instance_width(len(kind.markers), kind.all_rows, slots, orders, varies, driven)
        name = "contact_series" if touches_ground(graph, i, kind) else loops[driven]
        loop = address(kind.kernels, name, kind.__name__, InvalidConstraint)
        rows.append([count, graph.kinds[i].stride, width, orders, loop, total])
        total += count * width
    places = records(ConstraintSeries, rows)
    constraints, forces = zeros(total + 4), lay_out_forces(packed, orders)
    return Expansion(
        order=Orders(top=highest, room=orders, next=highest, lowest=highest, highest=highest),
        bodies=bodies,
        low=zeros(nb * LOW),
        low_end=zeros(nb * LOW),
        start=zeros(4 * nb),
        low_r2=zeros(4 * nb),
        constraints=constraints,
        places=places,
        motions=_motions(graph, packed, orders, places, constraints),
        **forces._asdict(),
        **lay_out_frictions(packed, graph, places, forces.forces, orders)._asdict(),
        kept=zeros(kept_multipliers(graph)),
    )


def _motions(graph, packed, orders, places, constraints):
    """Expansion.motions; what is prescribed and constant is written now."""
    motions, rows = iter(packed.system.motions), []
    for i, (kind, members) in enumerate(instances(packed, graph)):
        for at, (_, given) in enumerate(members if graph.kinds[i].drift != 0 else ()):
            first = places[i].values + at * places[i].width + scratch_at(len(kind.markers), kind.all_rows, orders, True)
            entry = 0
            for j in range(len(kind.quantities())):
                row = first + (kind.slots + j) * orders
                moves = isinstance(given[entry], Motion)
                if moves:
                    motion = next(motions)
                    rows.append([run_program.address, motion.program, row])
                else:
                    constraints[row] = given[entry]
                entry += 1 if moves else 3
    return records(MotionSeries, rows)


PATTERNS = 1024  # that are kept, of classes with their numbers
NO_MASK = (None,) * 5


def masks(graph, packed):
    """Write into the graph's table which markers' columns vary along a motion, and which are on the ground.

    Directions of bodies that never turn are as good as those of the ground: their columns are never used, and count as
    constant. So do columns that the primitive's own series leaves constant in a random motion. Returns how many markers
    have constant columns.
    """
    constant, known = 0, packed.derived.masks
    lengths = dict(zip(map(id, packed.bodies), graph.bodies[:, 1].tolist(), strict=True))
    for row, (kind, members) in zip(graph.kinds, instances(packed, graph), strict=True):
        for i, (constraint, par) in enumerate(members):
            ends = constraint.a, constraint.b, *constraint.others
            sizes = tuple([lengths.get(id(body), 0) for body in ends])
            which, given, before, mask, still = known.get(id(constraint), NO_MASK)
            if which is not constraint or given is not par or before != sizes:
                mask, still = _mask_of(constraint, (*Motion.numbers(par), *[0.0] * kind.memory), sizes)
                known[id(constraint)] = constraint, par, sizes, mask, still
            graph.table[row.table + i * INTS + MASK] = mask
            constant += still
    return constant


def _mask_of(constraint, par, sizes):
    """The mask of an instance, and how many markers have constant columns; sizes: of its bodies, 0 of the ground."""
    kind = type(constraint)
    sizes = [sizes["ab".index(where) if where in ("a", "b") else where] for where in (m.body for m in kind.markers)]
    # Directions of bodies that never turn are like those of the ground
    pairs = zip(kind.markers, sizes, strict=True)
    mask = _pattern(kind, par, tuple([size == 0 or (size == STILL and m.code != POINT) for m, size in pairs]))
    still = len(kind.markers) - (mask & ((1 << GROUND) - 1)).bit_count()
    mask |= sum(1 << (GROUND + j) for j, marker in enumerate(kind.markers) if marker.body not in ("a", "b"))
    return mask | sum(int(size != 7) << (UNTURNED + j) for j, size in enumerate(sizes)), still


def masks_of(graph, i):
    """Those of the instances of kind i."""
    first, count = graph.kinds[i].table, int(graph.kinds[i].count)
    return graph.table[first : first + count * INTS].reshape(count, INTS)[:, MASK]


def touches_ground(graph, i, kind):
    """Whether all instances of kind i are contacts with the ground, for which there are quicker loops."""
    return not graph.kinds[i].drift and is_ground_contact(kind, masks_of(graph, i))


def with_ground_contacts(graph, kinds):
    """The graph with the quicker loops of contacts with the ground, where all of a kind are."""
    for i, kind in enumerate(kinds):
        if touches_ground(graph, i, kind):
            graph.kinds["reduced"][i] = address(kind.kernels, "contact_rows", kind.__name__, InvalidConstraint)
    return graph


@lru_cache(PATTERNS)
def _pattern(kind, par, grounded):
    """The mask of instances of a class with the same numbers; grounded: which of their markers never move."""
    # The first coefficients of x, those of the ground constant
    x = np.random.default_rng(0).normal(size=(4, len(grounded), 3))
    x[1:, np.array(grounded)] = 0.0
    motion, series = x.reshape(4, -1).tolist(), twin(kind.series)
    prescribed = np.random.default_rng(1).normal(size=(len(kind.quantities()), len(motion)))
    scratch = np.concatenate((np.zeros((kind.slots, len(motion))), prescribed))
    varies = np.zeros(len(motion[0]), bool)
    # A random motion shows which columns have coefficients beyond order zero
    for k, x in enumerate(motion):
        out = np.zeros((kind.all_rows, len(x)))
        with np.errstate(all="ignore"):  # not finite where the motion is inadmissible for these numbers: varies
            series(x, par, k, scratch, out)
        if k > 0:
            varies |= out.any(axis=0)
            if varies.all():
                break
    bits = [bool(varies[3 * j : 3 * j + 3].any() and not on) << j for j, on in enumerate(grounded)]
    bits += [bool(on) << (GROUND + j) for j, on in enumerate(grounded)]
    return sum(bits)
