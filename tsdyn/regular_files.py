"""Contents of users' files: of regular ones, up to a size."""

from __future__ import annotations

import os
import stat
from typing import Any

from .errors import StorageError

NO_WAIT = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # a pipe without a writer is opened at once


def content(path: Any, limit: int) -> bytes:
    """The bytes of a file.

    Parameters
    ----------
    path : str or PathLike
    limit : int
        Bytes at most.

    Raises
    ------
    StorageError
        If the file can't be read, is larger, or is no regular file: a folder, a pipe, a device, or a link to one.
    """
    try:
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | NO_WAIT)) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise StorageError(f"{path} is no regular file; give a file, not a folder, pipe or device.")
            data = file.read(limit + 1) if status.st_size <= limit else None
    except StorageError:
        raise
    except (OSError, ValueError, TypeError) as error:
        raise StorageError(f"{path} can't be read: {getattr(error, 'strerror', None) or error}.") from error
    if data is None or len(data) > limit:
        raise StorageError(f"{path} is too large: it may have {limit} bytes at most.")
    return data
