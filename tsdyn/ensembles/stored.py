"""Results of an ensemble in a store: a row for each case, in the order of the cases, in constant memory.

Messages are beside the store, a line of JSON for each case that has one of its own.
"""

import hashlib
import json
import os
import shutil
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .. import validation
from .._version import __version__
from ..errors import Status, StorageError
from ..files.archive import READERS
from ..files.formats import Column, StoredTable, demand_shapes, demand_writable, format_of, writing
from ..simulation.stored_runs import demand_path, hash_of, sources_of
from ..validation import NO_LINKS, damaged
from .cases import TIMES, coordinate_names
from .executors import empty, fitted
from .tolerances import WAITING

GO_ON = "Free space there, and go on: resume=True.", "Mend that, and go on: resume=True."

CASE, DIGEST, PARAMETER = "case", "ensemble", "parameter "


class StoredResults:
    """A sink of chunks that writes them to a store, as `Collected` keeps them in memory.

    Parameters
    ----------
    study : Study
    path : str or PathLike
    resume : bool
        Whether to go on with what is there.
    """

    reason = ""

    def __init__(self, study, path, resume):
        demand_path(path, "store")
        self._format, self._store, self._table = format_of(path), None, None
        self.study, self.path = study, Path(path).absolute()
        self._said = self.path.with_name(f"{self.path.name}.messages")
        self._waiting, self._due = {}, time.perf_counter() + READERS
        with writing(self.path):
            taken = self.path.exists()
        if taken and not resume:
            raise StorageError(f"{self.path} exists. Delete it, take another name, or go on with it: resume=True.")
        self.first = self._found() if taken else 0
        if self.first < study.cases.count:
            demand_writable(self.path)
        if not self.first:  # a store of this ensemble may be there, without results
            for path in (self.path, self._said):
                _remove(path)

    def _found(self):
        """How many cases are in the store; raises StorageError if they are of another ensemble.

        Cases of a store without arrays of `keep` have all failed, and run again: the shapes are still to be known.
        """
        attributes = self._format.attributes(self.path)
        self._format.demand_plain(self.path)
        if attributes.get(DIGEST) != digest_of(self.study):
            raise StorageError(
                f"{self.path} is the store of another ensemble: scene, parameters, options or functions differ."
            )
        parameters = self.study.cases.part(slice(0, 1)).table
        demand_shapes(self.path, {CASE: table_of(self.study, parameters, {})})
        if callable(self.study.keep) and not any(map(_is_kept, self._format.shapes(self.path))):
            return 0
        count = self._format.count(self.path, [CASE, "status", "q", "qd"])
        if count == self.study.cases.count:  # others are read when the study is resumed
            names = [name for name in self._format.shapes(self.path) if _is_kept(name) or name.startswith(PARAMETER)]
            self._format.demand_whole(self.path, [CASE, "status", "reached", "q", "qd", *names], count)
        return count

    def __getstate__(self):
        """Leave out the format, a module."""
        return {**self.__dict__, "_format": None, "_store": None}

    def __setstate__(self, state):
        self.__dict__.update(state, _format=format_of(state["path"]))

    @property
    def is_full(self):
        """Whether many cases wait for one before them, which takes long."""
        return sum(chunk.count for chunk in self._waiting.values()) > WAITING

    def add(self, chunk):
        """Take over a chunk; it is written when all before it are."""
        if chunk.count and chunk.first >= self.first:
            self._waiting.setdefault(chunk.first, chunk)
        while self.first in self._waiting:
            ready = self._waiting[self.first]
            if self._store is None and not self._open(ready):
                return
            del self._waiting[self.first]
            self._write(fitted(ready, {column.name: self._table.shapes(column)[0][1:] for column in self._kept()}))
        if self._store is not None and time.perf_counter() > self._due:
            self._flush()

    def _kept(self):
        return [column for column in self._table.columns if _is_kept(column.name)]

    def _names(self):
        """What is kept in a store that is there."""
        return filter(_is_kept, self._format.shapes(self.path)) if self.first else ()

    def _open(self, chunk, last=False):
        """Make or open the store; False if the shapes of what is kept aren't known yet."""
        kept = {name: array for each in self._waiting.values() for name, array in each.arrays.items()}
        kept |= {name: self._format.read(self.path, name, slice(0, 1)) for name in self._names()}
        if callable(self.study.keep) and not any(map(_is_kept, kept)) and not last:  # all cases have failed so far
            return False
        parameters = self.study.cases.part(slice(chunk.first, chunk.first + 1)).table
        self._table = table_of(self.study, parameters, kept)
        attributes = {"source": f"tsdyn {__version__}", DIGEST: digest_of(self.study)}
        attributes |= {"cases": self.study.cases.count, "times": json.dumps(self.study.times.tolist())}
        make = self._format.Store
        with writing(self.path, GO_ON):
            if self.first:
                self._store = make.reopen(self.path, {CASE: self._table}, attributes, {CASE: self.first}, 0)
            else:
                self._store = make.create(self.path, {CASE: self._table}, attributes)
        return True

    def _write(self, chunk):
        end = chunk.first + chunk.count
        given = self.study.cases.part(slice(chunk.first, end)).table
        arrays = {"reached" if name == "t" else name: array for name, array in chunk.arrays.items()}
        arrays |= {"status": chunk.status} | {_column(name): np.asarray(array) for name, array in given.items()}
        rows = {}
        for column in (column for column in self._table.columns if column.name != CASE):
            shape = self._table.shapes(column)[0][1:]
            rows[column.name] = arrays.get(column.name, np.full((chunk.count, *shape), np.nan))
        rows[CASE] = np.arange(chunk.first, end, dtype=float)  # last, for readers who count by it
        with writing(self.path, GO_ON):
            self._store.write(chunk.first, rows)
            if chunk.messages:
                with open(self._said, "a", encoding="utf-8", opener=_unlinked) as file:
                    file.writelines(json.dumps([i, text]) + "\n" for i, text in sorted(chunk.messages.items()))
        self.first = end

    def _flush(self):
        with writing(self.path, GO_ON):
            self._store.flush()
        self._due = time.perf_counter() + READERS

    def close(self):
        """Bring everything to the store and close it; cases after one that is missing are left out."""
        if self._store is None and self.first in self._waiting:
            self._open(self._waiting[self.first], last=True)
            while self.first in self._waiting:
                self._write(self._waiting.pop(self.first))
        if self._store is not None:
            with writing(self.path, GO_ON):
                self._store.flush()
                self._store.close()
            self._store = None
        self._waiting = {}

    @property
    def status(self):
        """As of `Collected`."""
        return self.arrays["status"].astype(int)

    @property
    def messages(self):
        """As of `Collected`; of a case that was run twice the last."""
        if not self._said.exists():
            return {}
        with damaged(self._said):
            pairs = [json.loads(line) for line in validation.read(self._said, flags=NO_LINKS).splitlines()]
            if not all(type(i) is int and isinstance(said, str) for i, said in pairs):
                raise ValueError("a line is no number of a case and its message")
            return dict(pairs)

    @property
    def arrays(self):
        """As of `Collected`, read when they are asked for."""
        return _StoredArrays(self)


