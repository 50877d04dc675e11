"""What is said where a file can't be written: path, reason and remedy, without the words of a library."""

import contextlib
import errno
import os
import re
from pathlib import Path

from ..errors import StorageError

FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
ELSEWHERE = "Free space there, or take another path."


def code_of(error):
    """The errno of an error, which HDF5 has in its text; None if there is none."""
    found = re.search(r"errno = (\d+)", str(error))
    return int(found[1]) if found else getattr(error, "errno", None)


def reason_of(error):
    """What the system says, or else what the library says before its parentheses."""
    code = code_of(error)
    return os.strerror(code) if code else f"{type(error).__name__}: {str(error).partition(' (')[0]}"


def unwritable(path, error, remedy=ELSEWHERE):
    """The StorageError of a path that can't be written; the remedy is that of a full disk."""
    reason, path = reason_of(error), Path(path)
    if code_of(error) not in FORBIDDEN:
        return StorageError(f"{path} can't be written: {reason}. {remedy}")
    if not os.path.exists(path):  # False, too, where the folder can't be searched
        reason = f"the folder {path.parent} can't be written to ({reason})"
    return StorageError(f"{path} can't be written: {reason}. Take another path, or change the permissions.")


@contextlib.contextmanager
def writing(path, remedy=ELSEWHERE):
    """A block in which an OSError is that of writing a path."""
    try:
        yield
    except StorageError:
        raise
    except OSError as error:
        raise unwritable(path, error, remedy) from error
