"""Runs with a store: its archive, what a checkpoint holds beside the state, how a run ends in it."""

from __future__ import annotations

import hashlib
import inspect
import os
import platform
import time
from pathlib import Path

import numpy as np

from .._version import __version__
from ..errors import InvalidArgument, Status, StorageError
from ..jit.cache import machine
from ..jit.code_hash import platform_hash
from ..model.packed import user_functions
from ..runs import counts
from ..runs.run_end import RunEnd
from ..runs.task import Outcome
from ..validation import clipped, damaged, demand, demand_numbers, demand_record, is_count, number
from .run_requests import request_of

SETTINGS = ("rtol", "atol", "step", "max_step")  # of a method, as its provenance tells them


def demand_storable(call, options):
    """Raise InvalidArgument or StorageError unless a store can be made as a `RunCall` with `RunOptions` asks for."""
    path, interval = call.store, call.checkpoint
    if path is None:
        raise InvalidArgument("checkpoint needs a store, which it goes on with: simulate(..., store='run.h5').")
    from ..storage.formats import demand_free, format_of

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
        raise InvalidArgument(f"{name} must be a path such as 'run.zarr' or 'run.h5', got {path!r}.")


def archive_of(given, kept, history, numbers, arrays):
    """The `Archive` of a run, made or, with the numbers and arrays of a checkpoint, gone on with."""
    from ..storage.archive import Archive, tables_of
    from ..storage.formats import demand_shapes, format_of
    from ..storage.write_errors import writing

    facts = _facts(given, kept)
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
    archive = Archive(Path(given["store"]).absolute(), tables, attributes, facts["interval"], _asked(given), facts)
    with writing(archive.path):
        if numbers is None:
            archive.begin()
        elif not numbers.get("ended"):
            archive.go_on(numbers, arrays)
    return archive


def begin_again(archive, given):
    """Let another method begin at the start; the archive."""
    from ..storage.write_errors import writing

    with writing(archive.path):
        archive.begin_again(_asked(given))
    return archive


def _asked(given):
    """What the checkpoints of a run say of its arguments: nothing where there are none."""
    numbers, arrays = ({}, {}) if given["checkpoint"] is None else request_of(given)
    return {"arguments": numbers}, arrays


def ended(archive, outcome, seconds, task):
    """The `Outcome` of a run whose outputs are in an archive; the checkpoint says that it has ended."""
    if isinstance(outcome.rows, np.ndarray):  # of a driver of a user's
        archive.add("outputs", outcome.rows)
    try:
        archive.flush()
        if archive.has_checkpoints and outcome.status not in (Status.INTERRUPTED, Status.STORE_FAILED):
            method = task.method, outcome.method or repr(task.method)
            told = provenance_of(archive.facts["scene"], *method, task.form.name, task.span, time.time())
            archive.checkpoint(*_ending(outcome, seconds, told))
    except OSError as error:
        outcome = outcome._replace(status=Status.STORE_FAILED, reason=f"{error.strerror or error}.")
    rows, steps, charts = _stored(archive)
    end = outcome.end
    end = RunEnd(end.reached, end.last, end.remembered, end.counts, steps, charts)
    return outcome._replace(rows=rows, end=end)


def call_to_go_on(archive):
    """The call of `resume` that goes on with a run; "" where there is no checkpoint."""
    from ..storage.checkpoint import place

    if not any(path.exists() for path in place(archive.path)):
        return ""
    needs_scene = archive.facts["functions"] or "scene" not in archive.request[1]
    passed = {"scene": needs_scene, "events": archive.facts["events"]}
    return f"ts.resume({', '.join([repr(str(archive.path)), *(f'{name}={name}' for name in passed if passed[name])])})"


def _stored(archive):
    """Outputs, steps and charts of an archive."""
    from ..storage.stored_outputs import StoredLog, StoredOutputs

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
    demand_numbers(numbers["statistics"], counts.NAMES)
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
            "here: the bits would differ. Go on there, or start anew from the last output: simulate(state=...)."
        )
    if numbers["machine"] != here["machine"]:
        there = clipped(", ".join(map(str, numbers["machine"][:3])))
        raise StorageError(
            f"{path} was written on another machine ({there}): the bits would differ. Go on there, or start "
            "anew from the last output: simulate(state=...)."
        )


def demand_same_scene(path, packed, known):
    """Raise StorageError unless a packed scene is that of a run, whose hash is known."""
    if hash_of(packed) != known:
        raise StorageError(f"{path}: the scene is another one than that of the run: its packed numbers differ.")


def _demand_same_functions(path, facts, numbers):
    """Raise StorageError unless the functions are those of the run that is gone on with."""
    for kind in ("functions", "events"):
        known, found = numbers[kind], facts[kind]
        missing = [name for name in known if name not in found]
        if missing:
            raise StorageError(f"{path}: the run had {kind} that are missing here: {', '.join(missing)}.")
        other = [name for name in found if name not in known]
        if other:
            raise StorageError(f"{path}: the run had no such {kind}: {', '.join(other)}.")
        changed = [name for name, source in found.items() if source != known[name]]
        if changed:
            raise StorageError(f"{path}: the source of {', '.join(changed)} has changed since the run.")


def _facts(given, kept):
    """What a checkpoint is compared by: version and machine, scene, functions."""
    events = given["events"]
    events = [] if events is None else [events] if callable(events) else list(events)
    functions = [function for _, several in user_functions(kept.packed) for function in several]
    functions += [load.force.function for load in kept.packed.loads if getattr(load.force, "period", None) is not None]
    return {
        **_here(),
        "scene": hash_of(kept.packed),
        "functions": sources_of(functions),
        "events": sources_of(events),
        "interval": given["checkpoint"] if given["checkpoint"] is None else float(given["checkpoint"]),
    }


def hash_of(packed):
    """SHA-256 of the packed numbers, to the bit; without addresses."""
    digest = hashlib.sha256(repr([(body.name, body.dimension) for body in packed.bodies]).encode())
    for name, array in packed.system._asdict().items():
        if not array.dtype.names:
            digest.update(f"{name} {array.shape} {array.dtype}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(repr([type(item).__qualname__ for item in packed.constraints]).encode())
    digest.update(repr([type(load.force).__qualname__ for load in packed.loads]).encode())
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
