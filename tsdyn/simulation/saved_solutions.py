"""Solutions in files: what `Solution.save` writes, and `load` reads; dense output as numbers."""

from __future__ import annotations

import csv
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidArgument, InvalidFile, MissingDependency, Status, StorageError
from ..files.archive import COORDINATES, OUTPUTS, tables_of, units_of_level
from ..formulations.registry import formulation
from ..model.handles import handles_of, has_rates
from ..observables.channels import channels_of, values_of
from ..observables.diagnostics import ConstraintError
from ..rows.interface import redundancy
from ..runs import step_engine
from ..runs.dense_output import StepPieces, Trajectory
from ..runs.run_log import NAMES, RunEnd, demand_noted
from ..taylor import series_engine
from ..taylor.layout import series_width
from ..validation import damaged, demand, demand_numbers, demand_record, is_count, text_cell
from ..workspaces import B_CHART, B_DATA, B_END
from . import local_origin, stored_runs
from .phases import PhasePieces, Phases, Pinned, derived_record, take_derived
from .scene_cache import prepared

if TYPE_CHECKING:
    from ..hints import Place, Scene, Solution

# Dense output as numbers and arrays, from which another process reads it again.

HIGHEST, CHART = 64, 5  # order of series without a step, and numbers of a chart
ARRAYS = ("blocks", "charts", "points", "first", "angles", "asked")


def record_of(trajectory):
    """Numbers (for JSON) and arrays by name of a trajectory; TypeError if numbers don't describe a method."""
    if isinstance(trajectory, StepPieces):
        parts = [record_of(part) for part in trajectory.parts]
        arrays = {f"{i}_{name}": array for i, (_, found) in enumerate(parts) for name, array in found.items()}
        numbers = {"kind": "parts", "parts": [numbers for numbers, _ in parts]}
        if isinstance(trajectory, PhasePieces):
            numbers |= {"kind": "phases", "kinds": trajectory.kinds}
        return numbers, arrays
    if isinstance(trajectory, Pinned):
        numbers, arrays = record_of(trajectory.trajectory)
        return {"kind": "pinned", "inner": numbers}, {**arrays, "still": trajectory.still, "resting": trajectory.q}
    if isinstance(trajectory, local_origin._Moved):
        numbers, arrays = record_of(trajectory.trajectory)
        return {"kind": "moved", "inner": numbers}, {**arrays, "shift": trajectory.shift}
    make, packed, *rest = trajectory.again
    if make is series_engine.read_again:
        found = {"kind": "series", "highest": int(rest[0])}
    else:
        method, form, constraint_tol = rest
        found = {"kind": "steps", "form": form, "constraint_tol": constraint_tol}
        found["method"] = stored_runs.own_record(method)
    arrays = {name: np.asarray(getattr(trajectory, name)) for name in ARRAYS}
    return {**found, "start": float(trajectory.start), "derived": derived_record(packed)}, arrays


