"""Checkpoint files: versioned, checksummed, replaced as a whole; the one before is kept. Data alone.

A file is a line with its format, a line with the SHA-256 of the rest, a line of JSON, and the bytes of arrays one after
the other. The JSON has numbers and names, and of each array its name, type and shape. It is written beside the one
before, brought to the disk (fsync) and renamed, so that at any moment there is a whole one.
"""

import contextlib
import errno
import hashlib
import json
import math
import os
from pathlib import Path

import numpy as np

from .. import validation
from ..errors import StorageError
from ..validation import demand_record, nearest, reason
from .formats import NUMBERS, SUFFIXES

FORMAT = b"tsdyn checkpoint 2\n"
SEAL = 65  # bytes of a checksum and its line end
LONGEST = 1 << 26  # bytes of the JSON: what Python makes of it takes some twenty times as many
FACTS = {  # what every one says, with the types of it
    "version": str, "kernels": str, "machine": list, "scene": str, "functions": dict, "events": dict,
    "interval": (int, float), "counts": dict, "size": int, "passed": list, "t": (int, float), "arguments": dict,
}  # fmt: skip


def place(store):
    """Where the checkpoint of a store is, and the one before it."""
    store = Path(store)
    return store.with_name(f"{store.name}.checkpoint"), store.with_name(f"{store.name}.checkpoint-before")


def write(store, numbers, arrays):
    """Write a checkpoint: `numbers` as JSON, arrays by name. Raises OSError, and leaves the one before as it was."""
    newest, before = place(store)
    arrays = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    known = [[name, array.dtype.str, array.shape] for name, array in arrays.items()]
    words = json.dumps({"numbers": numbers, "arrays": known}).encode()
    if len(words) > LONGEST:
        raise OSError(errno.EFBIG, f"a checkpoint of {len(words)} bytes of numbers is more than is read again")
    content = b"".join([words, b"\n", *(array.tobytes() for array in arrays.values())])
    partial = newest.with_name(f"{newest.name}-partial")
    try:
        partial.unlink(missing_ok=True)  # a link, perhaps
        with open(partial, "xb") as file:
            file.write(FORMAT + hashlib.sha256(content).hexdigest().encode() + b"\n")
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if newest.exists():
            _keep(newest, before)
        os.replace(partial, newest)
        _sync(newest.parent)
    except OSError:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise


def read(store):
    """The numbers and the arrays of the newest checkpoint.

    Raises
    ------
    StorageError
        If there is none, or it is damaged; says whether the one before it is whole.
    """
    newest, before = place(store)
    if not newest.exists():
        if not before.exists():
            _demand_store(Path(store))
            raise StorageError(
                f"{newest} doesn't exist: {store} was written without checkpoint=seconds, stopped before the "
                "first one, or moved without it."
            )
        newest = before  # killed between two renames
    try:
        return _read(newest)
    except StorageError as error:
        if newest == before:
            raise
        try:
            numbers = _read(before)[0]
        except (StorageError, OSError):
            raise error from None
        raise StorageError(
            f"{error} The one before it, of t = {numbers['t']:.9g} s, is whole: delete {newest} to go on from there."
        ) from None


def _demand_store(path):
    """Raise StorageError if there is no store; names those of its folder that are called much the same."""
    if not path.exists():
        others = [other.name for other in path.parent.glob("*") if other.suffix.lower() in SUFFIXES]
        raise StorageError(f"{path} doesn't exist{nearest(path.name, others)}")


def remove(store):
    """Delete the checkpoints of a store."""
    for path in place(store):
        with contextlib.suppress(OSError):
            path.unlink()


def _read(path):
    content = validation.read(path)
    head, checksum = content[: len(FORMAT)], content[len(FORMAT) :][: SEAL - 1]
    if head != FORMAT:
        raise StorageError(f"{path} is no checkpoint of this format, {FORMAT.decode().strip()!r}.")
    payload = memoryview(content)[len(FORMAT) + SEAL :]
    if hashlib.sha256(payload).hexdigest().encode() != checksum:
        raise StorageError(f"{path} is damaged: its checksum is not that of its content.")
    try:
        begin = content.index(b"\n", len(FORMAT) + SEAL, len(FORMAT) + SEAL + LONGEST + 1)
        found = json.loads(content[len(FORMAT) + SEAL : begin])
        numbers, arrays = found["numbers"], _arrays(content, begin + 1, found["arrays"])
        demand_record(numbers, FACTS)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError, MemoryError) as error:
        raise StorageError(f"{path} is damaged: {reason(error)}.") from error
    return numbers, arrays


def _arrays(content, begin, known):
    """The arrays of the bytes from `begin` on; raises ValueError unless they are all there is."""
    found = {}
    for name, code, shape in known:
        kind = np.dtype(str(code))
        count = math.prod(shape)
        if kind.str not in NUMBERS or not all(type(size) is int and size >= 0 for size in shape):
            raise ValueError(f"the array {name!r} is of no numbers")
        if count * kind.itemsize > len(content) - begin:
            raise ValueError(f"the array {name!r} is longer than the file")
        content_of = np.frombuffer(content, np.uint8, count * kind.itemsize, begin)
        found[str(name)] = content_of.copy().view(kind).reshape(shape)
        begin += count * kind.itemsize
    if begin != len(content):
        raise ValueError("there are more bytes than the arrays have")
    return found


def _keep(path, before):
    """Give a file a second name: at no moment is there none of the first."""
    link = before.with_name(f"{before.name}-partial")
    with contextlib.suppress(OSError):
        link.unlink()
    try:
        os.link(path, link)
        os.replace(link, before)
    except OSError:  # a file system without links
        os.replace(path, before)


def _sync(folder):
    """Bring the names in a folder to the disk, where the platform has a way."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
