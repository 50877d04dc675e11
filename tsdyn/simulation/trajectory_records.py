"""Dense output as numbers and arrays, from which another process reads it again."""

import numpy as np

from ..formulations.locked_orientations import keep_turning
from ..runs import step_engine
from ..runs.trajectory import Pieces, Trajectory
from ..sparse.constraint_graphs import set_redundant
from ..taylor import series_engine
from . import local_origin
from .run_requests import method_of, own_record
from .scene_cache import prepared

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
    rows = record["redundant"]
    if rows is not None:
        set_redundant(packed, np.array(rows, np.int64))
    if record["turning"]:
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
        local = local_origin._local(prepared(scene), scene, shift[:3]).packed
        return local_origin._Moved(trajectory_of(numbers["inner"], arrays, scene, local), shift)
    if numbers["derived"] != derived_record(packed):
        take_derived(packed, numbers["derived"])
    if kind == "series":
        again = series_engine.read_again, packed, numbers["highest"]
    else:
        again = step_engine.read_again, packed, method_of(numbers["method"]), numbers["form"], numbers["constraint_tol"]
    blocks, charts, points, first, angles, asked = (arrays[name] for name in ARRAYS)
    stops = np.stack([asked, np.ones(asked.size)], axis=1)
    return Trajectory((None, again), (blocks, charts, points), numbers["start"], first, angles, stops)
