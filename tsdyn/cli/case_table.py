"""The table of `tsdyn ensemble --parameters`: a CSV file with a row for each case, a column for each number."""

import csv
import io
import math
import re

import numpy as np

from .. import regular_files
from ..errors import InvalidArgument
from ..validation import counted, unknown_parameter

LARGEST = 1 << 28  # bytes of a table
_INDEXED = re.compile(r"(.*)\[([^\[\]]*)\]")  # bob.velocity[2]; bodies may have names such as link[3]


def table_of(path, scene):
    """Parameters of a CSV file: name -> array (cases, ...); components without a column are those of the scene.

    Raises
    ------
    InvalidArgument
        If the file can't be read, a column stands for nothing in the scene, or a cell is no finite number.
    """
    from ..parameters.fields import fields_of

    (line, head), *rows = _lines(path)
    fields, where = fields_of(scene), f"{path}, line {line}"
    columns = _columns(where, head, fields)
    cells = np.array([_numbers(f"{path}, line {line}", head, row) for line, row in rows])
    return {name: _values(where, name, fields[name], at, cells) for name, at in columns.items()}


def _lines(path):
    """Line number and cells of each row that is not blank."""
    try:
        reader = csv.reader(io.StringIO(regular_files.read(path, LARGEST).decode("utf-8-sig"), newline=""))
        found = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if row]
    except (UnicodeError, csv.Error) as error:
        raise InvalidArgument(f"{path} can't be read: {getattr(error, 'strerror', None) or error}.") from error
    if len(found) < 2:
        raise InvalidArgument(f"{path} must have a row of names, and below it a row of numbers for each case.")
    return found


def _columns(where, head, fields):
    """Name -> {index of a component, or None: column, from 0}."""
    found = {}
    for j, word in enumerate(head):
        name, index = _meant(f"{where}, column {j + 1}", word, fields)
        at = found.setdefault(name, {})
        if index in at:
            raise InvalidArgument(f"{where}, column {j + 1}: {word} is column {at[index] + 1} already; remove one.")
        at[index] = j
    return found


def _meant(where, word, fields):
    """The parameter that a column stands for, and the index of the component; None for a number."""
    word = word if word in fields else word.removeprefix("'")  # as `output.text_cell` writes it
    match = None if word in fields else _INDEXED.fullmatch(word)
    name, index = match.groups() if match else (word, None)
    if not word:
        raise InvalidArgument(f"{where} has no name; write that of a parameter, or remove the column.")
    if name not in fields:
        raise InvalidArgument(f"{where}: the scene has no parameter {name!r}{unknown_parameter(name, fields)}")
    own = _own(where, name, fields[name])
    if own is None:
        if index is not None:
            mend = f"write {name}, not {word}" if fields[name].is_numeric else "give it numbers there to vary one"
            raise InvalidArgument(f"{where}: {name} has no components in the scene; {mend}.")
        return name, None
    indices = {str(i): i for i in range(own.size)}
    if index is None or index.strip() not in indices:
        fault = "" if index is None else f", and no {word}"
        raise InvalidArgument(f"{where}: {name} has {counted(own.size, 'component')}{fault}; write {_all(name, own)}.")
    return name, indices[index.strip()]


def _own(where, name, field):
    """Components in the scene, principal values of an inertia; None of a number or a function."""
    value = np.asarray(field.value) if field.is_numeric else np.empty(())
    if value.ndim > 2 or (value.ndim == 2 and value.shape[0] != value.shape[1]):
        raise InvalidArgument(
            f"{where}: {name} is an array of shape {value.shape}, which columns can't name; give it in "
            "[ensemble.parameters]."
        )
    return None if value.ndim == 0 else np.diag(value) if value.ndim == 2 else value


def _all(name, own):
    return f"{name}[0]" if own.size == 1 else f"{name}[0] to {name}[{own.size - 1}], a column each"


def _numbers(where, head, row):
    """The numbers of a row, one for each column."""
    if len(row) < len(head):
        raise InvalidArgument(
            f"{where} has {counted(len(row), 'cell')} for {counted(len(head), 'column')}: {head[len(row)]} (column "
            f"{len(row) + 1}) has none; write a number."
        )
    if len(row) > len(head):
        raise InvalidArgument(
            f"{where} has {counted(len(row), 'cell')} for {counted(len(head), 'column')}; remove what follows "
            f"{head[-1]} (column {len(head)}), or name its column. Decimals have a point."
        )
    return [_number(f"{where}, column {j + 1} ({head[j]})", word) for j, word in enumerate(row)]


def _number(where, word):
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        fault = f"{word!r} is no finite number" if word else "the cell is empty"
        raise InvalidArgument(f"{where}: {fault}; write one such as 0.5.")
    return value


def _values(where, name, field, at, cells):
    """Values of a parameter, one a case: (cases,) or (cases, components); `at`: where its columns are."""
    if None in at:
        return cells[:, at[None]]
    own = _own(where, name, field)
    present = np.asarray(field.value)
    if present.ndim == 2 and len(at) < own.size and (present != np.diag(own)).any():
        raise InvalidArgument(f"{where}: {name} is no diagonal matrix in the scene; write {_all(name, own)}.")
    found = np.tile(own, (len(cells), 1))
    found[:, list(at)] = cells[:, list(at.values())]
    if present.ndim == 2 and found.shape == present.shape and (found == found.T).all():
        return np.stack([np.diag(row) for row in found])  # else they might be one matrix, and are refused
    return found
