"""The tables `run`, `ensemble` and `output` of a scene file: arguments of a run, cases of a study, files of results."""

import math
from pathlib import PurePath

import numpy as np

from ..errors import InvalidArgument, TsdynError
from ..methods.integrator import registered
from ..observables.channels import channels_of
from ..runs.task import kind_named
from ..validation import close, unknown_parameter
from . import types
from .expressions import Misread
from .types import decode_array, decode_number, known_keys

# The table `run` of a scene file: the arguments of a run, by the signature of `simulate`.

DATA = (types.NUMBER, types.WHOLE, types.FLAG, types.TEXT, types.ARRAY)  # kinds of arguments that are data
OWN = ("start", "end", "method", "every")
END = 10.0  # s
MANY = 10_000_000  # outputs


def arguments(simulate):
    """The arguments that a table may have besides its own keys: all that are data, but for those of a store."""
    known = types.arguments_of(simulate)
    return {name: argument for name, argument in known.items() if argument.kind in DATA and name != "checkpoint"}


def options(table, simulate, mistakes, names):
    """The arguments of `simulate` that a table asks for: t_span, and others by name."""
    path, known = ("run",), arguments(simulate)
    if not isinstance(table, dict):
        mistakes.add_value(path, "run", table, "it must be a table: [run].")
        return {}
    known_keys(path, table, (*OWN, *known), mistakes)
    found, times = {}, {"start": 0.0, "end": END, "every": None}
    for key, value in table.items():
        try:
            if key in times:
                times[key] = decode_number(value, names)
            elif key == "method":
                found["integrator"] = _method(value, (*path, key), mistakes, names)
            elif key in known:
                found[key] = known[key].decode(value, names)
        except Misread as error:
            mistakes.add_value((*path, key), f"run: {key}", value, str(error))
    found["t_span"] = span = times["start"], times["end"]
    if not -math.inf < span[0] < span[1] < math.inf:
        mistakes.add(path, f"run: the end, {span[1]:g} s, must be after the start, {span[0]:g} s.")
    elif times["every"] is not None:
        if "t_eval" in table:
            mistakes.add((*path, "every"), "run: every beside t_eval; give one of them.")
        try:
            found["t_eval"] = output_times(*span, times["every"])
        except InvalidArgument as error:
            mistakes.add((*path, "every"), str(error))
    return found


def output_times(start, end, every):
    """Output times at an interval, with both ends; raises InvalidArgument."""
    if not every > 0.0 or (end - start) / every > MANY:
        raise InvalidArgument(f"every must be an interval in s, with at most {MANY} outputs in a run, got {every:g}.")
    near = max(1e-9 * every, 4.0 * np.finfo(float).eps * max(abs(start), abs(end)))  # s: rounding of the times
    times = start + every * np.arange(math.floor((end - start) / every * (1.0 + 1e-12)) + 1)
    return np.append(times[times < end - near], end)


def _method(value, path, mistakes, names):
    """A method: its name, or a table with its type and arguments."""
    kind, known = str(value.get("type") if isinstance(value, dict) else value), registered()
    cls = kind_named(kind)
    if cls is None:
        near = [known[word].__name__ for word in close(kind.lower(), known)]
        hint = " or ".join(f'"{name}"' for name in near) or ", ".join(each.__name__ for each in known.values())
        raise Misread(f'unknown method; write {hint}, or a table such as {{ type = "RK45", rtol = 1e-9 }}.')
    if not isinstance(value, dict):
        return cls.__name__.lower()
    arguments = types.arguments_of(cls)
    known_keys(path, value, ("type", *arguments), mistakes)
    given = {key: arguments[key].decode(part, names) for key, part in value.items() if key in arguments}
    try:
        return cls(**given)
    except TsdynError as error:
        raise Misread(str(error)) from error


# The tables `ensemble` and `output` of a scene file: the cases of a study, and the files that results go to.

SPREADS = {"uniform": 2, "normal": 2, "linspace": 3}  # how many values each has; the count of a linspace may be missing
KEYS = ("parameters", "cases", "seed", "grid", "keep", "assemble")
KEEPS = ("final", "t_eval")
MOST_CASES = 1_000_000  # cases
LEAST = {"cases": 1, "seed": 0}
OUTPUT = ("files", "plot", "channels")
HINT = (
    "a value, a list with one for each case, { uniform = [low, high] }, { normal = [mean, deviation] } or "
    "{ linspace = [first, last] }"
)


