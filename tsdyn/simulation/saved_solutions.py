"""Solutions in files: what `Solution.save` writes, and `load` reads."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidArgument, InvalidFile, Status
from ..model.handles import handles_of
from ..observables.diagnostics import ConstraintError
from ..runs.counts import NAMES
from ..runs.run_end import RunEnd
from ..validation import damaged, demand, demand_numbers, demand_record
from .outlines import Lacking, complete, outline_of, row_labels, scene_of, width_of
from .stored_runs import demand_path, demand_same_scene, hash_of, provenance_of
from .trajectory_records import derived_record, record_of, take_derived, trajectory_of

if TYPE_CHECKING:
    from ..hints import Place, Scene, Solution

RECORD = {  # of every file, with the types of it
    "provenance": dict, "formulation": str, "span": list, "method": str, "status": int, "reason": str, "message": str,
    "reached": (int, float), "counts": dict, "seconds": dict, "derived": dict, "tables": dict,
}  # fmt: skip
LEVELS = tuple(f"{level}_error" for level in ConstraintError._fields)
HELD = "multipliers", "power", "potential_energy", *LEVELS  # of an outline: its scene doesn't tell them
LOGS = {"steps": "_step_log", "charts": "_chart_log"}


def provenance(solution: Solution) -> dict[str, Any]:
    """As of `Records.provenance`."""
    known = vars(solution).get("_provenance")
    if known is not None:
        return dict(known)
    told = solution._method, solution.method, solution.formulation, solution.span
    return provenance_of(hash_of(solution.packed), *told, solution._made)


def save(solution: Solution, path: Place) -> Path:
    """As of `Records.save`."""
    from ..storage import saved_file
    from ..storage.archive import tables_of

    demand_path(path, "path")
    path = Path(path).absolute()
    saved_file.format_at(path)
    if solution._lacks:
        remembered = solution._width
        content = solution._content
    else:
        remembered, content = width_of(solution.packed), _content(solution)
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
    return solution._row_labels if solution._lacks else row_labels(solution.packed)


def _held(solution, width):
    """The arrays of an outline that its scene doesn't tell, of a solution with its scene."""
    found = {"multipliers": solution.multipliers, "power": solution.power}
    found |= {"potential_energy": solution.potential_energy}
    found |= dict(zip(LEVELS, solution.constraint_error, strict=True))
    shapes = {name: (solution.t.size, *([width] if name == "multipliers" else [])) for name in HELD}
    return {f"held_{name}": np.asarray(array, float).reshape(shapes[name]) for name, array in found.items()}


def _outline(solution, numbers):
    """The arrays of an `Outline`, and its numbers entered, of a scene with parts that only their owner has."""
    if hash_of(solution.scene.packed) != provenance(solution)["scene"]:
        return {}
    found, arrays = outline_of(solution.scene, solution.packed)
    numbers |= found
    return arrays | _held(solution, len(found["outline"]["rows"])) if found else {}


def _scene_as_run(solution):
    """The scene of a solution, if it is still as it was run."""
    if hash_of(solution.scene.packed) != provenance(solution)["scene"]:
        raise InvalidArgument("the scene has been changed since the run")
    return solution.scene


def _plain(value):
    return value.item() if isinstance(value, np.generic) else value


def load(path: Place, scene: Scene | None, allow_code: bool, kinds: tuple[type[Any], ...]) -> Solution:
    """Return the solution of a file; arguments as of `ts.load`, and the classes `Scene` and `Solution`."""
    from ..storage import saved_file

    path = Path(path).absolute()
    if scene is not None and not isinstance(scene, kinds[0]):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    record, arrays = saved_file.read(path)
    with damaged(path):
        demand_record(record, RECORD)
        try:
            scene = _scene(path, record, arrays, scene, allow_code, kinds[0])
        except Lacking as lacking:
            if "outline" not in arrays:
                raise
            return _outlined(path, record, arrays, str(lacking), (kinds[0], kinds[2]))
        packed = scene.packed
        demand_same_scene(path, packed, record["provenance"]["scene"])
        take_derived(packed, record["derived"])
        return _solution(path, record, arrays, scene, kinds[1])


