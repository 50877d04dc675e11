"""The formats of a store, by suffix; what is said where a file can't be written."""

import contextlib
import errno
import math
import os
import re
import tempfile
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from ..errors import InvalidArgument, MissingDependency, StorageError
from ..validation import reason

# What is said where a file can't be written: path, reason and remedy, without the words of a library.

FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
NO_FOLDER = (errno.ENOENT, errno.ENOTDIR)
ELSEWHERE = "Free space there, or take another path.", "Take another path."  # where a disk is full, and else


def code_of(error):
    """The errno of an error, which HDF5 has in its text; None if there is none."""
    found = re.search(r"errno = (\d+)", str(error))
    return int(found[1]) if found else getattr(error, "errno", None)


def reason_of(error):
    """What the system says, or else what the library says before its parentheses."""
    code = code_of(error)
    return os.strerror(code) if code else f"{type(error).__name__}: {str(error).partition(' (')[0]}"


def unwritable(path, error, remedies=ELSEWHERE):
    """The StorageError of a path that can't be written; remedies: where the disk is full, and where none is known."""
    reason, code, path = reason_of(error), code_of(error), Path(path)
    remedy = remedies[code not in FULL]
    if code in NO_FOLDER:
        with contextlib.suppress(StorageError):
            demand_folder(path)
            reason = f"no file can be made in {path.parent} ({reason})"
    if code in FORBIDDEN and not os.path.exists(path):  # False, too, where the folder can't be searched
        reason = f"the folder {path.parent} can't be written to ({reason})"
    if code in FORBIDDEN:
        remedy = "Take another path, or change the permissions."
    elif code == errno.ENAMETOOLONG:
        remedy = "Take a shorter name."
    return StorageError(f"{path} can't be written: {reason}. {remedy}")


def demand_folder(path):
    """Raise StorageError unless the folder that a path is in exists."""
    path = Path(path)
    with writing(path):
        if path.parent.is_dir():
            return
        in_the_way = next((each for each in path.parents if each.exists()), path.parent)
        is_folder = in_the_way.is_dir()
    if is_folder:
        raise StorageError(f"there is no folder {path.parent} to write {path.name} to. Make it, or take another path.")
    raise StorageError(f"{path.name} can't be written to {path.parent}: {in_the_way} is a file. Take another path.")


def demand_writable(path):
    """Raise StorageError unless files can be made in the folder that a path is in."""
    demand_folder(path)
    with writing(path), tempfile.NamedTemporaryFile(dir=Path(path).parent):
        pass


@contextlib.contextmanager
def writing(path, remedies=ELSEWHERE):
    """A block in which an OSError is that of writing a path."""
    try:
        yield
    except StorageError:
        raise
    except OSError as error:
        raise unwritable(path, error, remedies) from error


# The formats of a store, by suffix.
#
# A format is a module with a class `Store`, which has
#
#   create(path, tables, attributes)           a new store, of `StoredTable`s by name
#   reopen(path, tables, attributes, counts, size)
#                                              one to go on with, its tables cut to so many rows; its `size` was this
#   write(start, rows)                         rows (k, ...) of a table from `start` on, by column; what follows is cut
#   flush()                                    let readers see all of it
#   sync()                                     bring all of it to the disk, for a crash
#   close()
#
# BUFFER, how many floats are gathered before they are written, and functions for stores that may still be written
#
#     demand_plain(path, size=0)                 raises StorageError unless a store is such as this module writes: plain
#                                                numbers within it, of sizes that it holds; a file has `size`
#                                                bytes at least, as its checkpoint says
#     read(path, column, part)                   a slice of a column
#     count(path, columns)                       rows that all of these columns have
#     shapes(path)                               of all columns of floats, by name
#     demand_whole(path, columns, count)         raises StorageError unless so many rows can be read of each
#
# and for what is written at once, beside the tables
#
#     put(path, group, arrays)                   arrays by name, into a new group of a closed store
#     get(path, group)                           the arrays of a group, by name; none where there is no such group
#     attributes(path)                           what `create` was given
#
# demand_plain comes first, before any function but `attributes` is asked about a file that others may have written.

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


class StoredTable(NamedTuple):
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
        raise StorageError(f"{path} is damaged: {column} has {found} rows, and {count} were written.")


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
