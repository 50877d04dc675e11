"""Stores in HDF5: written so that others can read meanwhile (SWMR), with the dimensions that netCDF and xarray know.

HDF5 doesn't survive a write that fails: closing the file fails, too, and the process may crash at its end. There must
be room before anything is written. Where a write fails all the same (a quota), what HDF5 still writes goes nowhere.
"""

import contextlib
import errno
import os
import shutil
from pathlib import Path

import h5py
import numpy as np

from ..errors import StorageError
from .formats import CHUNK, LONGEST, demand_rows, reading
from .write_errors import code_of

BUFFER = CHUNK
COPIED = 1 << 16  # rows at a time
FLAGS = 11  # offset of the flags of file consistency in the superblock
CACHE = 1 << 19  # bytes of each array that are kept in memory


class Store:
    """A file that is being written; see formats.py."""

    def __init__(self, path, file, tables):
        self._path, self._file = path, file
        self._arrays, self._room = dict(file.items()), _room_of(tables)
        file.swmr_mode = True

    @classmethod
    def create(cls, path, tables, attributes):
        """As formats.py says."""
        _demand_room(path, _room_of(tables))
        return cls(path, _laid_out(path, tables, attributes), tables)

    @property
    def size(self):
        """As formats.py says."""
        return os.path.getsize(self._path)

    @classmethod
    def reopen(cls, path, tables, attributes, counts, size):
        """As formats.py says; a copy takes the place of the file, which a killed process may have left half-written."""
        found = os.path.getsize(path) if os.path.exists(path) else 0
        if found < size:  # HDF5 would wait for the missing part for ever
            raise StorageError(f"{path} is damaged: it has {found} bytes of {size} that were written.")
        partial = Path(path).with_name(f"{Path(path).name}-partial")
        partial.unlink(missing_ok=True)
        _demand_room(partial, found + _room_of(tables))
        file = _laid_out(partial, tables, attributes)
        with _opened(path) as old:
            for name, table in tables.items():
                for column in table.columns:
                    _copy(old[column.name], file[column.name], counts[name])
        file.flush()
        if os.path.getsize(partial) < size:  # of the checkpoint, from which another process may have to go on
            os.truncate(partial, size)
        _sync(partial)
        os.replace(partial, path)
        return cls(path, file, tables)

    def write(self, start, rows):
        """As formats.py says."""
        _demand_room(self._path, sum(values.nbytes for values in rows.values()) + self._room)
        with self._failing():
            for column, values in rows.items():
                array, end = self._arrays[column], start + len(values)
                array.resize(end, axis=0)
                array[start:end] = values

    def flush(self):
        """As formats.py says."""
        with self._failing():
            self._file.flush()

    def sync(self):
        """As formats.py says."""
        self.flush()
        _sync(self._path)

    def close(self):
        """Close the file."""
        with self._failing():
            self._file.close()

    @contextlib.contextmanager
    def _failing(self):
        """A block in which a write may fail: OSError, and what HDF5 writes from then on goes nowhere."""
        try:
            yield
        except (OSError, RuntimeError) as error:  # h5py raises both
            if os.name == "posix":
                with open(os.devnull, "r+b") as nowhere:
                    os.dup2(nowhere.fileno(), self._file.id.get_vfd_handle())
            code = code_of(error)
            raise (OSError(code, os.strerror(code)) if code else OSError(str(error))) from error


def _room_of(tables):
    """Bytes of a chunk more of each column, and of HDF5's own tables."""
    return 8 * CHUNK * (1 + sum(len(table.columns) + len(table.labels) for table in tables.values()))


def _demand_room(path, needed):
    """Raise OSError unless a file may grow by so many bytes."""
    folder = os.path.dirname(os.path.abspath(path))
    if shutil.disk_usage(folder).free < needed:
        raise OSError(errno.ENOSPC, f"{os.strerror(errno.ENOSPC)} for {needed} bytes more")


def _sync(path):
    handle = os.open(path, os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def read(path, column, part):
    """As formats.py says."""
    with reading(path), _opened(path) as file:
        return file[column][part]


def count(path, columns):
    """As formats.py says."""
    with reading(path), _opened(path) as file:
        return min(len(file[column]) for column in columns)


def demand_whole(path, columns, count):
    """As formats.py says."""
    with reading(path), _opened(path) as file:
        for column in columns:
            demand_rows(path, column, len(file[column]), count)
            for at in range(0, count, LONGEST):
                _ = file[column][at : at + LONGEST]


def put(path, group, arrays):
    """As formats.py says."""
    with h5py.File(path, "r+", libver="latest", locking=False) as file:
        for name, values in arrays.items():
            file.create_dataset(f"{group}/{name}", data=values)


def get(path, group):
    """As formats.py says."""
    with reading(path), _opened(path) as file:
        return {name: values[()] for name, values in file[group].items()} if group in file else {}


def attributes(path):
    """As formats.py says."""
    with reading(path), _opened(path) as file:
        return dict(file.attrs)


def names(path):
    """As formats.py says."""
    with reading(path), _opened(path) as file:
        return list(file)


def _opened(path):
    """The file to read: as one that is being written, or as another reader in this process has opened it.

    Of a damaged file that nobody writes, HDF5 would wait for the missing part for ever.
    """
    written = ({"libver": "latest", "swmr": True, "locking": False},) if _is_being_written(path) else ()
    for options in (*written, {"locking": False}, {}):
        try:
            return h5py.File(path, "r", **options)
        except OSError as error:
            reason = error
    said = "it is a folder" if os.path.isdir(path) else str(reason).partition(" (")[0]
    raise StorageError(f"{path} can't be read as HDF5: {said}.") from reason


def _is_being_written(path):
    """Whether the superblock says that the file is open for writing; a killed process leaves that, too."""
    with contextlib.suppress(OSError), open(path, "rb") as file:
        head = file.read(FLAGS + 1)
        return len(head) > FLAGS and head[FLAGS] != 0
    return False


def _laid_out(path, tables, attributes):
    """A new file with empty arrays, and the scales of their dimensions."""
    file = h5py.File(path, "x", libver="latest", locking=False, rdcc_nbytes=CACHE)
    file.attrs.update(attributes)
    for table in tables.values():
        for dimension, labels in table.labels.items():
            if dimension not in file:
                names = np.array(labels, dtype=h5py.string_dtype())
                file.create_dataset(dimension, data=names).make_scale(dimension)
        for column in table.columns:
            shape, chunks = table.shapes(column)
            grown = {"maxshape": (None, *shape[1:]), "chunks": chunks}
            array = file.create_dataset(column.name, shape, float, **grown)
            array.attrs.update(column.attributes)
            if column.name == table.dimension:
                array.make_scale(table.dimension)
                continue
            for i, dimension in enumerate((table.dimension, *column.dimensions)):
                array.dims[i].attach_scale(file[dimension])
    return file


def _copy(old, new, count):
    """The first rows of an array."""
    demand_rows(old.file.filename, old.name, len(old), count)
    new.resize(count, axis=0)
    for at in range(0, count, COPIED):
        with reading(old.file.filename):
            rows = old[at : min(at + COPIED, count)]
        new[at : at + COPIED] = rows