def _scene(path, record, arrays, scene, allow_code, kind):
    """The scene that a solution is of."""
    from ..files import scene_text

    if scene is not None:
        return scene
    if "scene" not in arrays:
        raise Lacking(
            f"{path} holds no scene, as a file holds no code: {record['lacks']}. Pass the scene: "
            f"ts.load({str(path)!r}, scene=scene)."
        )
    try:
        return scene_text.read(arrays["scene"].tobytes().decode(), "its scene", kind, None, allow_code)[0]
    except InvalidFile as error:
        raise Lacking(
            f"{path}: {error}\nImport the modules of its classes before, or pass the scene: ts.load(path, scene=scene)."
        ) from error


def _outlined(path, record, arrays, why, kinds):
    """The `Outline` of a file."""
    known = record["outline"]
    scene = scene_of(known, arrays["outline"], why, kinds[0])
    found = _solution(path, {**record, "trajectory": None}, arrays, scene, kinds[1], known["width"])
    held_arrays = {f"held_{name}": arrays[f"held_{name}"].astype(float) for name in HELD}
    count = found._length()
    for name, array in held_arrays.items():
        demand(array.shape == (count, *([len(known["rows"])] if name == "held_multipliers" else [])), name)
    complete(found, known)
    found._held, found._content = held_arrays, (_again(record), arrays)
    return found


def outlined_run(path, numbers, arrays, why, kinds):
    """The `Outline` of the store of a run that has ended, from its checkpoint; what its scene doesn't tell is NaN."""
    from ..storage.archive import tables_of
    from ..storage.formats import format_of

    known, told = numbers["arguments"]["outline"], numbers["provenance"]
    scene = scene_of(known, arrays["outline"], why, kinds[0])
    demand_record(told, {"method": str, "formulation": str, "t_start": (int, float), "t_end": (int, float)})
    demand_record(numbers, {"reason": str, "seconds": (int, float)})
    format_of(path).demand_plain(path)
    tables = tables_of(scene.packed.bodies, known["width"], "steps" in numbers["counts"])
    angles, remembered = len(known["angles"]), arrays["remembered"]
    record = {
        "provenance": told, "formulation": told["formulation"], "span": [told["t_start"], told["t_end"]],
        "method": told["method"], "status": numbers["status"], "reason": numbers["reason"],
        "message": f"{Status(numbers['status']).sentence} {numbers['reason']}".rstrip(), "reached": numbers["t"],
        "counts": numbers["statistics"], "seconds": {"prepare": 0.0, "run": numbers["seconds"]}, "energy_error": None,
        "derived": {"redundant": None, "turning": []}, "events": numbers.get("watched"), "outline": known,
        "lacks": str(numbers["arguments"]["lacks"]).rstrip("."),
        "tables": {name: [column.name for column in table.columns] for name, table in tables.items()},
    }  # fmt: skip
    held = {"last": arrays["last"], "angles": remembered[:angles], "memory": remembered[angles:]}
    for i in range(numbers.get("watched", 0)):
        held |= {f"event_{i}_{name}": arrays[f"event {i}.{name}"] for name in ("t", "q", "qd")}
    found = _solution(path, record, held, scene, kinds[1], known["width"])
    complete(found, known)
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
    from ..storage.archive import tables_of
    from ..storage.formats import demand_shapes
    from ..storage.stored_outputs import StoredLog, StoredOutputs

    found, packed = kind.__new__(kind), scene.packed
    outputs = StoredOutputs(path, record["tables"])
    width = width_of(packed) if width is None else width
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
    trajectory = None
    if record.get("trajectory") is not None:
        dense = {name.removeprefix("dense_"): array for name, array in arrays.items() if name.startswith("dense_")}
        trajectory = trajectory_of(record["trajectory"], dense, scene, packed)
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
        _provenance=record["provenance"],
    )  # fmt: skip
    found._take(outputs, n)
    return found