def trajectory_of(numbers, arrays, scenes):
    """The trajectory of a record; scenes: that of the run, or of each kind of its phases.

    Raises
    ------
    KeyError
        If its method is a plug-in that isn't known here.
    """
    kind = numbers["kind"]
    if kind in ("parts", "phases"):
        parts = numbers["parts"]
        own = [{name[len(f"{i}_") :]: array for name, array in arrays.items() if name.startswith(f"{i}_")}
               for i in range(len(parts))]  # fmt: skip
        if kind == "parts":
            return StepPieces([trajectory_of(part, found, scenes) for part, found in zip(parts, own, strict=True)])
        kinds = numbers["kinds"]
        demand(all(is_count(each) and each < len(scenes) for each in kinds), "the kinds of phases")
        every = zip(parts, own, [[scenes[each]] for each in kinds], strict=True)
        return PhasePieces([trajectory_of(*part) for part in every], kinds)
    (scene,) = scenes
    packed = scene.packed
    if kind == "pinned":
        q, still = arrays["resting"], arrays["still"].astype(int)
        demand(q.ndim == 1 and np.isin(still, np.arange(q.size)).all(), "the bodies at rest")
        return Pinned(trajectory_of(numbers["inner"], arrays, scenes), q, still)
    if kind == "moved":
        shift = arrays["shift"]
        demand(shift.shape == (int(packed.system.bodies[:, 1].sum()),), "the origin")
        slots = packed.system.reals[packed.system.memory]
        for blocks in (array for name, array in arrays.items() if name.endswith("blocks") and len(array)):
            demand(blocks.ndim == 2 and blocks.shape[1] >= slots.size, "dense output")
            slots = blocks[0, blocks.shape[1] - slots.size :]
        local = local_origin._local(prepared(scene), scene, shift[:3], slots)
        stand_in = SimpleNamespace(packed=local.packed)
        return local_origin._Moved(trajectory_of(numbers["inner"], arrays, [stand_in]), shift)
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
        method, form = stored_runs.method_of(numbers["method"]), formulation(numbers["form"])
        again = step_engine.read_again, packed, method, form.name, float(numbers["constraint_tol"])
        form = form.serving(method, has_rates(packed))
        graph = form.graph(packed)
        width = method.interpolant(form.first_order).size(n, *form.sizes(packed, graph))
        width += 4 * len(packed.system.segments) if form.has_normals else 0
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


RECORD = {  # of every file, with the types of it
    "provenance": dict, "formulation": str, "span": list, "method": str, "status": int, "reason": str, "message": str,
    "reached": (int, float), "counts": dict, "seconds": dict, "derived": dict, "tables": dict,
}  # fmt: skip
LEVELS = tuple(f"{level}_error" for level in ConstraintError._fields)
HELD = "multipliers", "power", "potential_energy", *LEVELS  # of an outline: they don't follow from its scene
LOGS = {"steps": "_step_log", "charts": "_chart_log"}


def provenance(solution: Solution) -> dict[str, Any]:
    """As of `Records.provenance`."""
    known = vars(solution).get("_provenance")
    if known is not None:
        return dict(known)
    run = solution._method, solution.method, solution.formulation, solution.span
    return stored_runs.provenance_of(stored_runs.hash_of(solution.packed), *run, solution._made)


def save(solution: Solution, path: Place) -> Path:
    """As of `Records.save`."""
    from ..files import saved_file
    from ..files.archive import tables_of

    stored_runs.demand_path(path, "path")
    path = Path(path).absolute()
    saved_file.format_at(path)
    if solution._lacks:
        remembered = solution._width
        content = solution._content
    else:
        remembered, content = stored_runs.width_of(solution.packed), _content(solution)
    tables = tables_of(solution.packed.bodies, remembered, solution._step_log is not None)
    logs = {name: _columns_of(getattr(solution, log)) for name, log in LOGS.items() if name in tables}
    counts = {"outputs": solution._length(), **{name: len(log[0]) for name, log in logs.items()}}
    tables = {name: table._replace(longest=min(table.longest, counts[name])) for name, table in tables.items()}
    rows = partial(_rows, solution, tables, logs)
    saved_file.write(path, tables, rows, provenance(solution), content)
    return path


def _columns_of(log):
    return [np.asarray(column, float) for column in log.arrays()]


def _rows(solution, tables, logs, table, start, count):
    """Rows of a table from `start` on, at most `count`, by column."""
    if table in logs:
        names = [column.name for column in tables[table].columns]
        return {name: column[start : start + count] for name, column in zip(names, logs[table], strict=True)}
    part = solution[start : start + count]
    found = {"time": part.t, "q": part.q, "qd": part.qd, "qdd": part.qdd}
    angles = part.anchor.angles
    remembered = part._all_remembered if part._lacks else np.concatenate((angles, part._remembers), 1)
    return found | ({"remembered": remembered} if remembered.shape[1] else {})


