"""Outputs of a run as labelled arrays and data frames, with the names and units of stores."""

import csv
from pathlib import Path

import numpy as np

from ..errors import MissingDependency, StorageError
from ..files.archive import COORDINATES, OUTPUTS, tables_of, units_of_level
from ..observables.channels import channels_of, values_of
from ..validation import text_cell
from .saved_solutions import labelled_rows, provenance
from .stored_runs import demand_path

ERRORS = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}
ENERGIES = ("kinetic_energy", "potential_energy", "energy")
INDEX, HEAD = "time", "time (s)"


def _columns(solution):
    """Arrays (k, ...) by name: (array, dimensions, attributes)."""
    table = tables_of(solution.packed.bodies, 0, False)[OUTPUTS]
    found = {
        column.name: (getattr(solution, column.name), (table.dimension, *column.dimensions), column.attributes)
        for column in table.columns[1:]
    }
    said = {"long_name": "Lagrange multipliers", "units": "N or N m, by row"}
    found["multipliers"] = solution.multipliers, (INDEX, "row"), said
    for level, unit in ERRORS.items():
        said = {"long_name": f"largest {level} constraint error", "units": unit}
        found[f"{level}_error"] = getattr(solution.constraint_error, level), (INDEX,), said
    for name in ENERGIES:
        found[name] = getattr(solution, name), (INDEX,), {"long_name": name.replace("_", " "), "units": "J"}
    return found, table


def _rows(solution):
    """Names of the rows of Phi as they were run."""
    return [f"{title}{label}" for title, label in labelled_rows(solution)]


def _library(name):
    try:
        return __import__(name)
    except ImportError as error:
        raise MissingDependency(f"this needs {name}: pip install 'tsdyn[data]'.") from error


def to_xarray(solution):
    """As of `Records.to_xarray`."""
    xarray = _library("xarray")
    found, table = _columns(solution)
    names = table.labels["coordinate"]
    time = table.columns[0]
    coordinates = {
        INDEX: (INDEX, solution.t, time.attributes),
        "coordinate": ("coordinate", names),
        "coordinate_units": ("coordinate", _units_of(names, "q")),
        "row": ("row", _rows(solution)),
    }
    data = {name: (dimensions, array, said) for name, (array, dimensions, said) in found.items()}
    return xarray.Dataset(data, coordinates, provenance(solution))


def _units_of(names, level):
    """The unit of each coordinate at a level."""
    lengths, numbers = units_of_level(level).split(" or ")
    return [lengths if name.rpartition(".")[2] in COORDINATES[:3] else numbers for name in names]


def table_of(solution):
    """Names (quantity, component) of columns, their units, and the columns as an array (k, columns)."""
    found, table = _columns(solution)
    labels = {"coordinate": table.labels["coordinate"], "row": _rows(solution)}
    columns, arrays, units = [], [], {}
    for name, (array, dimensions, said) in found.items():
        parts = labels[dimensions[1]] if len(dimensions) == 2 else [""]
        own = _units_of(parts, name) if dimensions[1:] == ("coordinate",) else [said["units"]] * len(parts)
        keys = [(name, part) for part in parts]
        columns += keys
        units |= dict(zip(keys, own, strict=True))
        arrays.append(array.reshape(len(array), len(parts)))
    return columns, units, np.concatenate(arrays, axis=1)


def to_dataframe(solution, channels):
    """As of `Records.to_dataframe`."""
    pandas = _library("pandas")
    index = pandas.Index(solution.t, name=HEAD)
    if channels is not None:
        some = channels_of(solution.packed, channels, solution._lacks)
        frame = pandas.DataFrame(values_of(solution, some), index, [one.title for one in some])
        units = {one.title: one.unit for one in some}
    else:
        columns, units, array = table_of(solution)
        frame = pandas.DataFrame(array, index, pandas.MultiIndex.from_tuples(columns))
    frame.attrs = {"units": units, **provenance(solution)}
    return frame


def to_csv(solution, path, channels):
    """What `Records.to_csv` does, and raises."""
    demand_path(path, "path")
    if channels is not None:
        some = channels_of(solution.packed, channels, solution._lacks)
        head, array = [one.title for one in some], values_of(solution, some)
    else:
        columns, units, array = table_of(solution)
        head = [f"{' '.join(filter(None, key))} ({units[key]})" for key in columns]
    try:
        with open(path, "w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow([HEAD, *map(text_cell, head)])
            rows.writerows([t, *row] for t, row in zip(solution.t.tolist(), array.tolist(), strict=True))
    except OSError as error:
        raise StorageError(f"{path} can't be written: {error.strerror}.") from error
    return Path(path)
