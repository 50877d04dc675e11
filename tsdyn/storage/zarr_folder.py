"""Stores in Zarr: a folder with a file for each chunk, each written as a whole."""

import os
import warnings

import numpy as np
import zarr
from zarr.codecs import BloscCodec

from ..errors import StorageError
from ..validation import reason
from .formats import CHUNK, demand_rows, reading
from .zarr_checks import attributes, demand_plain

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