def _content(solution):
    """Numbers and arrays of all that is no table."""
    from ..files import scene_text  # what a plain run imports none of

    arrays = {"last": solution._last, "angles": solution._angles, "memory": solution._remembered}
    numbers = {
        "provenance": provenance(solution),
        "formulation": solution.formulation,
        "span": [float(t) for t in solution.span],
        "method": solution.method,
        "status": int(solution.status),
        "reason": solution._reason,
        "message": solution.message,
        "reached": float(solution._reached),
        "counts": {name: _plain(value) for name, value in dict(solution._counts).items()},
        "seconds": {name: float(value) for name, value in solution._seconds.items()},
        "energy_error": _plain(solution._energy_error),
        "derived": derived_record(solution.packed),
        "events": None,
    }
    if solution._phases is not None:
        numbers["phases"], found = solution._phases.saved()
        arrays |= {f"phase_{name}": array for name, array in found.items()}
    if solution.t_events is not None:
        numbers["events"] = len(solution.t_events)
        for name, found in zip(
            ("t", "q", "qd"), (solution.t_events, solution.q_events, solution.qd_events), strict=True
        ):
            arrays |= {f"event_{i}_{name}": np.asarray(array) for i, array in enumerate(found)}
    if solution._trajectory is not None:
        try:
            numbers["trajectory"], found = record_of(solution._trajectory)
        except TypeError as error:
            raise InvalidArgument(f"the dense output can't be saved: {error}. Save a run without it.") from error
        arrays |= {f"dense_{name}": array for name, array in found.items()}
    try:
        arrays["scene"] = np.frombuffer(
            scene_text.write(_scene_as_run(solution), type(solution.scene)).encode(), np.uint8
        )
    except InvalidArgument as error:
        numbers["lacks"] = str(error).rstrip(".")
    return numbers, arrays | _outline(solution, numbers)


def labelled_rows(solution):
    """Title and label of each row of Phi as they were run."""
    return solution._row_labels if solution._lacks else stored_runs.row_labels(solution.packed)


def _held(solution, width):
    """The arrays of an outline that don't follow from its scene, of a solution with its scene."""
    found = {"multipliers": solution.multipliers, "power": solution.power}
    found |= {"potential_energy": solution.potential_energy}
    found |= dict(zip(LEVELS, solution.constraint_error, strict=True))
    shapes = {name: (solution.t.size, *([width] if name == "multipliers" else [])) for name in HELD}
    return {f"held_{name}": np.asarray(array, float).reshape(shapes[name]) for name, array in found.items()}


def _outline(solution, numbers):
    """The arrays of an `Outline`, and its numbers entered, of a scene with parts that only their owner has."""
    if not _is_as_run(solution):
        return {}
    found, arrays = stored_runs.outline_of(solution.scene, solution.packed)
    numbers |= found
    return arrays | _held(solution, len(found["outline"]["rows"])) if found else {}


def _scene_as_run(solution):
    """The scene of a solution, if it is still as it was run."""
    if not _is_as_run(solution):
        raise InvalidArgument("the scene has been changed since the run")
    return solution.scene


def _is_as_run(solution):
    """Whether the scene has the numbers and names that it had."""
    scene = solution.scene
    if not scene.bodies:
        return False
    same = handles_of(scene.packed).names == solution.handles.names
    return same and stored_runs.hash_of(scene.packed) == provenance(solution)["scene"]


def _plain(value):
    return value.item() if isinstance(value, np.generic) else value


def load(path: Place, scene: Scene | None, allow_code: bool, kinds: tuple[type[Any], ...]) -> Solution:
    """Return the solution of a file; arguments as of `ts.load`, and the classes `Scene` and `Solution`."""
    from ..files import saved_file

    path = Path(path).absolute()
    if scene is not None and not isinstance(scene, kinds[0]):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    record, arrays = saved_file.read(path)
    with damaged(path):
        demand_record(record, RECORD)
        try:
            scene = _scene(path, record, arrays, scene, allow_code, kinds[0])
        except stored_runs.Lacking as lacking:
            if "outline" not in arrays:
                raise
            return _outlined(path, record, arrays, str(lacking), (kinds[0], kinds[2]))
        packed = scene.packed
        stored_runs.demand_same_scene(path, packed, record["provenance"]["scene"])
        take_derived(packed, record["derived"])
        return _solution(path, record, arrays, scene, kinds[1])


