"""The formats of a store, by suffix.

A format is a module with a class `Store`, which has

    create(path, tables, attributes)           a new store, of `Table`s by name
    reopen(path, tables, attributes, counts, size)
                                               one to go on with, its tables cut to so many rows; its `size` was this
    write(start, rows)                         rows (k, ...) of a table from `start` on, by column; what follows is cut
    flush()                                    let readers see all of it
    sync()                                     bring all of it to the disk, for a crash
    close()

BUFFER, how many floats are gathered before they are written, and functions for stores that may still be written

    demand_plain(path, size=0)                 raises StorageError unless a store is such as this module writes: plain
                                               numbers within it, of sizes that it holds; a file has `size`
                                               bytes at least, as its checkpoint says
    read(path, column, part)                   a slice of a column
    count(path, columns)                       rows that all of these columns have
    shapes(path)                               of all columns of floats, by name
    demand_whole(path, columns, count)         raises StorageError unless so many rows can be read of each

and for what is written at once, beside the tables

    put(path, group, arrays)                   arrays by name, into a new group of a closed store
    get(path, group)                           the arrays of a group, by name; none where there is no such group
    attributes(path)                           what `create` was given

demand_plain comes first, before any function but `attributes` is asked about a file that others may have written.
"""

import contextlib
import math
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from ..errors import InvalidArgument, MissingDependency, StorageError
from ..validation import reason
from .write_errors import demand_folder, writing

HDF5, ZARR = (".h5", ".hdf5", ".nc"), (".zarr",)  # suffixes of paths
SUFFIXES = *HDF5, *ZARR
CHUNK, LONGEST = 1 << 15, 1 << 14  # floats of a chunk, and rows at most
ROOM = 1 << 20  # bytes that a column may have beyond those of its file while it is written, and of a file's head
NUMBERS = "<f8", "<i8", "|b1", "|u1"  # types of the arrays that files hold, by NumPy's names


class Column(NamedTuple):
    """An array of a table; its first dimension is the table's."""

    name: str
    dimensions: tuple  # names of the others
    attributes: dict  # units, long_name


class Table(NamedTuple):
    """Arrays that grow together."""

    dimension: str
    columns: tuple  # of Column
    labels: dict  # of the other dimensions: the names along each
    longest: int = LONGEST  # rows of a chunk at most

    def shapes(self, column):
        """The shapes of a column without rows, and of its chunks."""
        row = tuple(len(self.labels[dimension]) for dimension in column.dimensions)
        return (0, *row), (max(min(CHUNK // max(math.prod(row), 1), self.longest), 1), *row)


def demand_rows(path, column, found, count):
    """Raise StorageError if a column has fewer rows than were written."""
    if found < count:
        raise StorageError(f"{path}: {column} has {found} rows of {count} that were written.")


def demand_shapes(path, tables):
    """Raise StorageError unless a store has the columns of these tables, of their shapes but for the rows."""
    found = format_of(path).shapes(path)
    for column, shape in ((column, table.shapes(column)[0]) for table in tables.values() for column in table.columns):
        if not found.get(column.name) or found[column.name][1:] != shape[1:]:
            said = f"of the shape {found[column.name]}" if column.name in found else "not there"
            raise StorageError(f"{path} is damaged, or of another scene: {column.name} is {said}.")


@contextlib.contextmanager
def reading(path):
    """A block in which what can't be read is damaged: StorageError in place of a library's errors of many kinds."""
    try:
        yield
    except StorageError:
        raise
    except Exception as error:
        raise StorageError(f"{path} is damaged, or gone: {reason(error).rstrip('.')}.") from error


def format_of(path):
    """The module of a path's format, by its suffix; raises InvalidArgument or MissingDependency."""
    suffix = Path(path).suffix.lower()
    if suffix in HDF5:
        module, library = "hdf5", "h5py"
    elif suffix in ZARR:
        module, library = "zarr_folder", "zarr"
    else:
        raise InvalidArgument(f"store must end in .zarr, .h5, .hdf5 or .nc, which say its format, got {str(path)!r}.")
    try:
        import_module(library)
    except ImportError as error:
        raise MissingDependency(f"a store ending in {suffix} needs {library}: pip install 'tsdyn[data]'.") from error
    return import_module(f".{module}", __package__)


def demand_free(path):
    """Raise StorageError where there is something already, or no folder to write to."""
    path = Path(path)
    with writing(path):
        taken = path.exists()
    if taken:
        raise StorageError(f"{path} exists. Delete it, take another name, or go on with it: ts.resume({str(path)!r}).")
    demand_folder(path)
