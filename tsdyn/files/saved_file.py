"""Files of whole solutions: the tables of a store, and a group with all that is no table; no code, no pickle.

The group has arrays by name. One of them, `record`, is JSON behind its SHA-256: numbers and words, and the SHA-256 of
every array and column of the file.
"""

import hashlib
import json
import os
import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np

from ..errors import InvalidArgument, StorageError
from ..validation import clipped, damaged
from .checkpoint import LONGEST
from .formats import SUFFIXES, demand_folder, format_of, unwritable, writing

FORMAT, VERSION = "tsdyn solution", 1
STORE = "store"  # what `simulate(store=...)` writes, which names no format
GROUP, RECORD = "run", "record"
ROWS = 1 << 14  # at a time


def format_at(path, what="a solution"):
    """The module of the format of a path; raises InvalidArgument or MissingDependency. `what` is to be saved."""
    if Path(path).suffix.lower() not in SUFFIXES:
        ends = f"{', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
        raise InvalidArgument(f"{what} is saved to a path that ends in {ends}, got {str(path)!r}.")
    return format_of(path)


def write(path, tables, rows_of, attributes, content, kind=FORMAT):
    """Write a file as a whole, in place of a saved solution that is there.

    Parameters
    ----------
    path : Path
    tables : dict
        As `archive.tables_of` makes them.
    rows_of : callable (table, start, count)
        Columns by name, (count, ...) each or fewer at the end.
    attributes : dict
    content : (dict, dict)
        Numbers for the record, arrays by name.
    kind : str
        What is saved: the format's name.

    Raises
    ------
    StorageError
        If there is something else at the path, or it can't be written.
    """
    form, (record, arrays) = format_at(path), content
    _demand_replaceable(path, form, kind)
    partial = path.with_name(f"{path.stem}-partial-{os.getpid()}{path.suffix}")
    try:
        store = form.Store.create(partial, tables, {"format": kind, "format_version": VERSION, **attributes})
        sums = {name: _write_table(store, name, rows_of) for name in tables}
        store.close()
        sums = {**{c: s for found in sums.values() for c, s in found.items()}, **_sums(arrays)}
        words = json.dumps({**record, "tables": _columns(tables), "sums": sums}).encode()
        form.put(partial, GROUP, {**arrays, RECORD: np.frombuffer(_sealed(words), np.uint8)})
        if path.is_dir():
            shutil.rmtree(path)
        os.replace(partial, path)
    except (OSError, RuntimeError) as error:
        shutil.rmtree(partial, ignore_errors=True)
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        if isinstance(error, StorageError):
            raise
        raise unwritable(path, error) from error


def _sealed(words):
    """Words behind their SHA-256."""
    return hashlib.sha256(words).hexdigest().encode() + words


def _unsealed(words):
    """The words behind a SHA-256; raises ValueError if it is another one."""
    if words != _sealed(words[64:]):
        raise ValueError("it has another checksum")
    return words[64:]


def _columns(tables):
    return {name: [column.name for column in table.columns] for name, table in tables.items()}


def _demand_replaceable(path, form, kind):
    """Raise StorageError unless a path is free, or that of a saved solution, or what `kind` says."""
    demand_folder(path)
    with writing(path):
        if not path.exists():
            return
    try:
        known = form.attributes(path).get("format") == kind
    except StorageError:
        known = False
    if not known:
        raise StorageError(
            f"{path} exists, and is no saved {kind.rpartition(' ')[2]}. Delete it, or take another name."
        )


def _write_table(store, name, rows_of):
    """Write the rows of a table; the SHA-256 of its columns."""
    sums, start = {}, 0
    while True:
        rows = {column: np.ascontiguousarray(values, float) for column, values in rows_of(name, start, ROWS).items()}
        count = len(next(iter(rows.values())))
        for column, values in rows.items():
            sums.setdefault(column, hashlib.sha256()).update(values.tobytes())
        if count:
            store.write(start, rows)
        if count < ROWS:
            return {column: digest.hexdigest() for column, digest in sums.items()}
        start += count


def _sums(arrays):
    return {name: hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest() for name, values in arrays.items()}


def kind_of(path):
    """What is saved at a path, by the name of its format; STORE, or "" if it doesn't say, or can't be read."""
    try:
        known = format_at(path).attributes(path) if path.exists() else {}
    except StorageError:
        return ""
    unsaid = STORE if str(known.get("source", "")).startswith("tsdyn") else ""
    return str(known.get("format", unsaid))


def read(path, kind=FORMAT):
    """The record and the arrays of a file, all its content checked; the columns of its tables are read when asked for.

    Raises
    ------
    StorageError
        If there is no such file, it is foreign, of a later version, or damaged.
    """
    form = format_at(path)
    if not path.exists():
        raise StorageError(f"there is no file {path}.")
    attributes = form.attributes(path)
    if attributes.get("format") != kind:
        raise StorageError(
            f"{path} is no saved {kind.rpartition(' ')[2]} of tsdyn: its attribute 'format' is another, or missing."
        )
    if attributes.get("format_version") != VERSION:
        version, source = attributes.get("format_version"), attributes.get("source", "another tsdyn")
        raise StorageError(
            f"{path} has the format {kind} {clipped(str(version))}, and this tsdyn reads {VERSION}: "
            f"{clipped(str(source))} has written it. Install that, or a later one."
        )
    form.demand_plain(path)
    arrays = form.get(path, GROUP)
    with damaged(path):
        words = arrays.pop(RECORD)
        if words.size > LONGEST:
            raise ValueError(f"its record has {words.size} bytes")
        record = json.loads(_unsealed(words.tobytes()))
        tables, sums = record["tables"], record["sums"]
        found = _sums(arrays) | {c: _sum_of(form, path, c) for columns in tables.values() for c in columns}
        wrong = [name for name in sums.keys() | found.keys() if sums.get(name) != found.get(name)]
    if wrong:
        names = clipped(", ".join(sorted(wrong)[:5]))
        raise StorageError(f"{path} is damaged: {names} has another checksum than when it was written.")
    return record, arrays


def _sum_of(form, path, column):
    """The SHA-256 of a column, read in parts."""
    digest, count = hashlib.sha256(), form.count(path, [column])
    for start in range(0, count, ROWS):
        digest.update(np.ascontiguousarray(form.read(path, column, slice(start, start + ROWS)), float).tobytes())
    return digest.hexdigest()