def _scene(path, record, arrays, scene, allow_code, kind):
    """The scene that a solution is of."""
    from ..files import scene_text

    if scene is not None:
        return scene
    if "scene" not in arrays:
        raise stored_runs.Lacking(
            f"{path} holds no scene, as a file holds no code: {record['lacks']}. Pass the scene: "
            f"ts.load({str(path)!r}, scene=scene)."
        )
    try:
        return scene_text.read(arrays["scene"].tobytes().decode(), "its scene", kind, None, allow_code)[0]
    except InvalidFile as error:
        raise stored_runs.Lacking(
            f"{path}: {error}\nImport the modules of its classes before, or pass the scene: ts.load(path, scene=scene)."
        ) from error


def _outlined(path, record, arrays, why, kinds):
    """The `Outline` of a file."""
    known = record["outline"]
    scene = stored_runs.scene_of(known, arrays["outline"], why, kinds[0])
    found = _solution(path, {**record, "trajectory": None}, arrays, scene, kinds[1], known["width"])
    held_arrays = {f"held_{name}": arrays[f"held_{name}"].astype(float) for name in HELD}
    count = found._length()
    for name, array in held_arrays.items():
        demand(array.shape == (count, *([len(known["rows"])] if name == "held_multipliers" else [])), name)
    stored_runs.complete(found, known)
    found._held, found._content = held_arrays, (_again(record), arrays)
    return found


def outlined_run(path, numbers, arrays, why, kinds):
    """The `Outline` of the store of a run that has ended, from its checkpoint; NaN for what its scene doesn't give."""
    from ..files.archive import tables_of
    from ..files.formats import format_of

    known, origin = numbers["arguments"]["outline"], numbers["provenance"]
    scene = stored_runs.scene_of(known, arrays["outline"], why, kinds[0])
    demand_record(origin, {"method": str, "formulation": str, "t_start": (int, float), "t_end": (int, float)})
    demand_record(numbers, {"reason": str, "seconds": (int, float)})
    format_of(path).demand_plain(path)
    tables = tables_of(scene.packed.bodies, known["width"], "steps" in numbers["counts"])
    angles, remembered = len(known["angles"]), arrays["remembered"]
    record = {
        "provenance": origin, "formulation": origin["formulation"], "span": [origin["t_start"], origin["t_end"]],
        "method": origin["method"], "status": numbers["status"], "reason": numbers["reason"],
        "message": f"{Status(numbers['status']).sentence} {numbers['reason']}".rstrip(), "reached": numbers["t"],
        "counts": numbers["statistics"], "seconds": {"prepare": 0.0, "run": numbers["seconds"]}, "energy_error": None,
        "derived": {"redundant": None, "turning": []}, "events": numbers.get("watched"), "outline": known,
        "lacks": str(numbers["arguments"]["lacks"]).rstrip("."),
        "tables": {name: [column.name for column in table.columns] for name, table in tables.items()},
    }  # fmt: skip
    held = {"last": arrays["last"], "angles": remembered[:angles], "memory": remembered[angles:]}
    for i in range(numbers.get("watched", 0)):
        held |= {f"event_{i}_{name}": arrays[f"event {i}.{name}"] for name in ("t", "q", "qd")}
    if "phases" in numbers:
        record["phases"] = numbers["phases"]["phases"]
        held |= {f"phase_{name}": arrays[f"phase {name}"] for name in Phases.ARRAYS}
    found = _solution(path, record, held, scene, kinds[1], known["width"])
    stored_runs.complete(found, known)
    count, rows = found._length(), len(known["rows"])
    shapes = {name: (count, rows) if name == "multipliers" else (count,) for name in HELD}
    found._held = {f"held_{name}": np.broadcast_to(np.nan, shape) for name, shape in shapes.items()}  # takes no memory
    found._content = record, {**held, **found._held, "outline": arrays["outline"]}
    return found


