"""What lanes can't serve, each part by name; the kernels of what they can."""

import contextlib

from ..errors import InvalidArgument, TsdynError
from ..jit.compiled import DEBUG, load
from ..motions.signals import Signal
from ..rows.graph_builder import redundant_rows
from ..runs.tolerances import LONG_STEPS
from ..simulation.run_options import OPTIONS
from ..taylor.lane_memory import constraint_loops, force_loops
from ..taylor.layout import SHOWN, is_far
from .arena import Arena
from .case_loop import FirstSlice
from .lanes import lane_runner

INSTEAD = "Leave lanes out: one case at a time serves every scene and method."
PLAIN = ("formulation", "chart_interval", "redundancy")  # of which lanes have the default


def prepare_lanes(study):
    """Load the kernels of lanes for a study.

    Raises
    ------
    InvalidArgument
        If lanes can't serve it; says what, by name.
    """
    reason = _of_options(study)
    if not reason:
        arena = Arena(study)
        _examine_start(arena)
        reason = _of_scene(arena)
    if reason:
        raise InvalidArgument(f"lanes={study.lanes}: {reason}. {INSTEAD}")
    try:
        _load(study, arena.kept)
    except TsdynError as error:
        raise InvalidArgument(f"lanes={study.lanes}: {error} {INSTEAD}") from error


def _of_options(study):
    """What is asked of the runs that lanes have not; empty for nothing."""
    given = study.given
    if DEBUG:
        return "TSDYN_DEBUG=1 runs kernels as plain Python, which has no lanes"
    changed = [f"{name}={given[name]!r}" for name in PLAIN if given[name] != OPTIONS[name]]
    if changed:
        return f"{' and '.join(changed)} can't be served in lanes"
    if study.method.driver != "series":
        return f"lanes are for Taylor series, and the method is {study.method!r}"
    if study.method.step is not None:
        return "a fixed step= has no lanes"
    asked = [name for name in ("events", "dense_output", "max_steps") if given[name] not in (None, False)]
    asked += ["channels or a function keep="] * callable(study.keep) + ["assemble="] * (study.free is not None)
    asked += ["parameters that are a function of the case"] * (study.names is None)
    if asked:
        return f"{' and '.join(asked)} can't be served in lanes"
    if not FirstSlice.serves(study):
        return "steps that end at given times, such as knots of data and sampling times, have no lanes"
    return ""


def _examine_start(arena):
    """Find the redundant rows of the scene's own start; cases may start elsewhere, so whatever is wrong is theirs."""
    with contextlib.suppress(TsdynError):
        arena.starts.start(arena.study.family.start)


def _of_scene(arena):
    """The parts of a scene that have no lanes."""
    study, packed, found = arena.study, arena.kept.packed, []
    graph = arena.kept.series.graph
    if not study.has_arena or arena.pen is None:
        return "the parameters are not all numbers that cases can share arrays for (docs/ensembles.md)"
    found += [f"{each.name} depends on time" for each in packed.constraints if each.rheonomic]
    for force_load in packed.loads:
        force = force_load.force
        if any(isinstance(value, Signal) for value in force_load.parameters):
            found.append(f"{force.name} is a function of time")
        elif hasattr(force.kernels, "program") or force_load.law is not None:
            found.append(f"{force.name} is a function of the state")
        elif force_load.normal >= 0:
            found.append(f"{force.name} follows from a reaction")
        elif force.sharp:
            found.append(f"{force.name} changes within less than its series shows")
        elif force.positive is None:
            found.append(f"{force._kind()} doesn't say where it is analytic (`positive`)")
        elif force.memory:
            found.append(f"{force.name} remembers a number from step to step")
    if redundant_rows(packed).size:
        found.append("some rows are redundant")
    if graph.axes.rows.shape[0]:
        found.append("a body has no inertia about an axis")
    if is_far(graph, study.method.orders()[2]) or study.n >= LONG_STEPS:
        found.append("there are too many bodies for the near caches")
    if found:
        more = [f"and {len(found) - SHOWN} more"] if len(found) > SHOWN else []
        return "; ".join(found[:SHOWN] + more)
    moved = arena.pen.moves and (study.call.state is not None or not arena.kept.handles.begin_at_zero)
    if moved or packed.system.memory.size or (arena.pen.moves and (graph.bodies[:, 1] == 4).any()):
        return "starts differ in a scene whose joint angles count from a given value, or with locked orientations"
    return ""


def _load(study, kept):
    constraint_loops(kept.series.kinds, study.lanes)
    force_loops(kept.packed, study.lanes)
    load(lane_runner(study.lanes))
