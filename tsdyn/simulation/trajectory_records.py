"""Dense output as numbers and arrays, from which another process reads it again."""

import numpy as np

from ..formulations.locked_orientations import keep_turning
from ..formulations.registry import formulation
from ..model.handles import handles_of
from ..rows.interface import redundancy
from ..runs import step_engine
from ..runs.snapshot import demand_noted
from ..runs.trajectory import Pieces, Trajectory
from ..sparse.constraint_graphs import graph_of, set_redundant
from ..taylor import series_engine
from ..taylor.layout import series_width
from ..validation import demand
from ..workspaces.run_state import B_CHART, B_DATA, B_END
from . import local_origin
from .run_requests import method_of, own_record
from .scene_cache import prepared

HIGHEST, CHART = 64, 5  # order of series without a step, and numbers of a chart
ARRAYS = ("blocks", "charts", "points", "first", "angles", "asked")


def record_of(trajectory):
    """Numbers (for JSON) and arrays by name of a trajectory; raises TypeError for a method that numbers don't tell."""
    if isinstance(trajectory, Pieces):
        parts = [record_of(part) for part in trajectory.parts]
        arrays = {f"{i}_{name}": array for i, (_, found) in enumerate(parts) for name, array in found.items()}
        return {"kind": "parts", "parts": [numbers for numbers, _ in parts]}, arrays
    if isinstance(trajectory, local_origin._Moved):
        numbers, arrays = record_of(trajectory.trajectory)
        return {"kind": "moved", "inner": numbers}, {**arrays, "shift": trajectory.shift}
    make, packed, *rest = trajectory.again
    if make is series_engine.read_again:
        found = {"kind": "series", "highest": int(rest[0])}
    else:
        method, form, constraint_tol = rest
        found = {"kind": "steps", "method": own_record(method), "form": form, "constraint_tol": constraint_tol}
    arrays = {name: np.asarray(getattr(trajectory, name)) for name in ARRAYS}
    return {**found, "start": float(trajectory.start), "derived": derived_record(packed)}, arrays


def derived_record(packed):
    """What a run has found out about its constraint graph: redundant rows, and bodies that count as turning."""
    rows = packed.derived.redundant
    turning = sorted(int(body) for body in packed.derived.turning)
    return {"redundant": None if rows is None else np.asarray(rows).tolist(), "turning": turning}


def take_derived(packed, record):
    """Enter it into a packed scene."""
    rows, most = record["redundant"], len(graph_of(packed).row)
    if rows is not None:
        demand(all(type(row) is int and 0 <= row < most for row in rows), "the redundant rows")
        set_redundant(packed, np.array(rows, np.int64))
    if record["turning"]:
        demand(set(record["turning"]) <= set(range(len(packed.bodies))), "the turning bodies")
        keep_turning(packed, record["turning"])


def trajectory_of(numbers, arrays, scene, packed):
    """The trajectory of a record.

    Raises
    ------
    KeyError
        If its method is a plug-in that isn't known here.
    """
    kind = numbers["kind"]
    if kind == "parts":
        parts = numbers["parts"]
        own = [{name[len(f"{i}_") :]: array for name, array in arrays.items() if name.startswith(f"{i}_")}
               for i in range(len(parts))]  # fmt: skip
        return Pieces([trajectory_of(part, found, scene, packed) for part, found in zip(parts, own, strict=True)])
    if kind == "moved":
        shift = arrays["shift"]
        demand(shift.shape == (int(packed.system.bodies[:, 1].sum()),), "the origin")
        local = local_origin._local(prepared(scene), scene, shift[:3]).packed
        return local_origin._Moved(trajectory_of(numbers["inner"], arrays, scene, local), shift)
    if numbers["derived"] != derived_record(packed):
        take_derived(packed, numbers["derived"])
    blocks, charts, points, first, angles, asked = found = [arrays[name] for name in ARRAYS]
    demand(all(array.dtype == float for array in found), "dense output")
    n, handles = int(packed.system.bodies[:, 1].sum()), handles_of(packed)
    if kind == "series":
        highest = numbers["highest"]
        again = series_engine.read_again, packed, highest
        demand(type(highest) is int and 0 < highest <= max(blocks.shape[1], HIGHEST), "the order")
        width, graph = series_width(packed, highest), None
    else:
        method, form = method_of(numbers["method"]), formulation(numbers["form"])
        again = step_engine.read_again, packed, method, form.name, float(numbers["constraint_tol"])
        form = form.serving(method)
        graph = form.graph(packed)
        width = method.interpolant(form.first_order).size(n, *form.sizes(n, len(packed.system.segments), graph))
        if method.coupled and len(blocks):
            demand((blocks[:, B_DATA] == method.kernel(form.first_order)[1][0]).all(), "the stages of steps")
    width += B_DATA + handles.count + packed.system.memory.size
    demand(first.shape == (3, n) and angles.shape == (handles.count,) and asked.ndim == 1, "the start")
    demand(blocks.ndim == charts.ndim == points.ndim == 2, "dense output")
    if len(blocks):
        _demand_steps(blocks, charts, points, width, highest if graph is None else None)
    if graph is not None and len(blocks):
        demand(points.shape[1] == n + redundancy(graph) and charts.shape[1] == CHART, "the charts")
        demand(np.isin(blocks[:, B_CHART], np.arange(len(charts))).all(), "the charts of steps")
        demand_noted(points[:, n:], len(graph.row))
    stops = np.stack([asked, np.ones(asked.size)], axis=1)
    return Trajectory((None, again), (blocks, charts, points), float(numbers["start"]), first, angles, stops)


def _demand_steps(blocks, charts, points, width, highest):
    """Raise ValueError unless blocks are those of steps one after the other; highest: order of series, or None."""
    demand(blocks.shape[1] == width and len(points) in (len(charts), 0), "the steps")
    ends = blocks[:, B_END]
    demand(np.isfinite(ends).all() and (np.diff(ends) >= 0.0).all(), "the ends of steps")
    orders = np.arange(1, 1 + (highest or 0))
    demand(highest is None or np.isin(blocks[:, B_DATA], orders).all(), "the orders of steps")
