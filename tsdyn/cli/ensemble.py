"""The command `tsdyn ensemble`: many runs of a scene, with the parameters of its file or of a table."""

import csv
import io
import math
import re
import time
from collections import Counter
from pathlib import Path

import numpy as np

from .. import validation
from ..errors import InvalidArgument, Status
from ..validation import counted, text_cell, unknown_parameter
from . import run
from .parser import load_document, print_json, robot_options

# The table of `tsdyn ensemble --parameters`: a CSV file with a row for each case, a column for each number.

LARGEST = 1 << 28  # bytes of a table
_INDEXED = re.compile(r"(.*)\[([^\[\]]*)\]")  # bob.velocity[2]; bodies may have names such as link[3]


def table_of(path, scene):
    """Parameters of a CSV file: name -> array (cases, ...); components without a column are those of the scene.

    Raises
    ------
    InvalidArgument
        If the file can't be read, a column stands for nothing in the scene, or a cell is no finite number.
    """
    from ..simulation.parameters import fields_of

    (line, head), *rows = _lines(path)
    fields, where = fields_of(scene), f"{path}, line {line}"
    columns = _columns(where, head, fields)
    cells = np.array([_numbers(f"{path}, line {line}", head, row) for line, row in rows])
    return {name: _values(where, name, fields[name], at, cells) for name, at in columns.items()}


def _lines(path):
    """Line number and cells of each row that is not blank."""
    try:
        reader = csv.reader(io.StringIO(validation.read(path, LARGEST).decode("utf-8-sig"), newline=""))
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
    word = word if word in fields else word.removeprefix("'")  # as `text_cell` writes it
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


SHOWN, LOW, HIGH = 12, 0.05, 0.95  # coordinates in the summary; its quantiles
REASONS = 10  # failed cases that are listed


def add_ensemble_options(parser):
    """Add the options of `tsdyn ensemble` to its parser."""
    run.add_scene(parser)
    run.add_method(parser)
    parser.add_argument("--parameters", metavar="CSV", help="a table: a row a case, a column a parameter, "
                        'such as bob.mass or bob.velocity[2]; in place of [ensemble.parameters]')  # fmt: skip
    parser.add_argument("--cases", type=int, metavar="N", help="number of cases (default: that of the file)")
    parser.add_argument("--seed", type=int, metavar="N", help="of random parameters (default: that of the file, or 0)")
    parser.add_argument("--assemble", action="store_true", help="make each start consistent, by moving any body")
    parser.add_argument("--threads", type=int, metavar="N", help="threads (default: one a processor)")
    parser.add_argument("--store", metavar="PATH", help="stream results to .zarr or .h5, in constant memory")
    parser.add_argument("--resume", action="store_true", help="go on with the cases that are missing in the store")
    run.add_output(parser)
    run.add_plot(parser, "the first channel or coordinate")
    run.add_channels(parser)


def _ensemble(parsed):
    """Run a scene many times, with other parameters each time.

    What varies says the table [ensemble] of the file, or a table of numbers. The exit code is 0 only if every case
    reached its end.
    """
    from ..ensembles.ensemble import ensemble

    document = load_document(
        parsed.scene, parsed.allow_code, {"cases": parsed.cases, "seed": parsed.seed}, robot_options(parsed)
    )
    if parsed.parameters is None:
        study = dict(document.ensemble)
    else:
        study = {"parameters": table_of(parsed.parameters, document.scene), "cases": parsed.cases}
    if not study:
        raise InvalidArgument(
            f"{parsed.scene} has no table [ensemble], which says what differs from case to case; write one "
            "(tsdyn new shows how), or give --parameters cases.csv."
        )
    span, options = run.options_of(parsed, document.run)
    outputs, plot = run.destinations(parsed, document)
    if run.channels_asked(parsed):
        study["keep"] = run.channels_asked(parsed)
    if study.get("keep", "final") == "final":
        if parsed.every is None:
            options.pop("t_eval", None)  # that of the file is for single runs
        else:
            study["keep"] = "t_eval"
    if parsed.assemble:
        study["assemble"] = True
    began = time.perf_counter()
    found = ensemble(document.scene, study.pop("parameters"), span, threads=parsed.threads, store=parsed.store,
                     resume=parsed.resume, progress=run.progress_of(parsed), **study, **options)  # fmt: skip
    seconds = time.perf_counter() - began
    written = [str(write(found, path)) for path in outputs] + ([str(_draw(found, plot))] if plot else [])
    if parsed.json:
        print_json({**facts(found), "seconds": seconds, "written": written})
    else:
        rate = f"  {len(found)} cases in {seconds:.3g} s, {len(found) / max(seconds, 1e-9):.4g} a second"
        lines = [repr(found), rate, *table_lines(found), *(f"  written   {path}" for path in written)]
        print("\n".join(lines))
    return 0 if found.success.all() else 1


def write(found, path):
    """Write an ensemble to a file, in the format of its suffix; the path."""
    if Path(path).suffix.lower() != ".csv":
        return found.save(path)
    try:
        frame = found.to_dataframe().rename(columns=text_cell)
        words = [name for name in frame if frame[name].dtype == object or str(frame[name].dtype).startswith("str")]
        frame.assign(**{name: frame[name].map(text_cell) for name in words}).to_csv(path)
    except OSError as error:
        raise InvalidArgument(f"{path} can't be written: {error.strerror}.") from error
    return path


def _draw(found, path):
    from matplotlib import pyplot

    pyplot.switch_backend("agg")
    found.plot(path=path)
    pyplot.close("all")
    return path


def facts(found):
    """Figures of an ensemble, for JSON."""
    counts = Counter(found.status.tolist())
    return {
        "success": bool(found.success.all()),
        "cases": len(found),
        "ended": {Status(code).name.lower(): many for code, many in sorted(counts.items())},
        "failed": [[int(i), found.message[i]] for i in np.flatnonzero(~found.success)[:REASONS]],
        "threads": found.threads,
        "lanes": found.lanes,
        "parameters": {name: list(np.shape(values)) for name, values in found.parameters.items()},
        "final": {name: dict(zip(("5 %", "50 %", "95 %"), values, strict=True)) for name, *values in _quantiles(found)},
    }


def _quantiles(found):
    """Name, and quantiles over the cases at their end, of each channel that is kept, else of each coordinate."""
    last = found.q if found.q.ndim == 2 else found.q[:, -1]
    columns = dict(zip(found.coordinates, last.T, strict=True))
    if found._channels:
        columns = {f"{name} ({found.unit(name)})": x if x.ndim == 1 else x[:, -1] for name, x in found.kept.items()}
    for name, column in columns.items():
        known = column[np.isfinite(column)]
        yield (name, *(np.quantile(known, (LOW, 0.5, HIGH)).tolist() if known.size else [np.nan] * 3))


def table_lines(found):
    """Quantiles and failures, for people."""
    rows, lines = list(_quantiles(found)), [f"  {'at the end':20} {'5 %':>12} {'median':>12} {'95 %':>12}"]
    lines += [f"  {name:20} {low:12.6g} {middle:12.6g} {high:12.6g}" for name, low, middle, high in rows[:SHOWN]]
    if len(rows) > SHOWN:
        lines.append(f"  and {len(rows) - SHOWN} coordinates more")
    failed = np.flatnonzero(~found.success)
    lines += [f"  case {i}: {found.message[i]}" for i in failed[:REASONS]]
    return [*lines, f"  and {failed.size - REASONS} cases more"] if failed.size > REASONS else lines