def _again(record):
    """The numbers of a record that `saved_file.write` doesn't add itself."""
    return {name: value for name, value in record.items() if name not in ("tables", "sums")}


def _solution(path, record, arrays, scene, kind, width=None):
    """The solution of a record that fits the scene; width: of what it remembers, if not that of the scene."""
    from ..files.archive import StoredLog, StoredOutputs, tables_of
    from ..files.formats import demand_shapes

    found, packed = kind.__new__(kind), scene.packed
    outputs = StoredOutputs(path, record["tables"])
    width = stored_runs.width_of(packed) if width is None else width
    tables = tables_of(packed.bodies, width, "steps" in record["tables"])
    demand(record["tables"] == {name: [c.name for c in table.columns] for name, table in tables.items()}, "its tables")
    demand_shapes(path, tables)
    n = int(packed.system.bodies[:, 1].sum())
    arrays = {name: array if name in ("scene", "outline") else array.astype(float) for name, array in arrays.items()}
    demand(arrays["last"].shape == (3, n) and arrays["angles"].size + arrays["memory"].size == width, "its last state")
    demand_numbers(record["counts"], NAMES)
    demand_numbers(record["seconds"], ("prepare", "run"))
    start, end = record["span"]
    demand_numbers({"start": start, "end": end, "error": record["energy_error"]}, ("start", "end", "error"), ("error",))
    demand(all(isinstance(said, (str, int, float)) for said in record["provenance"].values()), "its provenance")
    events = None, None, None
    if record["events"] is not None:
        events = [[arrays[f"event_{i}_{name}"] for i in range(record["events"])] for name in ("t", "q", "qd")]
        for t, q, qd in zip(*events, strict=True):
            demand(q.shape == qd.shape == (t.size, n) and t.ndim == 1, "its events")
    trajectory = phases = None
    if record.get("phases") is not None:
        own = {name.removeprefix("phase_"): array for name, array in arrays.items() if name.startswith("phase_")}
        phases = _phases(scene, record["phases"], own)
    if record.get("trajectory") is not None:
        dense = {name.removeprefix("dense_"): array for name, array in arrays.items() if name.startswith("dense_")}
        scenes = [scene] if phases is None else phases.scenes
        trajectory = trajectory_of(record["trajectory"], dense, scenes)
    run_end = RunEnd(
        record["reached"], arrays["last"], np.concatenate((arrays["angles"], arrays["memory"])), record["counts"],
        StoredLog.of(outputs, "steps"), StoredLog.of(outputs, "charts"),
    )  # fmt: skip
    vars(found).update(
        scene=scene, packed=packed, system=packed.system, handles=handles_of(packed),
        formulation=record["formulation"], span=tuple(record["span"]), status=Status(record["status"]),
        t_events=events[0], q_events=events[1], qd_events=events[2],
        _method=record["method"], _trajectory=trajectory, _end=run_end, _turned="", _seconds=record["seconds"],
        _energy_error=record["energy_error"], _reason=record["reason"], _message=record["message"],
        _phases=phases,
        _provenance=record["provenance"],
    )  # fmt: skip
    found._take(outputs, n)
    return found


def _phases(scene, numbers, arrays):
    """The `Phases` of a record; of the scene of an outline, in which parts are lacking, times and names alone."""
    if scene._lacks:
        phases = Phases(scene.packed, None)
        phases.restore(numbers, arrays)
        return phases
    from .contact_run import phases_of  # what runs without contacts import none of

    return phases_of(scene, numbers, arrays)


# Outputs of a run as labelled arrays and data frames, with the names and units of stores.

ERRORS = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}
ENERGIES = ("kinetic_energy", "potential_energy", "energy")
INDEX, HEAD = "time", "time (s)"


