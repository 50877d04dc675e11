"""Memory layout of a Taylor run, and the parts of a scene that have no series."""

import numpy as np

from ..elements.bodies import Ground
from ..elements.element import address
from ..elements.loops.body_poses import STILL
from ..elements.loops.constraint_rows import BODY, INTS, MASK
from ..elements.loops.constraint_series import BODY_ROW, GROUND, UNTURNED, instance_width, scratch_at
from ..elements.markers import POINT
from ..errors import InvalidConstraint
from ..formulations.locked_orientations import instances
from ..jit.aligned_arrays import zeros
from ..jit.kernels import records, twin
from ..motions.prescribed import Motion
from ..motions.program import run_program
from ..motions.signals import Signal
from ..motions.tables import is_data
from ..motions.tracing import Untraceable
from .force_layout import lay_out_forces
from .friction_layout import kept_multipliers, lay_out_frictions
from .tables import ConstraintSeries, MotionSeries
from .tolerances import FAR
from .workspace import LOW, Expansion, Orders

SHOWN = 5  # in a message


def refusal(packed):
    """Why a scene can't be run by Taylor series, naming each part that has none; empty where it can."""
    found = without_series(packed)
    if not found:
        return ""
    shown = found[:SHOWN] + ([f"and {len(found) - SHOWN} more"] if len(found) > SHOWN else [])
    return (
        f"Taylor needs the series of every constraint and force, and these have none: {'; '.join(shown)}. All other "
        "methods serve: DOP853 is the nearest to it, SDIRK54 is for stiff scenes. A plug-in may be given a kernel "
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
        elif "series" not in constraint.kernels:
            found.append((constraint, f"{constraint._kind()} has no kernel `series`"))
    for load in packed.loads:
        why = no_series(load.force, load.parameters)
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
        first, count = graph.kinds[i].table, int(graph.kinds[i].count)
        # Columns of Phi_x that vary in no instance need no series
        masks = graph.table[first : first + count * INTS].reshape(count, INTS)[:, MASK]
        varies = bool((masks & ((1 << GROUND) - 1)).any())
        driven = bool(graph.kinds[i].drift)
        slots = kind.slots + (len(kind.quantities()) if driven else 0)
        width = instance_width(len(kind.markers), kind.rows, slots, orders, varies, driven)
        rows.append([address(kind.kernels, loops[driven], kind.__name__, InvalidConstraint), total, width])
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
            first = places[i].values + at * places[i].width + scratch_at(len(kind.markers), kind.rows, orders, True)
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


def masks(graph, packed):
    """Write into the graph's table which markers' columns vary along a motion, and which are on the ground.

    Directions of bodies that never turn are as good as those of the ground: their columns are never used, and count as
    constant. So do columns that the primitive's own series leaves constant in a random motion. Returns how many markers
    have constant columns.
    """
    constant, lengths = 0, np.append(graph.bodies[:, 1], 0)
    for row, (kind, members) in zip(graph.kinds, instances(packed, graph), strict=True):
        motions, patterns, series = {}, {}, twin(kind.series)
        for i, (constraint, par) in enumerate(members):
            entry = graph.table[row.table + i * INTS :][:INTS]
            # Directions of bodies that never turn are like those of the ground
            length = [lengths[entry[BODY + (marker.body == "b")]] for marker in kind.markers]
            grounded = tuple(
                isinstance(constraint.body_of(marker), Ground) or (size == STILL and marker.code != POINT)
                for marker, size in zip(kind.markers, length, strict=True)
            )
            key = grounded, tuple(Motion.numbers(par))
            if key not in patterns:
                if grounded not in motions:
                    motions[grounded] = _random_motion(grounded)
                patterns[key] = _mask(kind, series, key[1], grounded, motions[grounded])
            # Instances with the same numbers have the same pattern
            mask = patterns[key]
            entry[MASK] = mask | sum(int(size != 7) << (UNTURNED + j) for j, size in enumerate(length))
            constant += len(kind.markers) - (mask & ((1 << GROUND) - 1)).bit_count()
    return constant


def _random_motion(grounded):
    """The first coefficients of x, those of the ground constant."""
    x = np.random.default_rng(0).normal(size=(4, len(grounded), 3))
    x[1:, np.array(grounded)] = 0.0
    return x.reshape(4, -1).tolist()


def _mask(kind, series, par, grounded, motion):
    prescribed = np.random.default_rng(1).normal(size=(len(kind.quantities()), len(motion)))
    scratch = np.concatenate((np.zeros((kind.slots, len(motion))), prescribed))
    varies = np.zeros(len(motion[0]), bool)
    # A random motion shows which columns have coefficients beyond order zero
    for k, x in enumerate(motion):
        out = np.zeros((kind.rows, len(x)))
        series(x, par, k, scratch, out)
        if k > 0:
            varies |= out.any(axis=0)
            if varies.all():
                break
    bits = [bool(varies[3 * j : 3 * j + 3].any() and not on) << j for j, on in enumerate(grounded)]
    bits += [bool(on) << (GROUND + j) for j, on in enumerate(grounded)]
    return sum(bits)