def ensemble(table, scene, mistakes, names):
    """The arguments of `ts.ensemble` that a table asks for: parameters (arrays by name), keep and assemble."""
    path = ("ensemble",)
    if not isinstance(table, dict):
        mistakes.add_value(path, "ensemble", table, "it must be a table: [ensemble].")
        return {}
    known_keys(path, table, KEYS, mistakes)
    count, seed = (_whole(table, key, default, mistakes) for key, default in (("cases", None), ("seed", 0)))
    grid, keep, assemble = _choices(table, scene, mistakes)
    given = table.get("parameters", {})
    if not isinstance(given, dict) or not given:
        mistakes.add((*path, "parameters"), 'ensemble: write [ensemble.parameters], with lines such as "crank.mass" = '
                     "[1, 2, 3].")  # fmt: skip
    if scene is None or mistakes.found:
        return {}
    cases = _Cases(scene.parameters(), count, np.random.default_rng(seed), grid)
    for name, value in given.items():
        try:
            cases.add(name, value, names)
        except Misread as error:
            mistakes.add_value((*path, "parameters", name), name, value, str(error))
    try:
        found = cases.table() if not mistakes.found else {}
    except Misread as error:
        mistakes.add(path, f"ensemble: {error}")
        return {}
    return {"parameters": found, "cases": cases.count, "keep": keep, "assemble": assemble}


def _whole(table, key, default, mistakes):
    """A whole number of a table, within its limits."""
    value = table.get(key, default)
    if key not in table:
        return default
    if isinstance(value, bool) or not isinstance(value, int) or not LEAST[key] <= value <= MOST_CASES:
        reason = f"it must be a whole number from {LEAST[key]} to {MOST_CASES}."
        mistakes.add_value(("ensemble", key), f"ensemble: {key}", value, reason)
    return value


def _choices(table, scene, mistakes):
    """The values of grid, keep and assemble."""
    grid, keep, assemble = table.get("grid", False), table.get("keep", KEEPS[0]), table.get("assemble", False)
    bodies = [] if scene is None else [body.name for body in scene.bodies]
    listed = assemble == [] or _is_names(assemble)
    known = isinstance(assemble, bool) or (listed and (scene is None or all(name in bodies for name in assemble)))
    if _is_names(keep):
        _demand_channels(("ensemble", "keep"), keep, scene, mistakes)
    example = f'["{bodies[0] if bodies else "crank"}"]'
    for key, value, right, reason in (
        ("grid", grid, isinstance(grid, bool), "it must be true or false."),
        ("keep", keep, _is_names(keep) or keep in KEEPS, "it must be 'final', 't_eval' or names of channels."),
        ("assemble", assemble, known, f"it must be true, false or names of bodies such as {example}."),
    ):
        if not right:
            mistakes.add_value(("ensemble", key), f"ensemble: {key}", value, reason)
    return grid, keep, assemble


def _is_names(value):
    return isinstance(value, list) and bool(value) and all(isinstance(name, str) for name in value)


def _demand_channels(path, names, scene, mistakes):
    """Add a mistake where a name stands for no channel of the scene; without mistakes in the scene."""
    if scene is not None:
        try:
            channels_of(scene.packed, names)
        except TsdynError as error:
            mistakes.add_value(path, ": ".join(path), names, str(error))


