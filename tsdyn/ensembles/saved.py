"""Ensembles of files, as `ts.load` reads them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..errors import InvalidArgument, InvalidFile, Status, StorageError
from ..files import scene_text
from ..simulation.run_options import OPTIONS, demand_arguments_of_file
from ..simulation.scene import Scene
from ..simulation.stored_runs import hash_of
from ..validation import damaged, demand, demand_record
from .cases import FINAL, TIMES, Cases, started
from .ensemble import OWN
from .results import FORMAT, REDUCED, Ensemble

RECORD = {  # of every file, with the types of it
    "count": int, "keep": str, "is_single": bool, "kept": list, "parameters": list, "coordinates": list,
    "messages": dict, "reason": str, "threads": int, "lanes": int, "interrupted": bool, "options": dict,
    "lacking": list,
}  # fmt: skip


def load(path: Path, scene: Scene | None, allow_code: bool) -> Ensemble:
    """Return the ensemble of a file; arguments as of `ts.load`."""
    from ..files import saved_file

    path = Path(path).absolute()
    record, arrays = saved_file.read(path, FORMAT)
    with damaged(path):
        return SavedEnsemble(path, record, arrays, (scene, allow_code))


class SavedEnsemble(Ensemble):
    """An ensemble of a file."""

    def __init__(self, path, record, arrays, given):
        _demand_whole(record, arrays)
        names = [name for name, _ in record["parameters"]]
        columns = {name: arrays[f"parameter_{i}"] for i, name in enumerate(names)}
        kept = {name: arrays[f"kept_{i}"] for i, name in enumerate(record["kept"])}
        self._path, self._record = path, record
        study = SimpleNamespace(
            cases=Cases(columns, {}, record["count"]), keep=_lost if record["keep"] == REDUCED else record["keep"],
            times=arrays["times"].astype(float), free=record["free"], given=_options(record), scene=None,
        )  # fmt: skip
        found = {name: arrays[name].astype(float) for name in ("q", "qd")} | {"t": arrays["reached"].astype(float)}
        found |= {f"kept {name}".removesuffix(" kept" if record["is_single"] else ""): a for name, a in kept.items()}
        messages = {int(i): said for i, said in record["messages"].items()}
        status = arrays["status"].astype(int)
        results = SimpleNamespace(status=status, messages=messages, arrays=found, reason=record["reason"])
        super().__init__(study, results, record["threads"], record["interrupted"])
        self.lanes = record["lanes"]
        text = arrays.get("scene")
        self._given = (None if text is None else text.tobytes().decode(), *given)
        if given[0] is not None:
            self._study.scene = self._scene()

    @property
    def coordinates(self) -> list[str]:
        """As of `Ensemble`."""
        return self._record["coordinates"]

    def unit(self, name: str) -> str:
        """As of `Ensemble`."""
        return (dict(self._record["parameters"]) | self._channels).get(name, "")

    @property
    def _channels(self):
        """As of `Ensemble`; files of earlier versions have none."""
        return self._record.get("channels", {})

    def _scene(self):
        """The scene of the cases."""
        text, scene, allow_code = self._given
        if scene is None and text is None:
            raise StorageError(
                f"{self._path} holds no scene, as a file holds no code: {self._record['lacks']}. Pass the scene: "
                f"ts.load({str(self._path)!r}, scene=scene)."
            )
        if scene is None:
            try:
                return scene_text.read(text, "its scene", Scene, None, allow_code)[0]
            except InvalidFile as error:
                raise StorageError(f"{self._path}: {error}") from error
        if not isinstance(scene, Scene) or hash_of(scene.packed) != self._record.get("scene", hash_of(scene.packed)):
            raise StorageError(f"{self._path}: the scene is another one than that of the ensemble.")
        return scene

    def case(self, i: int) -> Any:
        """As of `Ensemble`."""
        if self._record["lacking"]:
            raise InvalidArgument(
                f"a case can't be run again: {', '.join(self._record['lacking'])} of the ensemble is no data, and a "
                "file holds no code."
            )
        self._number_of(i)
        if self._study.scene is None:
            self._study.scene = self._scene()
        return super().case(i)

    def _scene_record(self):
        """As of `Ensemble`: that of the file."""
        known, text = {name: self._record[name] for name in ("scene", "lacks") if name in self._record}, self._given[0]
        return known, {} if text is None else {"scene": np.frombuffer(text.encode(), np.uint8)}

    def _values(self, i):
        study = self._study
        return started(study.scene, study.cases.values(i), study.given["t_span"][0], study.free)


def _options(record):
    """The arguments of the cases, checked; none that is no option of an ensemble, such as where a run is stored."""
    options = record["options"]
    demand(options.keys() <= {"t_span", *OPTIONS}, "options")
    given = {**OPTIONS, "t_span": options.get("t_span"), **{name: options[name] for name in OWN if name in options}}
    if not record["lacking"]:
        demand_arguments_of_file(given)
    demand(given["state"] is given["events"] is None, "functions and states")
    return given | dict.fromkeys(record["lacking"], _lost)


def _demand_whole(record, arrays):
    """Raise ValueError unless all arrays have a row for each case, and coordinates a column each."""
    demand_record(record, RECORD)
    count, names = record["count"], record["coordinates"]
    pairs, messages = record["parameters"], record["messages"]
    demand(isinstance(record.get("channels", {}), dict), "channels")
    words = [*names, *record["kept"], *messages.values(), *record["lacking"]]
    words += [word for pair in (*pairs, *record.get("channels", {}).items()) for word in pair]
    words += [*(record["free"] or ()), *([] if "scene" in arrays else [record["lacks"]])]
    demand(all(isinstance(word, str) for word in words), "words")
    times = arrays["times"]
    grid = times.shape if record["keep"] == TIMES else ()
    demand(count >= 0 and record["keep"] in (FINAL, TIMES, REDUCED), "cases")
    demand(times.ndim == 1 and grid != (0,), "times")
    for name in ("q", "qd"):
        demand(arrays[name].shape == (count, *grid, len(names)), name)
    demand(arrays["status"].shape == arrays["reached"].shape == (count,), "status")
    demand(set(arrays["status"].tolist()) <= {*map(int, Status)}, "status")
    for i, name in enumerate(record["kept"]):
        series = (count, *(times.shape if times.size else ()))
        demand(name not in record.get("channels", {}) or arrays[f"kept_{i}"].shape == series, name)
    for kind, known in (("parameter", pairs), ("kept", record["kept"])):
        for i in range(len(known)):
            demand(arrays[f"{kind}_{i}"].shape[:1] == (count,), f"{kind}_{i}")


def _lost(solution):
    """In place of a function `keep`, of which a file holds the results."""
    raise InvalidArgument("a file holds what the function keep= returned, and no code.")
