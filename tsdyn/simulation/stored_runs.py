"""Runs with a store: the request, outputs in memory or in the store, contents of a checkpoint, the end of a run."""

from __future__ import annotations

import copy
import hashlib
import inspect
import json
import os
import platform
import time
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from .._version import __version__
from ..calls import lacking
from ..errors import InvalidArgument, Status, StorageError
from ..jit.code_hash import is_ours, platform_hash
from ..jit.compilers import machine
from ..methods.integrator import is_own, registered
from ..model.handles import called_functions, handles_of, user_functions
from ..model.kinematics import Anchor
from ..observables.state import RememberingState, State, remembered
from ..runs import run_log
from ..runs.run_log import RunEnd
from ..runs.task import Outcome, state_arrays
from ..validation import clipped, damaged, demand, demand_numbers, demand_record, is_count, number, shown
from .scene_cache import prepared_numbers

if TYPE_CHECKING:
    from ..hints import Floats, Scene

# What `simulate` was asked, as numbers and arrays: what a checkpoint begins with. Functions and code are left out.

PASSED_AGAIN = ("events", "progress")  # arguments that are functions
OWN = ("scene", "store", "checkpoint", "state", "integrator", *PASSED_AGAIN)  # arguments that are kept apart
STATE = "q", "qd", "qdd", "multipliers", "memory", "angles"