class _Cases:
    """Parameters of the cases, as a table gives them."""

    def __init__(self, known, count, rng, grid):
        self.known, self.count, self.rng, self.grid = known, count, rng, grid
        self.columns, self.fixed, self.spread = {}, {}, {}

    def add(self, name, value, names):
        """Add a parameter."""
        if name not in self.known:
            raise Misread(f"the scene has no such parameter{unknown_parameter(name, self.known)}")
        shape = np.shape(self.known[name])
        if isinstance(value, dict):
            self.spread[name] = self._spread(value, names), shape
            return
        array = _array(value, names)
        if array.shape == shape or (shape == (3, 3) and array.shape == (3,)):
            self.fixed[name] = array
        elif array.shape[1:] == shape or (shape == (3, 3) and array.ndim == 2):
            self.columns[name] = array
        else:
            raise Misread(f"it must be {HINT}; one value has shape {shape}." if shape else f"it must be {HINT}.")

    def _spread(self, value, names):
        kind = next(iter(value), None)
        if len(value) != 1 or kind not in SPREADS or not isinstance(value[kind], list):
            raise Misread(f"it must be {HINT}.")
        numbers = [_array(part, names) for part in value[kind]]
        if len(numbers) not in (2, SPREADS[kind]):
            raise Misread(f"{kind} has two values{' and, if you like, their number' if kind == 'linspace' else ''}.")
        if kind == "normal" and (numbers[1] < 0.0).any():
            raise Misread("the deviation must not be negative.")
        return kind, numbers

    def table(self):
        """Name -> array (cases, ...), or one value for all."""
        columns = dict(self.columns)
        for name, ((kind, numbers), shape) in self.spread.items():
            if kind == "linspace" and (len(numbers) == 3 or self.grid):
                columns[name] = self._steps(name, numbers, shape)
        if self.grid:
            columns = _grid(columns)
        lengths = {name: len(column) for name, column in columns.items()}
        if self.count is not None and lengths:
            lengths["cases"] = self.count
        if len(set(lengths.values())) > 1:
            raise Misread(f"numbers of cases differ: {', '.join(f'{name} {n}' for name, n in lengths.items())}.")
        count = self.count = next(iter(lengths.values()), self.count or None)
        left = [name for name in self.spread if name not in columns]
        if count is None or count > MOST_CASES:
            raise Misread(
                f"say how many cases there are: cases = 100{'' if count is None else f', at most {MOST_CASES}'}."
            )
        for name in left:
            (kind, numbers), shape = self.spread[name]
            columns[name] = self._drawn(kind, numbers, (count, *shape))
        return {**columns, **self.fixed}

    def _steps(self, name, numbers, shape):
        count = numbers[2] if len(numbers) == 3 else np.array(self.count or 0)
        if count.shape or count < 1 or count != int(count) or count > MOST_CASES:
            raise Misread(f"{name}: linspace in a grid needs the number of values: [first, last, 10].")
        first, last = (np.broadcast_to(one, shape) for one in numbers[:2])
        return np.linspace(first, last, int(count))

    def _drawn(self, kind, numbers, size):
        if kind == "linspace":
            return np.linspace(*(np.broadcast_to(one, size[1:]) for one in numbers[:2]), size[0])
        draw = self.rng.normal if kind == "normal" else self.rng.uniform
        return draw(numbers[0], numbers[1], size)


def _array(value, names):
    """An array of plain data."""
    try:
        array = np.array(decode_array(value, names), float)
    except ValueError as error:
        raise Misread(f"it must be {HINT}; its lists have different lengths.") from error
    if not array.size or not np.isfinite(array).all():
        raise Misread("it must be finite numbers.")
    return array


def _grid(columns):
    """All combinations of the values of columns, the last one fastest."""
    if not columns:
        return {}
    if np.prod([float(len(column)) for column in columns.values()]) > MOST_CASES:
        raise Misread(f"the grid has more than {MOST_CASES} cases.")
    places = np.meshgrid(*(np.arange(len(column)) for column in columns.values()), indexing="ij")
    return {name: column[at.ravel()] for (name, column), at in zip(columns.items(), places, strict=True)}


def output(table, scene, mistakes):
    """Where results go, by key: paths of files and of a plot, None without, below the working folder; channels."""
    path, found = ("output",), {"files": [], "plot": None, "channels": []}
    if not isinstance(table, dict):
        mistakes.add_value(path, "output", table, "it must be a table: [output].")
        return found
    known_keys(path, table, OUTPUT, mistakes)
    files = table.get("files", [])
    if not isinstance(files, list):
        mistakes.add_value((*path, "files"), "output: files", files, 'it must be a list of paths such as ["run.h5"].')
        files = []
    for key, values in (("files", files), ("plot", [table["plot"]] if "plot" in table else [])):
        for value in values:
            if not isinstance(value, str) or not value or "\0" in value or _leaves(value):
                reason = "it must be a path below the working folder, such as 'results/run.h5'."
                mistakes.add_value((*path, key), f"output: {key}", value, reason)
    channels = table.get("channels", [])
    if _is_names(channels):
        _demand_channels((*path, "channels"), channels, scene, mistakes)
    elif channels != []:
        reason = 'it must be a list of names such as ["hinge.angle"].'
        mistakes.add_value((*path, "channels"), "output: channels", channels, reason)
    return {"files": files, "plot": table.get("plot"), "channels": channels}


def _leaves(path):
    """Whether a path may lead out of the folder that it is relative to."""
    parts = PurePath(path.replace("\\", "/"))
    return parts.is_absolute() or ".." in parts.parts or ":" in path
