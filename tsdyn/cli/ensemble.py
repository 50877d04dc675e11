"""The command `tsdyn ensemble`: many runs of a scene, with the parameters of its file or of a table."""

import time
from collections import Counter
from pathlib import Path

import numpy as np

from ..errors import InvalidArgument, Status
from .case_table import table_of
from .output import print_json, text_cell
from .run import add_json, add_method, add_output, add_plot, add_scene, destinations, options_of, progress_of
from .scene_file import load_document, robot_options

SHOWN, LOW, HIGH = 12, 0.05, 0.95  # coordinates in the summary; its quantiles
REASONS = 10  # failed cases that are listed


def add_ensemble_options(parser):
    """Add the options of `tsdyn ensemble` to its parser."""
    add_scene(parser)
    add_method(parser)
    parser.add_argument("--parameters", metavar="CSV", help="a table: a row a case, a column a parameter, "
                        'such as bob.mass or bob.velocity[2]; in place of [ensemble.parameters]')  # fmt: skip
    parser.add_argument("--cases", type=int, metavar="N", help="number of cases (default: that of the file)")
    parser.add_argument("--seed", type=int, metavar="N", help="of random parameters (default: that of the file, or 0)")
    parser.add_argument("--assemble", action="store_true", help="make each start consistent, by moving any body")
    parser.add_argument("--threads", type=int, metavar="N", help="threads (default: one a processor)")
    parser.add_argument("--store", metavar="PATH", help="stream results to .zarr or .h5, in constant memory")
    parser.add_argument("--resume", action="store_true", help="go on with the cases that are missing in the store")
    add_output(parser)
    add_plot(parser, "the first coordinate")
    add_json(parser)


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
    span, options = options_of(parsed, document.run)
    outputs, plot = destinations(parsed, document)
    if parsed.assemble:
        study["assemble"] = True
    began = time.perf_counter()
    found = ensemble(document.scene, study.pop("parameters"), span, threads=parsed.threads, store=parsed.store,
                     resume=parsed.resume, progress=progress_of(parsed), **study, **options)  # fmt: skip
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
    """Name, and quantiles over the cases, of each coordinate at its end."""
    last = found.q if found.q.ndim == 2 else found.q[:, -1]
    for name, column in zip(found.coordinates, last.T, strict=True):
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
