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

from .. import validation
from ..errors import StorageError
from .formats import CHUNK, LONGEST, NUMBERS, ROOM, code_of, demand_rows, reading

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
        partial = Path(path).with_name(f"{Path(path).name}-partial")
        partial.unlink(missing_ok=True)
        _demand_room(partial, os.path.getsize(path) + _room_of(tables))
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
        return {name: file.attrs[name] for name in file.attrs if _is_plain(file.attrs.get_id(name))}


def _is_plain(attribute):
    """Whether an attribute is a text or a whole number: of others HDF5 may follow addresses beyond the file."""
    kind = attribute.get_type()
    is_text = kind.get_class() == h5py.h5t.STRING and kind.is_variable_str()
    return attribute.shape == () and (is_text or attribute.dtype.kind in "iu")


def shapes(path):
    """As formats.py says."""
    with reading(path), _opened(path) as file:
        return {
            name: array.shape
            for name, array in file.items()
            if isinstance(array, h5py.Dataset) and array.dtype == float
        }


def demand_plain(path, size=0):
    """As formats.py says; every function that reads asks for it, for it takes a millisecond."""
    validation.demand_regular(path)
    if (found := os.path.getsize(path)) < size:  # HDF5 would wait for the missing part for ever
        raise StorageError(f"{path} is damaged: it has {found} bytes, and {size} were written.")
    with reading(path), _opened(path):
        pass


def _demand_plain(path, group, within=False):
    """Raise StorageError unless a group has plain arrays alone; the bytes of those of numbers.

    Links lead into other files, as do virtual and external arrays; filters unpack, and may be code.
    """
    size = 0
    for name in group:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise StorageError(f"{path}: {name} is a link to elsewhere, which is not followed.")
        array = group[name]
        if isinstance(array, h5py.Group) and not within:
            size += _demand_plain(path, array, within=True)
            continue
        if not isinstance(array, h5py.Dataset):
            raise StorageError(f"{path}: {name} is no array.")
        if array.dtype.str in NUMBERS or array.dtype.kind == "b":
            size += array.size * array.dtype.itemsize
        elif within or h5py.check_string_dtype(array.dtype) is None:
            raise StorageError(f"{path}: {name} holds {array.dtype}, no numbers.")
        if array.is_virtual or array.external or array.id.get_create_plist().get_nfilters():
            raise StorageError(f"{path}: {name} is compressed, or its numbers are elsewhere; neither is read.")
    return size


def _opened(path):
    """The file to read: as one that is being written, or as another reader in this process has opened it.

    Of a damaged file that nobody writes, HDF5 would wait for the missing part for ever.
    """
    validation.demand_regular(path)
    written = ({"libver": "latest", "swmr": True, "locking": False},) if _is_being_written(path) else ()
    for options in (*written, {"locking": False}, {}):
        try:
            file = h5py.File(path, "r", **options)
        except (OSError, RuntimeError) as error:
            reason = error
            continue
        try:
            size, held = _demand_plain(path, file), os.path.getsize(path)
            if size > held + (ROOM * len(file) if written else ROOM):
                raise StorageError(f"{path}: its arrays say that they have {size} bytes, and the file has {held}.")
        except BaseException:
            file.close()
            raise
        return file
    said = str(reason).partition(" (")[0]
    raise StorageError(f"{path} is damaged, or can't be read as HDF5: {said}.") from reason


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
