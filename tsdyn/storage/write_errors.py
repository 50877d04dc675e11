"""What is said where a file can't be written: path, reason and remedy, without the words of a library."""

import contextlib
import errno
import os
import re
import tempfile
from pathlib import Path

from ..errors import StorageError

FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
NO_FOLDER = (errno.ENOENT, errno.ENOTDIR)
ELSEWHERE = "Free space there, or take another path.", "Take another path."  # where a disk is full, and else


def code_of(error):
    """The errno of an error, which HDF5 has in its text; None if there is none."""
    found = re.search(r"errno = (\d+)", str(error))
    return int(found[1]) if found else getattr(error, "errno", None)


def reason_of(error):
    """What the system says, or else what the library says before its parentheses."""
    code = code_of(error)
    return os.strerror(code) if code else f"{type(error).__name__}: {str(error).partition(' (')[0]}"


def unwritable(path, error, remedies=ELSEWHERE):
    """The StorageError of a path that can't be written; remedies: where the disk is full, and where none is known."""
    reason, code, path = reason_of(error), code_of(error), Path(path)
    remedy = remedies[code not in FULL]
    if code in NO_FOLDER:
        with contextlib.suppress(StorageError):
            demand_folder(path)
            reason = f"no file can be made in {path.parent} ({reason})"
    if code in FORBIDDEN and not os.path.exists(path):  # False, too, where the folder can't be searched
        reason = f"the folder {path.parent} can't be written to ({reason})"
    if code in FORBIDDEN:
        remedy = "Take another path, or change the permissions."
    elif code == errno.ENAMETOOLONG:
        remedy = "Take a shorter name."
    return StorageError(f"{path} can't be written: {reason}. {remedy}")


def demand_folder(path):
    """Raise StorageError unless the folder that a path is in exists."""
    path = Path(path)
    with writing(path):
        if path.parent.is_dir():
            return
        in_the_way = next((each for each in path.parents if each.exists()), path.parent)
        is_folder = in_the_way.is_dir()
    if is_folder:
        raise StorageError(f"there is no folder {path.parent} to write {path.name} to. Make it, or take another path.")
    raise StorageError(f"{path.name} can't be written to {path.parent}: {in_the_way} is a file. Take another path.")


def demand_writable(path):
    """Raise StorageError unless files can be made in the folder that a path is in."""
    demand_folder(path)
    with writing(path), tempfile.NamedTemporaryFile(dir=Path(path).parent):
        pass


@contextlib.contextmanager
def writing(path, remedies=ELSEWHERE):
    """A block in which an OSError is that of writing a path."""
    try:
        yield
    except StorageError:
        raise
    except OSError as error:
        raise unwritable(path, error, remedies) from error