def _columns(solution):
    """Arrays (k, ...) by name: (array, dimensions, attributes)."""
    table = tables_of(solution.packed.bodies, 0, False)[OUTPUTS]
    found = {
        column.name: (getattr(solution, column.name), (table.dimension, *column.dimensions), column.attributes)
        for column in table.columns[1:]
    }
    said = {"long_name": "Lagrange multipliers", "units": "N or N m, by row"}
    found["multipliers"] = solution.multipliers, (INDEX, "row"), said
    for level, unit in ERRORS.items():
        said = {"long_name": f"largest {level} constraint error", "units": unit}
        found[f"{level}_error"] = getattr(solution.constraint_error, level), (INDEX,), said
    for name in ENERGIES:
        found[name] = getattr(solution, name), (INDEX,), {"long_name": name.replace("_", " "), "units": "J"}
    return found, table


def _row_names(solution):
    """Names of the rows of Phi as they were run."""
    return [f"{title}{label}" for title, label in labelled_rows(solution)]


def _library(name):
    try:
        return __import__(name)
    except ImportError as error:
        raise MissingDependency(f"this needs {name}: pip install 'tsdyn[data]'.") from error


def to_xarray(solution):
    """As of `Records.to_xarray`."""
    xarray = _library("xarray")
    found, table = _columns(solution)
    names = table.labels["coordinate"]
    time = table.columns[0]
    coordinates = {
        INDEX: (INDEX, solution.t, time.attributes),
        "coordinate": ("coordinate", names),
        "coordinate_units": ("coordinate", _units_of(names, "q")),
        "row": ("row", _row_names(solution)),
    }
    data = {name: (dimensions, array, said) for name, (array, dimensions, said) in found.items()}
    return xarray.Dataset(data, coordinates, provenance(solution))


def _units_of(names, level):
    """The unit of each coordinate at a level."""
    lengths, numbers = units_of_level(level).split(" or ")
    return [lengths if name.rpartition(".")[2] in COORDINATES[:3] else numbers for name in names]


def table_of(solution):
    """Names (quantity, component) of columns, their units, and the columns as an array (k, columns)."""
    found, table = _columns(solution)
    labels = {"coordinate": table.labels["coordinate"], "row": _row_names(solution)}
    columns, arrays, units = [], [], {}
    for name, (array, dimensions, said) in found.items():
        parts = labels[dimensions[1]] if len(dimensions) == 2 else [""]
        own = _units_of(parts, name) if dimensions[1:] == ("coordinate",) else [said["units"]] * len(parts)
        keys = [(name, part) for part in parts]
        columns += keys
        units |= dict(zip(keys, own, strict=True))
        arrays.append(array.reshape(len(array), len(parts)))
    return columns, units, np.concatenate(arrays, axis=1)


def to_dataframe(solution, channels):
    """As of `Records.to_dataframe`."""
    pandas = _library("pandas")
    index = pandas.Index(solution.t, name=HEAD)
    if channels is not None:
        some = channels_of(solution.packed, channels, solution._lacks)
        frame = pandas.DataFrame(values_of(solution, some), index, [one.title for one in some])
        units = {one.title: one.unit for one in some}
    else:
        columns, units, array = table_of(solution)
        frame = pandas.DataFrame(array, index, pandas.MultiIndex.from_tuples(columns))
    frame.attrs = {"units": units, **provenance(solution)}
    return frame


def to_csv(solution, path, channels):
    """What `Records.to_csv` does, and raises."""
    stored_runs.demand_path(path, "path")
    if channels is not None:
        some = channels_of(solution.packed, channels, solution._lacks)
        head, array = [one.title for one in some], values_of(solution, some)
    else:
        columns, units, array = table_of(solution)
        head = [f"{' '.join(filter(None, key))} ({units[key]})" for key in columns]
    try:
        with open(path, "w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow([HEAD, *map(text_cell, head)])
            rows.writerows([t, *row] for t, row in zip(solution.t.tolist(), array.tolist(), strict=True))
    except OSError as error:
        raise StorageError(f"{path} can't be written: {error.strerror}.") from error
    return Path(path)
