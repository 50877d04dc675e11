"""The result of an ensemble, in memory and in files: numbers, words and the text of the scene; no code, no pickle."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._version import __version__
from ..calls import fitting, fitting_methods, lacking
from ..drawing import html_table
from ..errors import InvalidArgument, MissingDependency, Status
from ..files import scene_text
from ..simulation.stored_runs import demand_path, hash_of
from ..validation import counted
from .cases import TIMES, coordinate_names

if TYPE_CHECKING:
    from pathlib import Path

    from ..hints import Bools, Floats, Integers, Place, Solution


# What `Ensemble.save` writes: numbers, words and the text of the scene; no code, no pickle.

FORMAT = "tsdyn ensemble"
REDUCED = "function"  # what is said of a function `keep`


def save(ensemble: Ensemble, path: Place) -> Path:
    """As of `Ensemble.save`."""
    from ..files import saved_file

    demand_path(path, "path")
    path = Path(path).absolute()
    saved_file.format_at(path, "an ensemble")
    record, arrays = _content(ensemble)
    attributes = {"source": f"tsdyn {__version__}", "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())}
    saved_file.write(path, {}, None, attributes, (record, arrays), FORMAT)
    return path


def _content(ensemble):
    """Numbers, and arrays by name."""
    study, parameters = ensemble._study, ensemble.parameters
    arrays = {"status": ensemble.status, "reached": ensemble.reached, "q": ensemble.q, "qd": ensemble.qd}
    arrays |= {"times": ensemble.times}
    reductions = ensemble.reductions()
    for i, (name, values) in enumerate(parameters.items()):
        if np.asarray(values).dtype.kind not in "iuf":
            raise InvalidArgument(f"the parameter {name} has values that are no numbers, and a file holds no code.")
        arrays[f"parameter_{i}"] = np.asarray(values)
    arrays |= {f"kept_{i}": np.asarray(values) for i, values in enumerate(reductions.values())}
    options, lacking = _plain(study.given)
    record = {
        "count": len(ensemble),
        "keep": REDUCED if callable(study.keep) else study.keep,
        "is_single": callable(study.keep) and not isinstance(ensemble.kept, dict),
        "kept": list(reductions),
        "parameters": [[name, ensemble.unit(name)] for name in parameters],
        "channels": ensemble._channels,
        "coordinates": ensemble.coordinates,
        "messages": {str(i): said for i, said in ensemble._results.messages.items()},
        "reason": ensemble._results.reason,
        "threads": ensemble.threads, "lanes": ensemble.lanes, "interrupted": ensemble.interrupted,
        "free": study.free, "options": options, "lacking": lacking,
    }  # fmt: skip
    numbers, held = ensemble._scene_record()
    return record | numbers, {name: np.asarray(array) for name, array in (arrays | held).items()}


def scene_record(scene):
    """Numbers and arrays of a scene, or what keeps a file from holding it."""
    record = {"scene": hash_of(scene.packed)}
    try:
        return record, {"scene": np.frombuffer(scene_text.write(scene, type(scene)).encode(), np.uint8)}
    except InvalidArgument as error:
        return record | {"lacks": str(error)}, {}


def _plain(given):
    """Options of `simulate` that are data, and the names of those that are none."""
    options, lacking = {}, []
    for name, value in given.items():
        if name in ("scene", "progress"):
            continue
        value = value.tolist() if isinstance(value, np.ndarray) else value
        try:
            options[name] = json.loads(json.dumps(value, default=_number))
        except TypeError:
            lacking.append(name)
    return options, lacking


def _number(value):
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError


@fitting_methods
class Ensemble:
    """The result of `ensemble`: cases in the order of the table of parameters; n coordinates.

    Attributes
    ----------
    t : ndarray
        keep="t_eval": the times (k,), s; otherwise the time that each case reached (cases,), s.
    q, qd : ndarray
        keep="t_eval": (cases, k, n), NaN after the end of a case; otherwise the last state (cases, n).
    kept : ndarray (cases, ...), or dict of these
        What a function `keep` made of each solution; channels by name, (cases,) or over t_eval (cases, k), NaN after
        the end of a case.
    status : ndarray of int (cases,)
        A `Status` each; CASE_FAILED where a case could not be run, NOT_RUN where none was made.
    success : ndarray of bool (cases,)
    message : list of str
        Why each case ended.
    reached : ndarray (cases,), s
    parameters : dict
        The table of parameters, name -> (cases, ...).
    lanes : int
        Cases that ran at once in one thread.
    threads : int
        Threads of this process that ran the cases; 0 with an executor.
    interrupted : bool
        Whether Ctrl-C, or an executor that broke, ended it early.

    Examples
    --------
    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> stone = scene.add_point_mass(mass=1.0, name="stone")
    >>> throws = ts.ensemble(scene, {"stone.velocity": [(1, 0, 5), (2, 0, 5), (3, 0, 5)]}, (0, 1))
    >>> throws
    <Ensemble of 3 cases: 3 success>
    >>> print(throws.q[:, 0], throws.case(1).position(stone)[-1, 0])
    [1. 2. 3.] 2.0
    """

    _made_by = "ts.ensemble(scene, parameters, t_span), or read one by ts.load(path)"

    @fitting
    def __init__(self, study: Any, results: Any, threads: int, interrupted: bool) -> None:
        self._study, self._results = study, results
        self.threads, self.interrupted, self.lanes = threads, bool(interrupted), getattr(study, "lanes", 1)

    def __getattr__(self, name: str) -> Any:
        """Refuse a name that there isn't, with what it is called here."""
        raise lacking(self, name)

    def __len__(self) -> int:
        return self._study.cases.count

    @property
    def status(self) -> Integers:
        """The `Status` of each case, int (cases,)."""
        return self._results.status

    @property
    def success(self) -> Bools:
        """True where a case reached the end of the interval, or a terminal event."""
        return np.isin(self.status, (int(Status.SUCCESS), int(Status.EVENT)))

    @property
    def message(self) -> list[str]:
        """Why each case ended."""
        known, missing = self._results.messages, f"{Status.NOT_RUN.sentence} {self._results.reason}".rstrip()
        sentences = {int(status): status.sentence for status in Status} | {int(Status.NOT_RUN): missing}
        return [known.get(i) or sentences[code] for i, code in enumerate(self.status.tolist())]

    @property
    def reached(self) -> Floats:
        """The time that each case reached, s; NaN where none was made."""
        return self._results.arrays["t"]

    @property
    def t(self) -> Floats:
        """The times of t_eval (k,), or those reached (cases,), s."""
        return self.times if self._study.keep == TIMES else self.reached

    @property
    def q(self) -> Floats:
        """Positions (cases, n) or (cases, k, n)."""
        return self._results.arrays["q"]

    @property
    def qd(self) -> Floats:
        """Velocities (cases, n) or (cases, k, n)."""
        return self._results.arrays["qd"]

    @property
    def kept(self) -> Any:
        """What a function `keep` returned: an array (cases, ...), or a dict of them; channels by name."""
        found = {name[5:]: array for name, array in self._results.arrays.items() if name.startswith("kept")}
        if not callable(self._study.keep):
            raise InvalidArgument("kept is what channels or a function keep= made of each solution; none was given.")
        if not found:  # all cases have failed
            found = {name: np.full((len(self), *self.times.shape * self._is_series), np.nan) for name in self._channels}
        return found[""] if found.keys() == {""} else found

    @property
    def parameters(self) -> dict[str, Floats]:
        """The table of parameters: name -> (cases, ...)."""
        return self._study.cases.table

    @property
    def times(self) -> Floats:
        """The times of t_eval (k,), s; empty if none were given."""
        return self._study.times

    def reductions(self) -> dict[str, Floats]:
        """Channels, or what a function `keep` made of each solution, by name; an array without a name as "kept"."""
        if not callable(self._study.keep):
            return {}
        kept = self.kept
        return dict(kept) if isinstance(kept, Mapping) else {"kept": kept}

    def unit(self, name: str) -> str:
        """The unit of a kept channel or of a parameter; "" where the class of a plug-in doesn't describe it."""
        if name in self._channels:
            return self._channels[name]
        field = self._study.family.fields.get(name)
        return field.unit if field is not None else ""

    @property
    def _channels(self):
        """Units of the kept channels by name."""
        return getattr(self._study.keep, "units", {})

    def save(self, path: Place) -> Path:
        """Write parameters, results, options and the scene to a file, from which `ts.load` returns the ensemble.

        Parameters
        ----------
        path : str or PathLike
            Ends in .h5, .hdf5, .nc or .zarr. A saved ensemble that is there is replaced.

        Returns
        -------
        Path

        Raises
        ------
        InvalidArgument
            If a parameter has values that are no numbers, or the path doesn't say the format.
        MissingDependency
            If the library of the format is not installed.
        StorageError
            If the file can't be written.

        Notes
        -----
        A file holds no code: `case(i)` of the loaded ensemble needs a scene of data, or `ts.load(path, scene=scene)`,
        and options that are numbers and words.

        Examples
        --------
        >>> from tempfile import mkdtemp
        >>> import tsdyn as ts
        >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0, name="stone")
        >>> throws = ts.ensemble(scene, {"stone.velocity": [(1, 0, 5), (2, 0, 5)]}, (0, 1))
        >>> ts.load(throws.save(mkdtemp() + "/throws.h5"))
        <Ensemble of 2 cases: 2 success>
        """
        return save(self, path)

    def plot(self, what: str | None = None, path: Place | None = None) -> Any:
        """Draw quantiles of a series over time, or else a map of one value over the parameters that vary.

        Parameters
        ----------
        what : str, optional
            As for `ts.plots.quantile_bands` and `ts.plots.final_map`; default the first result of a function `keep`,
            else the first coordinate.
        path : str or Path, optional
            A file to write the figure to, in the format of its suffix.

        Returns
        -------
        matplotlib Axes

        Raises
        ------
        MissingDependency
            If matplotlib is not installed.
        InvalidArgument
            If there is no such value, or no parameter varies.

        Examples
        --------
        >>> import matplotlib
        >>> import tsdyn as ts
        >>> matplotlib.use("agg")
        >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0, name="stone")
        >>> throws = ts.ensemble(scene, {"stone.velocity": [(1, 0, 5), (2, 0, 5)]}, (0, 1))
        >>> throws.plot("stone.x").get_xlabel()
        'stone.velocity[0] (m/s)'
        """
        from ..graphics.ensembles import overview

        return overview(self, what, path)

    def _number_of(self, i):
        """The number of a case, counted from the start; raises InvalidArgument."""
        if isinstance(i, bool) or not isinstance(i, (int, np.integer)) or not -len(self) <= i < len(self):
            raise InvalidArgument(f"the ensemble has cases 0 to {len(self) - 1}, got {i!r}.")
        return int(i) % len(self)

    def case(self, i: int) -> Solution:
        """Run a case again, alone, and return its Solution: of the bits of the ensemble, but for one in lanes.

        Changes of the scene since then don't count.

        Raises
        ------
        InvalidArgument
            If there is no such case.
        TsdynError
            If a value of the case is inadmissible.
        """
        from ..simulation.prepared_run import simulate

        study, i = self._study, self._number_of(i)
        return simulate(self._scene_as_run.with_parameters(self._values(i)), **study.given)

    @property
    def _scene_as_run(self):
        return self._study.scene_as_run

    def _values(self, i):
        """Values of a case by name, with those of its start."""
        return self._study.values(i)

    def _scene_record(self):
        """Numbers and arrays of the scene, for a file."""
        return scene_record(self._scene_as_run)

    @property
    def coordinates(self) -> list[str]:
        """Names of the coordinates, "crank.x" and so on, (n,)."""
        return coordinate_names(self._study.family.packed.bodies)

    def to_xarray(self) -> Any:
        """Return an xarray.Dataset: dimensions case, coordinate and time, parameters as variables of the case."""
        try:
            import xarray
        except ImportError as error:
            raise MissingDependency("to_xarray() needs xarray: pip install 'tsdyn[data]'.") from error
        grid = ("time",) if self._study.keep == TIMES else ()
        series = ("time",) if self._is_series else ()
        found = {"status": ("case", self.status), "reached": ("case", self.reached, {"units": "s"})}
        for name, units in (("q", "m or 1"), ("qd", "m/s or 1/s")):
            found[name] = (("case", *grid, "coordinate"), getattr(self, name), {"units": units})
        for name, values in (*self.parameters.items(), *self.reductions().items()):
            axes = tuple(f"axis {i} of {name}" for i in range(np.ndim(values) - 1))
            attributes = {"units": self.unit(name)} if name in self.parameters or name in self._channels else {}
            dimensions = "case", *(series if name in self._channels else axes)
            found[name if name not in found else f"kept {name}"] = dimensions, np.asarray(values), attributes
        coordinates = {"case": np.arange(len(self)), "coordinate": self.coordinates}
        coordinates |= {"time": ("time", self.times, {"units": "s"})} if grid or series else {}
        return xarray.Dataset(found, coordinates)

    def to_dataframe(self) -> Any:
        """Return a pandas.DataFrame: a row for each case, or for each case and time of series.

        Series are the states of keep="t_eval", and channels over t_eval. Columns of channels have their units.
        """
        try:
            import pandas
        except ImportError as error:
            raise MissingDependency("to_dataframe() needs pandas: pip install 'tsdyn[data]'.") from error
        columns, series = {}, {}
        for name, values in (*self.parameters.items(), *self.reductions().items()):
            if name in self._channels:
                series[f"{name} ({self._channels[name]})"] = np.ravel(values)
            else:
                columns |= _flat(name, values)
        columns |= {"status": [str(Status(code)) for code in self.status.tolist()], "message": self.message}
        columns["reached"] = self.reached
        for level in ("q", "qd") if not self._is_series or self._study.keep == TIMES else ():
            rows = np.asarray(getattr(self, level)).reshape(-1, len(self.coordinates))
            series |= {f"{level} {name}": rows[:, j] for j, name in enumerate(self.coordinates)}
        times = self.times.size if self._is_series else 1
        columns = {name: np.repeat(np.asarray(values), times) for name, values in columns.items()} | series
        index = np.repeat(np.arange(len(self)), times)
        if self._is_series:
            index = [index, np.tile(self.times, len(self))]
            return pandas.DataFrame(columns, index=index).rename_axis(["case", "time"])
        return pandas.DataFrame(columns, index=index).rename_axis("case")

    @property
    def _is_series(self):
        """Whether states, or channels, are kept over t_eval."""
        return self._study.keep == TIMES or bool(self._channels and self.times.size)

    def _facts(self):
        count = Counter(self.status.tolist())
        return ", ".join(f"{many} {Status(code)}" for code, many in sorted(count.items()))

    def _reason(self):
        """Why the first case that failed did; empty where none has."""
        failed = np.flatnonzero(~self.success)
        return f"case {failed[0]}: {self.message[failed[0]]}" if failed.size else ""

    def __repr__(self) -> str:
        reason = self._reason()
        return f"<Ensemble of {counted(len(self), 'case')}: {self._facts()}{reason and f'; {reason}'}>"

    def _repr_html_(self) -> str:
        """Return a table, for notebooks."""
        facts = {"cases": str(len(self)), "ended": self._facts(), "parameters": ", ".join(self.parameters)}
        if reason := self._reason():
            facts["first failure"] = reason
        return html_table(facts.items(), "Ensemble", named=True)


def _flat(name, values):
    """Columns of numbers: name[0], name[1], ... of an array."""
    array = np.asarray(values)
    if array.ndim == 1:
        return {name: array}
    rows = array.reshape(len(array), -1)
    return {f"{name}[{j}]": rows[:, j] for j in range(rows.shape[1])}