class _StoredArrays(Mapping):
    """Arrays by name, those of cases that are missing NaN, or NOT_RUN."""

    def __init__(self, results):
        self.results = results

    def __getitem__(self, name):
        results = self.results
        column = "reached" if name == "t" else name
        total, found = results.study.cases.count, None
        if results.first:
            found = results._format.read(results.path, column, slice(0, results.first))
        elif column in ("reached", "q", "qd"):
            found = empty(results.study, 0)[name]
        missing = float(Status.NOT_RUN) if name == "status" else np.nan
        found = np.zeros(0) if found is None else found
        return np.concatenate((found, np.full((total - len(found), *found.shape[1:]), missing)))

    def __iter__(self):
        names = ("t", "q", "qd")
        results = self.results
        kept = results._names() if results._table is None else [column.name for column in results._kept()]
        return iter(dict.fromkeys((*names, *kept)))

    def __len__(self):
        return len([*iter(self)])


def table_of(study, parameters, kept):
    """The `StoredTable` of a store: parameters by name with one case each, what is kept with any number of them."""
    labels, grid = {"coordinate": coordinate_names(study.family.packed.bodies)}, ()
    if study.keep == TIMES:
        labels["time"], grid = [repr(t) for t in study.times.tolist()], ("time",)
    columns = [Column(CASE, (), {"long_name": "case", "units": "1"})]
    columns += [
        Column("status", (), _said("number of the Status", "1")),
        Column("reached", (), _said("time reached", "s")),
    ]
    for name, units in (("q", "m or 1"), ("qd", "m/s or 1/s")):
        columns.append(Column(name, (*grid, "coordinate"), _said(name, units)))
    others = [(_column(name), array, study.family.fields[name].unit) for name, array in parameters.items()
              if np.asarray(array).dtype.kind in "iuf"]  # fmt: skip
    own = getattr(study.keep, "units", {})
    others += [(name, array, own.get(name.removeprefix("kept "), "")) for name, array in kept.items() if _is_kept(name)]
    for name, array, units in others:
        dimensions = tuple(f"axis {i} of {name}" for i in range(np.ndim(array) - 1))
        labels |= {each: [str(i) for i in range(size)] for each, size in zip(dimensions, array.shape[1:], strict=True)}
        columns.append(Column(name, dimensions, _said(name, units)))
    return StoredTable(CASE, tuple(columns), labels)


def _unlinked(path, flags):
    """Open a file, but not what a link leads to."""
    return os.open(path, flags | NO_LINKS, 0o666)


def _remove(path):
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _is_kept(name):
    """Whether an array is what a function `keep` returned."""
    return name.startswith("kept")


def _said(text, units):
    return {"long_name": text, "units": units}


def _column(name):
    """The name of a parameter's column; a slash would make a group of it."""
    return f"{PARAMETER}{name}".replace("/", "|")


def digest_of(study):
    """SHA-256 of all that the results depend on: scene, cases, options, functions."""
    digest, given = hashlib.sha256(hash_of(study.family.packed).encode()), study.given
    digest.update(np.concatenate(study.family.start).tobytes() + repr(sorted(study.changes)).encode())
    cases = study.cases
    if cases.names is None:
        digest.update(repr((cases.count, sources_of([cases.function]))).encode())
    else:
        for name, array in sorted(cases.table.items()):
            array = np.asarray(array)
            digest.update(f"{name} {array.shape}".encode() + (array.tobytes() if array.dtype.kind in "iuf" else b""))
    events = given["events"]
    functions = [] if events is None else [events] if callable(events) else list(events)
    named = study.keep if isinstance(study.keep, str) else repr(study.keep) if hasattr(study.keep, "units") else ""
    functions += [] if named else [study.keep]
    plain = {name: repr(value) for name, value in given.items() if name not in ("scene", "events", "t_eval", "state")}
    digest.update(repr((sorted(plain.items()), sources_of(functions), named)).encode())
    digest.update(study.times.tobytes() + (f"{study.lanes} lanes".encode() if study.lanes > 1 else b""))
    digest.update(b"" if study.free is None else repr(study.free).encode())
    state = given["state"]
    digest.update(b"" if state is None else np.asarray(state.q).tobytes() + np.asarray(state.qd).tobytes())
    return digest.hexdigest()
