"""Files that are read whole: regular ones (no device, pipe or folder), of a bounded size."""

from __future__ import annotations

import os
import stat
from typing import TYPE_CHECKING

from .errors import StorageError

if TYPE_CHECKING:
    from .hints import Place

FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # a pipe without a writer opens at once
NO_LINKS = getattr(os, "O_NOFOLLOW", 0)


def opened(path: Place, largest: int | None = None, flags: int = 0) -> int:
    """The descriptor of a regular file of at most so many bytes.

    Raises
    ------
    StorageError
        If it is something else, too large, or can't be opened.
    """
    try:
        handle = os.open(path, FLAGS | flags)
    except (OSError, ValueError) as error:
        raise StorageError(f"{path} can't be read: {getattr(error, 'strerror', None) or error}.") from error
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            what = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
            raise StorageError(f"{path} can't be read: it is {what}, not a regular file.")
        if largest is not None and found.st_size > largest:
            raise StorageError(
                f"{path} is too large: it has {found.st_size} bytes, and such a file may have {largest} at most."
            )
    except BaseException:
        os.close(handle)
        raise
    return handle


def read(path: Place, largest: int | None = None, flags: int = 0) -> bytes:
    """The bytes of a regular file; arguments and errors as of `opened`."""
    with os.fdopen(opened(path, largest, flags), "rb") as file:
        size = os.fstat(file.fileno()).st_size
        try:
            content = file.read((size if largest is None else largest) + 1)  # one of /proc says that it has none
        except (OSError, MemoryError) as error:
            raise StorageError(f"{path} can't be read: {getattr(error, 'strerror', None) or 'no memory'}.") from error
    if len(content) > (size if largest is None else largest):
        raise StorageError(f"{path} can't be read: it has more bytes than it says, or is being written.")
    return content


def demand(path: Place) -> None:
    """Raise StorageError unless a path is that of a regular file; for libraries that open it themselves."""
    os.close(opened(path))
