"""Folders of Zarr, checked before they are read: plain numbers in regular files of the folder, of sizes they hold.

Zarr knows codecs that unpickle, the file system follows links, and a chunk unpacks to what its head says. Codecs that
tsdyn doesn't write are refused, and so are links.
"""

import json
import math
import os
import stat
from pathlib import Path

from .. import regular_files
from ..errors import StorageError
from ..validation import clipped, damaged, reason
from .formats import CHUNK

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
    with os.fdopen(regular_files.opened(file), "rb") as opened:
        head = opened.read(BLOSC)
    said = int.from_bytes(head[12:16], "little")
    return int.from_bytes(head[4:8], "little") if len(head) == BLOSC and said == size else -1


def _read(path, kind=None):
    """The zarr.json of a folder."""
    file = path / "zarr.json"
    try:
        found = json.loads(regular_files.read(file, LARGEST))
    except (ValueError, RecursionError) as error:
        raise StorageError(f"{file} is damaged, or no JSON: {reason(error)}.") from error
    known = isinstance(found, dict) and found.get("zarr_format") == 3 and kind in (None, found.get("node_type"))
    if not known or found.get("consolidated_metadata"):
        raise StorageError(f"{file} is no metadata of Zarr 3 as tsdyn writes it.")
    return found
