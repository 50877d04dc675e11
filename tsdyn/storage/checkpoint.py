"""Checkpoint files: versioned, checksummed, replaced as a whole; the one before is kept.

A file is a line with its format, a line with the SHA-256 of the rest, and an archive of arrays as NumPy's `savez` makes
it, one of them the numbers and names as JSON. It is written beside the one before, brought to the disk (fsync) and
renamed, so that at any moment there is a whole one.
"""

import contextlib
import hashlib
import io
import json
import os
from pathlib import Path

import numpy as np

from ..errors import StorageError
from ..validation import nearest
from .formats import SUFFIXES

FORMAT = b"tsdyn checkpoint 1\n"
NUMBERS = "numbers"  # the array of the JSON


def place(store):
    """Where the checkpoint of a store is, and the one before it."""
    store = Path(store)
    return store.with_name(f"{store.name}.checkpoint"), store.with_name(f"{store.name}.checkpoint-before")


def write(store, numbers, arrays):
    """Write a checkpoint: `numbers` as JSON, arrays by name. Raises OSError, and leaves the one before as it was."""
    newest, before = place(store)
    payload = io.BytesIO()
    words = np.frombuffer(json.dumps(numbers).encode(), np.uint8)
    np.savez(payload, **{NUMBERS: words}, **arrays)
    content = payload.getbuffer()
    partial = newest.with_name(f"{newest.name}-partial")
    try:
        with open(partial, "wb") as file:
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
    try:
        content = path.read_bytes()
    except OSError as error:
        raise StorageError(f"{path} can't be read: {error}.") from error
    head, checksum, payload = content[: len(FORMAT)], content[len(FORMAT) :][:64], content[len(FORMAT) + 65 :]
    if head != FORMAT:
        raise StorageError(f"{path} is no checkpoint of this format, {FORMAT.decode().strip()!r}.")
    if hashlib.sha256(payload).hexdigest().encode() != checksum:
        raise StorageError(f"{path} is damaged: its checksum is not that of its content.")
    with np.load(io.BytesIO(payload), allow_pickle=False) as found:
        arrays = dict(found)
    return json.loads(arrays.pop(NUMBERS).tobytes()), arrays


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
