"""`ts.ensemble`, and ensembles of files, as `ts.load` reads them."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting, unknown_argument
from ..elements.bodies import named
from ..errors import InvalidArgument, InvalidFile, Status, StorageError
from ..files import scene_text
from ..simulation.run_options import OPTIONS, demand_arguments_of_file, from_names
from ..simulation.scene import Scene
from ..simulation.stored_runs import hash_of
from ..simulation.termination import bar_class
from ..validation import damaged, demand, demand_arguments, demand_record, sequence, whole
from .cases import FINAL, TIMES, Cases, cases_of, demand_whole, started
from .executors import Collected, run_executor, run_threads
from .results import FORMAT, REDUCED, Ensemble
from .runner import CaseWorkspace, Study
from .tolerances import LANES

if TYPE_CHECKING:
    from ..hints import CaseTable, Keep, Place, Progress, Sequence, Span

# `ts.ensemble`: many runs of a scene with other parameters.
# Progress of an ensemble: a bar with rate and remaining time, or a user's function.


class CaseProgress:
    """What is reported of cases that are finished.

    Parameters
    ----------
    progress : bool or callable
        As of `simulate`.
    count : int
        Cases in all.
    done : int
        Cases that were finished before.
    """

    def __init__(self, progress, count, done=0):
        self.count, self.done, self._bar, self._tell = count, done, None, None
        if callable(progress):
            self._tell = progress
        elif progress not in (None, False):
            self._bar = bar_class(progress)(total=count, initial=done, unit=" cases", file=sys.stderr)

    def __call__(self, cases):
        """So many more cases are finished."""
        self.done += cases
        if self._bar is not None:
            self._bar.update(cases)
        if self._tell is not None and cases:
            self._tell(self.done / self.count)

    def close(self):
        """It has ended."""
        if self._bar is not None:
            self._bar.close()


OWN = [name for name in OPTIONS if name not in ("store", "checkpoint", "progress")]  # options of `simulate`
NAMED = ("keep", "cases", "assemble", "executor", "threads", "lanes", "store", "resume", "progress")


@fitting
def ensemble(  # many arguments, by name: each is an option of the ensemble; the others are those of `simulate`
    scene: Scene,
    parameters: CaseTable,
    t_span: Span,
    *,
    keep: Keep = "final",
    cases: int | None = None,
    assemble: bool | Sequence[str] = False,
    executor: Any = None,
    threads: int | None = None,
    lanes: int | None = None,
    store: Place | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> Ensemble:
    """Run a scene many times, with other parameters each time; the scene is not changed.

    Parameters
    ----------
    scene : Scene
    parameters : mapping, DataFrame or callable
        Name -> array of which the first dimension is the case, or one value for all cases; names are those of
        `scene.parameters()`. Or a function of the case (0, 1, ...) that returns a mapping of names to values.
    t_span : (float, float), s
    keep : {"final", "t_eval"}, sequence of str, or callable
        What is kept of each case: the last state; the states at the times of `t_eval`; channels by name, such as
        ["hinge.angle", "arm.position.z"], as of `Solution.plot`: over `t_eval` if it is given, else at the end; or what
        a function returns for the Solution: a number, an array, or a mapping of names to these.
    cases : int, optional
        The number of cases; needed for a function of the case.
    assemble : bool or sequence of str
        Whether the start of each case is made consistent: by `scene.assemble`, which moves the bodies of these names,
        or all. For parameters that change lengths, points or axes.
    executor : concurrent.futures.Executor, dask.distributed.Client or address of its scheduler, optional
        Where the cases run, in place of threads of this process. They are sent in chunks, and chunks of a worker that
        Dask has lost are sent again.
    threads : int, optional
        Threads of this process. By default one where all cases together are short, else one a processor. The bits are
        the same.
    lanes : 1 or 4, optional
        Cases that one thread runs at once, each in a lane of SIMD registers: four fit those of AVX2. They agree with
        runs alone to the tolerance. For Taylor's method; what lanes can't serve is refused by name. By default 1.
    store : str or PathLike, optional
        Stream the results to a file, in constant memory; by its suffix Zarr (.zarr) or HDF5 (.h5, .hdf5, .nc).
    resume : bool
        Go on with the cases that an ensemble left out in its store.
    progress : bool or callable, optional
        True shows a bar with rate and remaining time; a callable receives the fraction done.
    **options
        Options of `simulate`: integrator, rtol, t_eval, events, dense_output, and so on.

    Returns
    -------
    Ensemble
        A case that fails has its status and message there, and ends no other. Ctrl-C keeps what is finished.

    Raises
    ------
    TsdynError
        A subclass, before the first run, for what is wrong with all cases: an unknown parameter, lengths that differ, a
        table without cases, values that are text, an option that isn't admissible, a function with other arguments.

    Notes
    -----
    Every case has the bits of `simulate(scene.with_parameters(values), t_span, **options)`, assembled before where
    `assemble` says so, whatever the number of threads, and wherever it ran on machines of one kind. In lanes it has
    bits of its own, which depend neither on threads nor on the other cases.

    Examples
    --------
    The period of a pendulum grows with its amplitude:

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(0, 0, -1), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground))
    >>> def lowest(t, state):
    ...     return state.position(bob)[0]
    >>> lowest.terminal, lowest.direction = 1, 1
    >>> angles = np.array([0.1, 1.0, 2.0])
    >>> starts = np.stack([np.sin(angles), 0 * angles, -np.cos(angles)], axis=1)
    >>> swings = ts.ensemble(scene, {"bob.position": starts}, (0, 10), events=lowest)
    >>> print((swings.t * 4 / 3).round(4))
    [1.9882 2.1187 2.6404]
    """
    if not isinstance(scene, Scene):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    lanes = demand_lanes(lanes)
    threads = whole(threads, "threads")
    if threads is not None and executor is not None:
        raise InvalidArgument("threads and executor: the cases run on the one or the other; leave one of them out.")
    for name in options:
        if name not in OWN:
            raise unknown_argument("ensemble", name, [*NAMED, *OWN])
    asked, call = from_names({"t_span": t_span, **options})
    study = Study(
        scene, cases_of(scene, parameters, cases), asked, call, keep, free_of(scene, assemble, call.state), lanes
    )
    demand_whole(study)
    if callable(progress):
        demand_arguments(progress, "progress", ("fraction",))
    if lanes > 1:
        from .lanes import prepare_lanes

        prepare_lanes(study, CaseWorkspace)
    sink = sink_of(study, store, resume)
    report, used = CaseProgress(progress, study.cases.count, sink.first), 0
    try:
        if executor is None:
            used, interrupted = run_threads(study, sink, threads, report)
        else:
            interrupted = run_executor(study, sink, executor, report)
    finally:
        report.close()
        sink.close()
    return Ensemble(study, sink, used, interrupted)


def free_of(scene, assemble, state):
    """The names of the bodies that may move to make starts consistent; None if none may."""
    if assemble is False:
        return None
    if state is not None:
        raise InvalidArgument("assemble and state: a run from a state starts there; leave one of them out.")
    if assemble is True:
        return [body.name for body in scene.bodies]
    given = sequence(assemble, 'assemble must be True, False or names of bodies such as ("rod",)', InvalidArgument)
    return [named(scene.bodies, getattr(it, "name", it), "body to assemble").name for it in given]


def sink_of(study, store, resume):
    """Where the results go: memory, or a store."""
    if not isinstance(resume, (bool, np.bool_)):
        raise InvalidArgument(f"resume must be True or False, got {resume!r}.")
    if store is None:
        if resume:
            raise InvalidArgument(
                "resume=True goes on with a store; give store= that of the ensemble that was stopped."
            )
        return Collected(study)
    from .stored import StoredResults

    return StoredResults(study, store, bool(resume))


def demand_lanes(lanes):
    """The number of lanes: one, with the bits of runs alone, where none is given."""
    if lanes is None:
        return 1
    if isinstance(lanes, bool) or not isinstance(lanes, (int, np.integer)) or lanes not in LANES:
        raise InvalidArgument(f"lanes must be one of {', '.join(map(str, LANES))}, got {lanes!r}.")
    return int(lanes)


# Ensembles of files, as `ts.load` reads them.

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
            raise StorageError(f"{self._path}: the scene is another one than that of the ensemble; pass that.")
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

    @property
    def _scene_as_run(self):
        """As of `Ensemble`."""
        return self._study.scene

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
