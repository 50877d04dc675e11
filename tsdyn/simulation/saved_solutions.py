"""Solutions in files: what `Solution.save` writes, and `load` reads."""

from __future__ import annotations

import platform
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._version import __version__
from ..errors import InvalidArgument, InvalidFile, Status, StorageError, TsdynError
from ..files import scene_text
from ..jit.cache import machine
from .scene_cache import prepared
from .stored_runs import demand_path, hash_of
from .trajectory_records import derived_record, record_of, take_derived, trajectory_of

if TYPE_CHECKING:
    from ..hints import Place, Scene, Solution

LOGS = {"steps": "_step_log", "charts": "_chart_log"}
SETTINGS = ("rtol", "atol", "step", "max_step")


def provenance(solution: Solution) -> dict[str, Any]:
    """As of `Records.provenance`."""
    known = vars(solution).get("_provenance")
    if known is not None:
        return dict(known)
    settings = {name: getattr(solution._method, name, None) for name in SETTINGS}
    return {
        "source": f"tsdyn {__version__}",
        "scene": hash_of(solution.packed),
        "method": solution.method,
        **{name: float(value) for name, value in settings.items() if isinstance(value, (int, float))},
        "formulation": solution.formulation,
        "t_start": float(solution.span[0]),
        "t_end": float(solution.span[1]),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(solution._made)),
        "machine": " ".join(machine()[:3]),
        "system": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def save(solution: Solution, path: Place) -> Path:
    """As of `Records.save`."""
    from ..storage import saved_file
    from ..storage.archive import tables_of

    demand_path(path, "path")
    path = Path(path).absolute()
    saved_file.format_at(path)
    remembered = solution.handles.count + solution.packed.system.memory.size
    tables = tables_of(solution.packed.bodies, remembered, solution._step_log is not None)
    logs = {name: _columns_of(getattr(solution, log)) for name, log in LOGS.items() if name in tables}
    counts = {"outputs": solution._length(), **{name: len(log[0]) for name, log in logs.items()}}
    tables = {name: table._replace(longest=min(table.longest, counts[name])) for name, table in tables.items()}
    rows = partial(_rows, solution, tables, logs)
    saved_file.write(path, tables, rows, provenance(solution), _content(solution))
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
    remembered = np.concatenate((part.anchor.angles, part._remembers), axis=1)
    return found | ({"remembered": remembered} if remembered.shape[1] else {})


def _content(solution):
    """Numbers and arrays of all that is no table."""
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
        numbers["lacks"] = str(error)
    return numbers, arrays


def _scene_as_run(solution):
    """The scene of a solution, if it is still as it was run."""
    if hash_of(solution.scene.packed) != provenance(solution)["scene"]:
        raise InvalidArgument("the scene has been changed since the run")
    return solution.scene


def _plain(value):
    return value.item() if isinstance(value, np.generic) else value


def load(path: Place, scene: Scene | None, allow_code: bool, kinds: tuple[type[Scene], type[Solution]]) -> Solution:
    """Return the solution of a file; arguments as of `ts.load`, and the classes `Scene` and `Solution`."""
    from ..storage import saved_file

    path = Path(path).absolute()
    record, arrays = saved_file.read(path)
    try:
        scene = _scene(path, record, arrays, scene, allow_code, kinds[0])
        packed = scene.packed
        if hash_of(packed) != record["provenance"]["scene"]:
            raise StorageError(f"{path}: the scene is another one than that of the run: its packed numbers differ.")
        take_derived(packed, record["derived"])
        return _solution(path, record, arrays, scene, kinds[1])
    except TsdynError:
        raise
    except (KeyError, ValueError, IndexError, TypeError, AttributeError) as error:
        raise StorageError(f"{path} is damaged, or lacks something: {type(error).__name__}: {error}.") from error


def _scene(path, record, arrays, scene, allow_code, kind):
    """The scene that a solution is of."""
    if scene is not None:
        if not isinstance(scene, kind):
            raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
        return scene
    if "scene" not in arrays:
        raise StorageError(
            f"{path} holds no scene, as a file holds no code: {record['lacks']}. Pass the scene: "
            f"ts.load({str(path)!r}, scene=scene)."
        )
    try:
        return scene_text.read(arrays["scene"].tobytes().decode(), "its scene", kind, None, allow_code)[0]
    except InvalidFile as error:
        raise StorageError(
            f"{path}: {error}\nImport the modules of its classes before, or pass the scene: ts.load(path, scene=scene)."
        ) from error


def _solution(path, record, arrays, scene, kind):
    """The solution of a record that fits the scene."""
    from ..storage.stored_outputs import StoredLog, StoredOutputs

    found, packed = kind.__new__(kind), scene.packed
    outputs = StoredOutputs(path, record["tables"])
    events = None, None, None
    if record["events"] is not None:
        events = [[arrays[f"event_{i}_{name}"] for i in range(record["events"])] for name in ("t", "q", "qd")]
    trajectory = None
    if "trajectory" in record:
        dense = {name.removeprefix("dense_"): array for name, array in arrays.items() if name.startswith("dense_")}
        trajectory = trajectory_of(record["trajectory"], dense, scene, packed)
    vars(found).update(
        scene=scene, packed=packed, system=packed.system, handles=prepared(scene).handles,
        formulation=record["formulation"], span=tuple(record["span"]), status=Status(record["status"]),
        t_events=events[0], q_events=events[1], qd_events=events[2],
        _method=record["method"], _trajectory=trajectory, _reached=record["reached"], _last=arrays["last"],
        _angles=arrays["angles"], _remembered=arrays["memory"], _counts=record["counts"], _seconds=record["seconds"],
        _step_log=StoredLog.of(outputs, "steps"), _chart_log=StoredLog.of(outputs, "charts"),
        _energy_error=record["energy_error"], _reason=record["reason"], _message=record["message"],
        _provenance=record["provenance"],
    )  # fmt: skip
    found._take(outputs, packed.system.bodies[:, 1].sum())
    return found
