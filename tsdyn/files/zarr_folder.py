"""Stores in Zarr: a folder with a file for each chunk, checked before the library reads it."""

import json
import math
import os
import stat
import warnings
from pathlib import Path

import numpy as np
import zarr
from zarr.codecs import BloscCodec

from .. import validation
from ..errors import StorageError
from ..validation import clipped, damaged, reason
from .formats import CHUNK, demand_rows, reading

# Folders of Zarr, checked before they are read: plain numbers in regular files of the folder, of sizes they hold.
#
# Zarr knows codecs that unpickle, the file system follows links, and a chunk unpacks to what its head says. Codecs that
# tsdyn doesn't write are refused, and so are links.

TYPES = {"float64": 8, "int64": 8, "bool": 1, "uint8": 1}  # bytes of each
CODECS = ["bytes"], ["bytes", "blosc"]
RATIO = 255  # to which LZ4 compresses at most
WAITING = 16 * 8 * CHUNK  # bytes of a column that a run may not have written yet
LARGEST = 1 << 20  # bytes of a zarr.json
BLOSC = 16  # bytes of a chunk's head: at 4 what it unpacks to, at 12 its own bytes


def attributes(path):
    """Words and whole numbers among the attributes of the root; raises StorageError where there is none."""
    known = _read(Path(path), "group").get("attributes", {})
    if not isinstance(known, dict):
        raise StorageError(f"{path} is damaged: its attributes are no table.")
    return {name: value for name, value in known.items() if isinstance(value, (str, int))}


def demand_plain(path, size=0):
    """As formats.py says."""
    path, sizes = Path(path), {}
    for folder, folders, files in os.walk(path):
        for name in (*folders, *files):
            file = os.path.join(folder, name)
            found = os.lstat(file)
            if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
                raise StorageError(f"{file} is a link, a device or a pipe, and not read.")
            if name in files:
                sizes.setdefault(folder, {})[name] = found.st_size
    attributes(path)
    _demand_arrays(path, sizes, within=False)


def _demand_arrays(path, sizes, within):
    """Raise StorageError unless a group has such arrays alone; a group within it the same."""
    for child in sorted(each for each in path.iterdir() if each.is_dir()):
        spec = _read(child)
        if spec.get("node_type") == "group" and not within:
            _demand_arrays(child, sizes, within=True)
        elif within or spec.get("data_type") != "string":  # names along a dimension, which are not read
            with damaged(child):
                _demand_array(child, spec, sizes)


def _demand_array(path, spec, sizes):
    grid, size = spec["chunk_grid"], TYPES[spec["data_type"]]
    codecs, chunk = [each["name"] for each in spec["codecs"]], grid["configuration"]["chunk_shape"]
    key, others = spec["chunk_key_encoding"], spec.get("storage_transformers")
    plain = grid["name"] == "regular" and codecs in CODECS and key["name"] == "default" and not others
    little = spec["codecs"][0].get("configuration", {}).get("endian", "little") == "little"
    if not (plain and little and key["configuration"]["separator"] == "/" and spec["node_type"] == "array"):
        raise StorageError(f"{path} is written in a way that tsdyn doesn't: {clipped(', '.join(map(str, codecs)))}.")
    for shape, least in ((spec["shape"], 0), (chunk, 1)):
        if len(shape) != len(chunk) or not all(type(length) is int and least <= length < 1 << 53 for length in shape):
            raise ValueError("a shape is no list of lengths")
    whole, held = size * math.prod(chunk), 0
    for folder, files in ((folder, files) for folder, files in sizes.items() if _is_within(folder, path / "c")):
        for name, found in files.items():
            held += found
            if (found if codecs == ["bytes"] else _unpacked(os.path.join(folder, name), found)) != whole:
                raise StorageError(f"{os.path.join(folder, name)} is damaged: it is no chunk of {whole} bytes.")
    if size * math.prod(spec["shape"]) > RATIO * held + WAITING:
        raise StorageError(f"{path} says that it has {size * math.prod(spec['shape'])} bytes, and its files {held}.")


def _is_within(folder, path):
    return folder == str(path) or folder.startswith(f"{path}{os.sep}")


def _unpacked(file, size):
    """How many bytes a chunk of Blosc unpacks to, by its head; -1 if it is not as long as it says."""
    with os.fdopen(validation.opened(file), "rb") as opened:
        head = opened.read(BLOSC)
    said = int.from_bytes(head[12:16], "little")
    return int.from_bytes(head[4:8], "little") if len(head) == BLOSC and said == size else -1


