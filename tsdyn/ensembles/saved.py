"""Ensembles of files, as `ts.load` reads them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from ..errors import InvalidArgument, InvalidFile, StorageError, TsdynError
from ..files import scene_text
from ..simulation.scene import Scene
from ..simulation.stored_runs import hash_of
from .cases import Cases, started
from .results import Ensemble
from .saving import FORMAT, REDUCED


def load(path: Path, scene: Scene | None, allow_code: bool) -> Ensemble:
    """Return the ensemble of a file; arguments as of `ts.load`."""
    from ..storage import saved_file

    path = Path(path).absolute()
    record, arrays = saved_file.read(path, FORMAT)
    try:
        return SavedEnsemble(path, record, arrays, (scene, allow_code))
    except TsdynError:
        raise
    except (KeyError, ValueError, IndexError, TypeError, AttributeError) as error:
        raise StorageError(f"{path} is damaged, or lacks something: {type(error).__name__}: {error}.") from error


class SavedEnsemble(Ensemble):
    """An ensemble of a file."""

    def __init__(self, path, record, arrays, given):
        names = [name for name, _ in record["parameters"]]
        columns = {name: arrays[f"parameter_{i}"] for i, name in enumerate(names)}
        kept = {name: arrays[f"kept_{i}"] for i, name in enumerate(record["kept"])}
        self._path, self._record, self._units = path, record, dict(record["parameters"])
        study = SimpleNamespace(
            cases=Cases(columns, {}, record["count"]), keep=_lost if record["keep"] == REDUCED else record["keep"],
            options=SimpleNamespace(times=arrays["times"]), free=record["free"], given=record["options"], scene=None,
        )  # fmt: skip
        found = {"t": arrays["reached"], "q": arrays["q"], "qd": arrays["qd"]}
        found |= {f"kept {name}".removesuffix(" kept" if record["is_single"] else ""): a for name, a in kept.items()}
        messages = {int(i): said for i, said in record["messages"].items()}
        results = SimpleNamespace(status=arrays["status"], messages=messages, arrays=found, reason=record["reason"])
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
        return self._units.get(name, "")

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

    def _values(self, i):
        study = self._study
        return started(study.scene, study.cases.values(i), study.given["t_span"][0], study.free)


def _lost(solution):
    """In place of a function `keep`, of which a file holds the results."""
    raise InvalidArgument("a file holds what the function keep= returned, and no code.")