def request_of(given: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Numbers (for JSON) and arrays of the arguments of a run, and its scene where a file can hold that.

    Raises
    ------
    InvalidArgument
        If the method is one of the user's own.
    """
    from ..files import scene_text  # takes a while to import

    scene, method, state = given["scene"], given["integrator"], given["state"]
    rest = {name: np.asarray(value).tolist() if value is not None else None
            for name, value in given.items() if name not in OWN}  # fmt: skip
    numbers = {"options": json.loads(json.dumps(rest)), "method": method, "lacks": ""}
    arrays = {}
    if method is not None and not isinstance(method, str):
        try:
            numbers["method"] = method_record(method() if isinstance(method, type) else method)
        except TypeError as error:
            raise InvalidArgument(
                f"a run by a method of your own can't go on from a file, which keeps no code: {error}."
            ) from None
    if state is not None:
        q, qd = state_arrays(state, scene._initial()[0].size)
        found = {"q": q, "qd": qd} | {name: getattr(state, name, None) for name in STATE[2:5]}
        found["angles"] = state.angles if getattr(state, "anchor", None) is not None else None
        arrays |= {f"state.{name}": np.asarray(array, float) for name, array in found.items() if array is not None}
        numbers["t"] = float(getattr(state, "t", given["t_span"][0]))
    foreign = {type(item) for item in (*scene._added, *scene.forces) if not is_ours(type(item).__module__)}
    numbers["lacks"] = ", ".join(sorted(f"{kind.__module__}.{kind.__qualname__}" for kind in foreign))
    if not foreign:
        try:
            arrays["scene"] = np.frombuffer(scene_text.write(scene, type(scene)).encode(), np.uint8)
        except InvalidArgument as error:
            numbers["lacks"] = str(error)
    if "scene" not in arrays:
        found, text = outline_of(scene, prepared_numbers(scene).packed)
        numbers, arrays = numbers | found, arrays | text
    return numbers, arrays


def arguments_of(numbers: dict[str, Any], arrays: dict[str, Any], scene: Scene) -> dict[str, Any]:
    """The arguments of `simulate` for a scene, by name; KeyError, TypeError or ValueError where they are none."""
    method = numbers["method"]
    given = {**numbers["options"], "state": None}
    given["integrator"] = method if method is None or isinstance(method, str) else method_of(method)
    found = {name: arrays.get(f"state.{name}") for name in STATE}
    if found["q"] is not None:
        nothing = np.empty(0)
        q, qd, qdd, lam = (nothing if found[name] is None else found[name] for name in STATE[:4])
        parts = numbers["t"], q, qd, qdd, lam
        anchor, kept = None if found["angles"] is None else Anchor(found["angles"]), prepared_numbers(scene)
        bare = found["memory"] is None and anchor is None
        state = State(*parts) if bare else RememberingState.of(kept.handles, found["memory"], anchor, *parts)
        given["state"], start = state, state_arrays(state, kept.n)
        remembered(state, kept, float(numbers["t"]), start[0])
    return given


def method_record(method: Any) -> list[Any]:
    """The class and the settings of a method; raises TypeError for one that numbers don't describe."""
    if not isinstance(method, tuple(registered().values())) or not is_own(type(method)) or "driver" in vars(method):
        raise TypeError(f"{type(method).__module__}.{type(method).__qualname__}")
    return own_record(method)


def own_record(method: Any) -> list[Any]:
    """As `method_record`, of any registered class."""
    settings = {name: value.item() if isinstance(value, np.generic) else value for name, value in vars(method).items()}
    if not all(value is None or isinstance(value, (bool, int, float, str)) for value in settings.values()):
        raise TypeError(f"the settings of {method!r} are not numbers")
    return [type(method).__name__.lower().replace("_", ""), settings]


def method_of(record: list[Any]) -> Any:
    """The method of a record: made by its class, which checks its settings.

    Raises
    ------
    KeyError
        If it is a plug-in that isn't known here.
    ValueError
        If the class makes another method of the settings.
    """
    name, settings = record
    kind = registered()[name]
    if not is_own(kind):  # what the arguments of its constructor are, its author alone knows
        method = kind.__new__(kind)
        vars(method).update(settings)
        return method
    known = {name: settings[name] for name in inspect.signature(kind).parameters if name in settings}
    if "fixed" in settings:
        known["order"] = settings["fixed"]
    method = kind(**known)
    for name, value in settings.items():
        if name not in vars(method) and type(getattr(kind, name)) is type(value) is float:
            setattr(method, name, value)
    if vars(method) != settings:
        raise ValueError(f"{kind.__name__} has no such settings")
    return method


# The outputs of a run as arrays: in memory, or in a store from which they are read when they are asked for.

_COLUMNS = {"t": "time", "q": "q", "qd": "qd", "qdd": "qdd", "anchor": "remembered", "_remembers": "remembered"}


class RunOutputs:
    """Mixed into `Solution`: t (k,), q, qd, qdd (k, n), the turns of joint angles, what forces remember (k, slots)."""

    t: Floats
    q: Floats
    qd: Floats
    qdd: Floats
    handles: Any
    _end: Any  # a `RunEnd`, or a `RecordedEnd`

    _reached = property(lambda self: self._end.reached)
    _last = property(lambda self: self._end.last)
    _angles = property(lambda self: self._end.remembered[: self.handles.count])
    _remembered = property(lambda self: self._end.remembered[self.handles.count :])
    _step_log = property(lambda self: self._end.steps)
    _chart_log = property(lambda self: self._end.charts)
    _counts = property(lambda self: self._end.counts)

    def _take(self, rows, n):
        """Take the rows (k, 1 + 3 n + angles + slots) of a run, or its `StoredOutputs`."""
        in_memory, self._slice = isinstance(rows, np.ndarray), slice(None)
        self._stored, self._rows = None if in_memory else rows, (rows, n) if in_memory else None

    def _unpack(self, rows, n):
        """Make arrays of the rows of a run, when the first of them is asked for."""
        self.q, self.qd, self.qdd = rows[:, 1 : 1 + 3 * n].reshape(-1, 3, n).swapaxes(0, 1).copy()
        self._set_remembered(rows[:, 1 + 3 * n :].copy())
        self.t = rows[:, 0].copy()
        self._rows = None

    def _set_remembered(self, rest):
        angles = self.handles.count
        self.anchor, self._remembers = Anchor(rest[:, :angles]), rest[:, angles:]

    def __getattr__(self, name: str) -> Any:
        rows, stored = self.__dict__.get("_rows"), self.__dict__.get("_stored")
        if name in _COLUMNS and rows is not None:
            self._unpack(*rows)
        if name in _COLUMNS and name in self.__dict__:  # made now, or by another thread
            return self.__dict__[name]
        if stored is None or name not in _COLUMNS:
            raise lacking(self, name)
        found = stored.read(_COLUMNS[name], self._slice)
        if _COLUMNS[name] != "remembered":
            setattr(self, name, found)
        else:
            self._set_remembered(np.empty((self._length(), 0)) if found is None else found)
        return self.__dict__[name]

    @cached_property
    def _phase_of_rows(self):
        """The number of the phase of each output (k,); None without phases."""
        if self._phases is None:
            return None
        t = self.t if self._stored is None else self._stored.read(_COLUMNS["t"], slice(None))
        return self._phases.of_outputs(t)[self._slice]

    @cached_property
    def _shifted(self):
        """As `_before_jumps`; None where no output ends a phase."""
        times = None if self._phases is None else self._phases.times_within(self._phase_of_rows, self.t)
        if times is None or (times == self.t).all():
            return None
        other = self._picked(slice(None))
        other.t, other._shifted = times, None
        return other

    @property
    def _before_jumps(self):
        """The same with times just before those at which phases end: loads that jump there have their values before."""
        return self if self._shifted is None else self._shifted

    def _length(self):
        """How many outputs there are; of a store without reading them."""
        return self.t.size if self._stored is None else len(range(self._stored.count)[self._slice])

    def __getitem__(self, part: slice) -> Self:
        """Return a solution of some of the outputs, `solution[a:b]`; of a stored run nothing else is read.

        Events, statistics and histories remain those of the whole run.
        """
        bounds = (part.start, part.stop, part.step) if isinstance(part, slice) else ("",)
        if not all(each is None or isinstance(each, (int, np.integer)) for each in bounds) or (part.step or 1) < 1:
            raise InvalidArgument(
                f"outputs are taken by slices, such as solution[100:200] or solution[::10], got {shown(part)}."
            )
        if self._stored is None:
            return self._picked(part)
        other, found = self._bare(), range(self._stored.count)[self._slice][part]
        other._slice = slice(found.start, max(found.stop, found.start), found.step)
        return other

    def _picked(self, part):
        """A solution of some outputs of a run in memory; part is a slice or indices."""
        self._length()
        other = self._bare()
        for name in ("t", "q", "qd", "qdd", "_remembers"):
            setattr(other, name, getattr(self, name)[part])
        other.anchor = Anchor(self.anchor.angles[part])
        if self._phases is not None:
            other._phase_of_rows = self._phase_of_rows[part]
        return other

    def _bare(self):
        """A copy without what has been read, or derived from it."""
        other = copy.copy(self)
        for name in [name for name in vars(other) if name in _COLUMNS or hasattr(type(self), name)]:
            del vars(other)[name]
        return other

    __iter__ = None  # by the old protocol __getitem__ would make one


# Runs with a store: its archive, what a checkpoint holds beside the state, how a run ends in it.

SETTINGS = ("rtol", "atol", "step", "max_step")  # of a method, as in its provenance


def demand_storable(call, options):
    """Raise InvalidArgument or StorageError unless a store can be made as a `RunCall` with `RunOptions` asks for."""
    path, interval = call.store, call.checkpoint
    if path is None:
        raise InvalidArgument("checkpoint needs a store, which it goes on with: simulate(..., store='run.h5').")
    from ..files.formats import demand_free, format_of

    demand_path(path, "store")
    format_of(path)
    if options.dense_output:
        raise InvalidArgument("a store keeps outputs, no interpolants: give t_eval in place of dense_output.")
    if interval is not None and not 0.0 <= number(interval) < np.inf:
        raise InvalidArgument(f"checkpoint must be a time in s, 0 or more, got {interval!r}.")
    demand_free(path)


def demand_path(path, name):
    """Raise InvalidArgument unless a value is a path."""
    if not isinstance(path, (str, os.PathLike)) or "\0" in str(path):
        raise InvalidArgument(f"{name} must be a path, as text or a Path, got {path!r}.")


def archive_of(given, kept, history, numbers, arrays):
    """The `Archive` of a run, made or, with the numbers and arrays of a checkpoint, gone on with."""
    from ..files.archive import Archive, tables_of
    from ..files.formats import demand_shapes, format_of, writing

    facts = _facts(given, kept) | {"granted": 0}
    if numbers is not None:
        _demand_same_functions(given["store"], facts, numbers)
    remembered = kept.handles.count + kept.packed.system.memory.size
    tables = tables_of(kept.packed.bodies, remembered, history)
    attributes = {"source": f"tsdyn {__version__}", "scene": facts["scene"]}
    if numbers is not None:
        format_of(given["store"]).demand_plain(given["store"], 0 if numbers.get("ended") else numbers["size"])
        demand_shapes(given["store"], tables)
        with damaged("the checkpoint"):
            known = numbers["counts"]
            demand(known.keys() == tables.keys() and all(map(is_count, known.values())), "the counts of rows")
            facts["granted"] = numbers["granted"]
            demand(is_count(facts["granted"]), "the steps of the run")
    archive = Archive(Path(given["store"]).absolute(), tables, attributes, facts["interval"], _asked(given), facts)
    with writing(archive.path):
        if numbers is None:
            archive.begin()
        elif not numbers.get("ended"):
            archive.go_on(numbers, arrays)
    return archive


def begin_again(archive, given):
    """Let another method begin at the start; the archive."""
    from ..files.formats import writing

    with writing(archive.path):
        archive.begin_again(_asked(given))
    return archive


def _asked(given):
    """What the checkpoints of a run say of its arguments: nothing where there are none."""
    numbers, arrays = ({}, {}) if given["checkpoint"] is None else request_of(given)
    return {"arguments": numbers}, arrays


GOES_ON = Status.INTERRUPTED, Status.STORE_FAILED, Status.MAX_STEPS  # of runs that can go on from their last checkpoint


def ended(archive, outcome, seconds, task):
    """The `Outcome` of a run whose outputs are in an archive; the checkpoint says that it has ended."""
    if isinstance(outcome.rows, np.ndarray):  # of a driver of a user's
        archive.add("outputs", outcome.rows)
    try:
        archive.flush()
        if archive.has_checkpoints and outcome.status not in GOES_ON:
            method = task.method, outcome.method or repr(task.method)
            provenance = provenance_of(archive.facts["scene"], *method, task.form.name, task.span, time.time())
            archive.checkpoint(*_ending(outcome, seconds, provenance))
    except OSError as error:
        outcome = outcome._replace(status=Status.STORE_FAILED, reason=f"{error.strerror or error}.")
    rows, steps, charts = _stored(archive)
    end = outcome.end
    end = RunEnd(end.reached, end.last, end.remembered, end.counts, steps, charts)
    return outcome._replace(rows=rows, end=end)


def call_to_go_on(archive):
    """The call of `resume` that goes on with a run; "" where there is no checkpoint."""
    from ..files.checkpoint import place

    if not any(path.exists() for path in place(archive.path)):
        return ""
    needs_scene = archive.facts["functions"] or "scene" not in archive.request[1]
    passed = {"scene": needs_scene, "events": archive.facts["events"]}
    return f"ts.resume({', '.join([repr(str(archive.path)), *(f'{name}={name}' for name in passed if passed[name])])})"


def _stored(archive):
    """Outputs, steps and charts of an archive."""
    from ..files.archive import StoredLog, StoredOutputs

    outputs = StoredOutputs(archive.path, archive.columns)
    return outputs, StoredLog.of(outputs, "steps"), StoredLog.of(outputs, "charts")


def _ending(outcome, seconds, provenance):
    """The numbers and arrays of a checkpoint at the end of a run."""
    end = outcome.end
    numbers = {"ended": True, "t": end.reached, "status": outcome.status, "reason": outcome.reason}
    numbers["method"] = outcome.method
    arrays = {"last": end.last, "remembered": end.remembered}
    if outcome.events is not None:
        numbers["watched"] = len(outcome.events[0])
        for name, found in zip(("t", "q", "qd"), outcome.events, strict=True):
            arrays |= {f"event {i}.{name}": array for i, array in enumerate(found)}
    return numbers | {"statistics": dict(end.counts), "seconds": seconds, "provenance": provenance}, arrays


def ended_outcome(numbers, arrays, archive, n, memory):
    """The `Outcome` of a run that had ended when its checkpoint was written; n coordinates, so many remembered numbers.

    Raises
    ------
    KeyError, TypeError, ValueError
        If they are none of such a run.
    """
    events, (last, remembered) = None, (arrays[name].astype(float) for name in ("last", "remembered"))
    if "watched" in numbers:
        events = tuple([arrays[f"event {i}.{name}"] for i in range(numbers["watched"])] for name in ("t", "q", "qd"))
        shapes = [[each.shape for each in found] for found in zip(*events, strict=True)]
        demand(all(found == [(found[0][0],), *[(found[0][0], n)] * 2] for found in shapes), "the events")
    demand(last.shape == (3, n) and remembered.shape == (memory,), "the end of the run")
    demand_numbers(numbers["statistics"], run_log.NAMES)
    demand_record(numbers, {"reason": str, "method": str, "seconds": (int, float)})
    rows, steps, charts = _stored(archive)
    end = RunEnd(float(numbers["t"]), last, remembered, numbers["statistics"], steps, charts)
    return Outcome(Status(numbers["status"]), numbers["reason"], rows, end, None, events, 0.0, numbers["method"])


def provenance_of(scene, method, said, formulation, span, made):
    """As of `Records.provenance`: of a run of a scene (its hash) by a method, which is called so, made at a time."""
    settings = {name: getattr(method, name, None) for name in SETTINGS}
    return {
        "source": f"tsdyn {__version__}",
        "scene": scene,
        "method": said,
        **{name: float(value) for name, value in settings.items() if isinstance(value, (int, float))},
        "formulation": formulation,
        "t_start": float(span[0]),
        "t_end": float(span[1]),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(made)),
        "machine": " ".join(machine()[:3]),
        "system": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def _here():
    """What bits depend on beside the run: versions and machine."""
    return {"version": __version__, "kernels": platform_hash(), "machine": machine()}


def demand_same_place(path, numbers):
    """Raise StorageError unless version and machine are those of the run."""
    here = _here()
    if any(numbers[name] != here[name] for name in ("version", "kernels")):
        raise StorageError(
            f"{path} was written by tsdyn {clipped(numbers['version'])}, and other versions of it, NumPy or Numba are "
            "here: the bits would differ. Go on there, or start a new run from the last output: simulate(state=...)."
        )
    if numbers["machine"] != here["machine"]:
        there = clipped(", ".join(map(str, numbers["machine"][:3])))
        raise StorageError(
            f"{path} was written on another machine ({there}): the bits would differ. Go on there, or start "
            "a new run from the last output: simulate(state=...)."
        )


def demand_same_scene(path, packed, known):
    """Raise StorageError unless a packed scene is that of a run, whose hash is known."""
    if hash_of(packed) != known:
        raise StorageError(
            f"{path}: the scene is another one than that of the run: its packed numbers differ. Pass it as it was run."
        )


def _demand_same_functions(path, facts, numbers):
    """Raise StorageError unless the functions are those of the run that is gone on with."""
    for kind in ("functions", "events"):
        known, found = numbers[kind], facts[kind]
        missing = [name for name in known if name not in found]
        if missing:
            raise StorageError(
                f"{path}: the run had {kind} that are missing here: {', '.join(missing)}. Pass the same."
            )
        other = [name for name in found if name not in known]
        if other:
            raise StorageError(f"{path}: the run had no such {kind}: {', '.join(other)}. Leave them out.")
        changed = [name for name, source in found.items() if source != known[name]]
        if changed:
            raise StorageError(f"{path}: the source of {', '.join(changed)} has changed since the run. Restore it.")


def _facts(given, kept):
    """What a checkpoint is compared by: version and machine, scene, functions."""
    events = given["events"]
    events = [] if events is None else [events] if callable(events) else list(events)
    functions = [function for _, several in user_functions(kept.packed) for function in several]
    functions += called_functions(kept.packed)
    return {
        **_here(),
        "scene": hash_of(kept.packed),
        "functions": sources_of(one for one in functions if not is_ours(getattr(one, "__module__", ""))),
        "events": sources_of(events),
        "max_steps": given["max_steps"],
        "interval": given["checkpoint"] if given["checkpoint"] is None else float(given["checkpoint"]),
    }


def hash_of(packed):
    """SHA-256 of the packed numbers, to the bit; without addresses."""
    bodies = zip(handles_of(packed).names, (body.dimension for body in packed.bodies), strict=False)
    digest = hashlib.sha256(repr([*bodies]).encode())
    reals = packed.system.reals.copy()
    reals[[load.law.address for load in packed.loads if load.law is not None and load.law.address >= 0]] = 0.0
    for name, array in packed.system._replace(reals=reals)._asdict().items():
        if not array.dtype.names:
            digest.update(f"{name} {array.shape} {array.dtype}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(repr([type(item).__qualname__ for item in packed.constraints]).encode())
    digest.update(repr([type(load.force).__qualname__ for load in packed.loads]).encode())
    for law in packed.laws:  # no row has these numbers
        digest.update(repr([*law.coefficients]).encode())
    return digest.hexdigest()


def sources_of(functions):
    """SHA-256 of the source of each function, by its name and place among the others."""
    found = {}
    for i, function in enumerate(functions):
        name = getattr(function, "__qualname__", type(function).__qualname__)
        plain = getattr(function, "py_func", function)
        try:
            text = inspect.getsource(plain if hasattr(plain, "__code__") else type(plain)).encode()
        except (OSError, TypeError):  # typed at a prompt
            code = getattr(plain, "__code__", None)
            text = b"" if code is None else code.co_code + repr(code.co_consts).encode()
        found[f"{name} ({i})"] = hashlib.sha256(text).hexdigest()
    return found


# Outlines of scenes in files: a scene without what only its owner can pass again, and what it leaves out.


class Lacking(StorageError):
    """A file alone doesn't give the scene."""


def width_of(packed):
    """How many numbers are remembered with each output: angles of joints, and what forces remember."""
    return handles_of(packed).count + packed.system.memory.size


def row_labels(packed):
    """Title and label of each row of Phi."""
    seen, of_contacts = {}, {id(law.contact): law.labels for law in packed.laws}
    for member in packed.members:
        title = member.constraint.title
        seen[title] = seen.get(title, 0) + 1
        again = "" if seen[title] == 1 else f" #{seen[title]}"
        labels = of_contacts.get(id(member.constraint)) or member.constraint.row_labels
        yield from ((title + again, label) for label in labels)


def outline_of(scene, packed):
    """Numbers and arrays of the outline of a scene; ({}, {}) where nothing is left out, or nothing else is there."""
    from ..files import scene_text  # what a plain run imports none of

    text, left = scene_text.write_outline(scene, type(scene))
    if not left or not text:
        return {}, {}
    angles = [row.item.name for row in handles_of(packed).rows for _ in row.angles]
    rows = [list(labels) for labels in row_labels(packed)]
    numbers = {"left_out": left, "angles": angles, "rows": rows, "width": width_of(packed)}
    return {"outline": numbers}, {"outline": np.frombuffer(text.encode(), np.uint8)}


def scene_of(known, text, why, kind):
    """The scene of the outline that numbers and a text (bytes, as an array) describe; `why` says what it lacks.

    Raises
    ------
    KeyError, TypeError or ValueError
        If they describe none.
    """
    from ..files import scene_text

    demand_record(known, {"left_out": list, "angles": list, "rows": list, "width": int})
    demand(0 <= len(known["angles"]) <= known["width"], "the angles of joints")
    demand(all(isinstance(word, str) for word in (*known["left_out"], *known["angles"])), "names")
    scene = scene_text.read(text.tobytes().decode(), "its outline", kind, None)[0]
    scene._lacks = f"{why} Without it there is no {', '.join(known['left_out'])}."
    return scene


def complete(found, known):
    """Let an `Outline` know which of the remembered numbers are angles of joints that are here, and its rows."""
    here = {row.item.name for row in found.handles.rows}
    found._columns = [i for i, name in enumerate(known["angles"]) if name in here]
    found._row_labels, found._width = [[str(title), str(label)] for title, label in known["rows"]], known["width"]