def _read(path, kind=None):
    """The zarr.json of a folder."""
    file = path / "zarr.json"
    try:
        found = json.loads(validation.read(file, LARGEST))
    except (ValueError, RecursionError) as error:
        raise StorageError(f"{file} is damaged, or no JSON: {reason(error)}.") from error
    known = isinstance(found, dict) and found.get("zarr_format") == 3 and kind in (None, found.get("node_type"))
    if not known or found.get("consolidated_metadata"):
        raise StorageError(f"{file} is no metadata of Zarr 3 as tsdyn writes it.")
    return found


# Stores in Zarr: a folder with a file for each chunk, each written as a whole.

__all__ = ["BUFFER", "Store", "attributes", "count", "demand_plain", "demand_whole", "get", "put", "read", "shapes"]
FAST = BloscCodec(typesize=8, cname="lz4", clevel=1, shuffle="shuffle")
WHOLE = {"array.write_empty_chunks": True}  # also what is nan throughout: a chunk that isn't there is lost
BUFFER = 8 * CHUNK  # a write takes 20 ms, of however many rows


class Store:
    """A folder that is being written; see formats.py."""

    def __init__(self, path, group, tables):
        self._path, self._group = path, group
        with zarr.config.set(WHOLE):
            self._arrays = {column.name: group[column.name] for table in tables.values() for column in table.columns}

    @classmethod
    def create(cls, path, tables, attributes):
        """As formats.py says."""
        group = zarr.create_group(path, attributes=attributes)
        for table in tables.values():
            for dimension, labels in table.labels.items():
                if dimension not in group:
                    _add_labels(group, dimension, labels)
            for column in table.columns:
                shape, chunks = table.shapes(column)
                group.create_array(
                    column.name, shape=shape, chunks=chunks, dtype=float,
                    dimension_names=(table.dimension, *column.dimensions), fill_value=np.nan,
                    attributes=column.attributes, compressors=FAST,
                )  # fmt: skip
        return cls(path, group, tables)

    size = 0

    @classmethod
    def reopen(cls, path, tables, attributes, counts, size):
        """As formats.py says."""
        with reading(path):
            store = cls(path, _group(path, "r+"), tables)
        for name, table in tables.items():
            for column in table.columns:
                array = store._arrays[column.name]
                demand_rows(path, column.name, array.shape[0], counts[name])
                array.resize((counts[name], *array.shape[1:]))
                _demand_chunks(path, array)
        return store

    def write(self, start, rows):
        """As formats.py says."""
        for column, values in rows.items():
            array, end = self._arrays[column], start + len(values)
            array.resize((end, *array.shape[1:]))
            array[start:end] = values

    def flush(self):
        """Do nothing: every chunk is a file of its own, written as a whole."""

    def sync(self):
        """As formats.py says."""
        if hasattr(os, "sync"):
            os.sync()

    def close(self):
        """Do nothing."""


def read(path, column, part):
    """As formats.py says."""
    with reading(path):
        return _group(path, "r")[column][part]


def count(path, columns):
    """As formats.py says."""
    with reading(path):
        group = _group(path, "r")
        return min(group[column].shape[0] for column in columns)


def demand_whole(path, columns, count):
    """As formats.py says."""
    with reading(path):
        group = _group(path, "r")
        for array in (group[column] for column in columns):
            demand_rows(path, array.name, array.shape[0], count)
            _demand_chunks(path, array)


def put(path, group, arrays):
    """As formats.py says."""
    inner = _group(path, "r+").create_group(group)
    for name, values in arrays.items():
        inner.create_array(name, data=np.ascontiguousarray(values), compressors=None)


def get(path, group):
    """As formats.py says."""
    with reading(path):
        whole = _group(path, "r")
        return {name: array[...] for name, array in whole[group].arrays()} if group in whole else {}


def shapes(path):
    """As formats.py says."""
    with reading(path):
        return {name: array.shape for name, array in _group(path, "r").arrays() if array.dtype == float}


def _demand_chunks(path, array):
    """Raise StorageError unless all chunks are there, and whole."""
    with reading(path):
        if array.nchunks_initialized < array.nchunks:
            raise StorageError(f"{path} is damaged: {array.name} lacks chunks.")
        for at in range(0, array.shape[0], array.chunks[0]):
            _ = array[at : at + array.chunks[0]]


def _group(path, mode):
    try:
        return zarr.open_group(path, mode=mode)
    except Exception as error:  # of many kinds
        raise StorageError(f"{path} can't be read as Zarr: {reason(error)}.") from error


def _add_labels(group, dimension, labels):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # strings have no place in the specification yet
        array = group.create_array(dimension, shape=(len(labels),), dtype=str, dimension_names=(dimension,))
        array[:] = np.array(labels, dtype=object)
