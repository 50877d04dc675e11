"""A kernel cache on disk that never answers with a stale or damaged kernel.

Each file holds one compiled function. The file name contains a hash of everything that determines the machine code
(code_hash.py); the file starts with a checksum of its name and content. Writes are atomic. A file that fails its
checksum is deleted and its function is compiled again. A complete cache in a read-only folder is used in place. Numba's
own settings and classes are not modified. Kernels are pickles with machine code: folders that others than the user and
root can write to are refused.
"""

import contextlib
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import time
import uuid
import warnings
from collections import Counter
from functools import cache
from pathlib import Path

import numba

from .. import validation
from ..errors import CompilerWarning
from .code_hash import deep_hash, platform_hash

statistics = Counter()  # "hits", "misses", "damaged", "seconds" of reading, "waited" (s) for kernels, of this process
FAILURES = "failures.txt"  # in the folder of kernels: those that couldn't be loaded, a line each
_DAY = 86400.0
_KEEP = 30 * _DAY  # files that nothing has read for so long are deleted
_told = []
_CHECKSUM = hashlib.sha256().digest_size
FORMAT = 3  # of the files
CALLEE = ".callee"  # how the names of those end that kernels link in


def _bases():
    bases = []
    with contextlib.suppress(RuntimeError):  # no home folder
        if os.environ.get("TSDYN_CACHE_DIR"):
            bases.append(Path(os.environ["TSDYN_CACHE_DIR"]).expanduser().absolute())
        elif numba.config.CACHE_DIR:
            bases.append(Path(numba.config.CACHE_DIR) / "tsdyn")
        elif sys.platform == "win32" and "LOCALAPPDATA" in os.environ:
            bases.append(Path(os.environ["LOCALAPPDATA"]) / "tsdyn" / "Cache")
        elif sys.platform == "darwin":
            bases.append(Path("~/Library/Caches/tsdyn").expanduser())
        else:
            bases.append(Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "tsdyn")
    owner = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    return [*bases, Path(tempfile.gettempdir()) / f"tsdyn-{owner}"]


def _within(base):
    return base / f"{platform_hash()}-{FORMAT}"


SHIPPED = Path(__file__).parents[1] / "kernels"  # of platform wheels: a folder for each target


@cache
def shipped(target):
    """The folder of kernels that came with tsdyn for a target; None where there is none, or others can write to it."""
    path = SHIPPED / target
    return path if path.is_dir() and not _stranger(path) else None


@cache
def folders():
    """Return the folders that kernels are read from: pickles, so those alone that nobody else can write to."""
    folder()  # makes one, if it can
    return tuple(path for base in _bases() if (path := _within(base)).is_dir() and not _stranger(path))


def _stranger(path):
    """Which folder, of a path and those above it, somebody else than the user and root can write to; None for none.

    In a folder with the sticky bit, such as /tmp, everybody can write, and nobody can replace what is another's.
    """
    if not hasattr(os, "getuid"):
        return None
    path = path.resolve()
    for each in (path, *path.parents):
        found = each.stat()
        writable = found.st_mode & (0o002 if _is_private(found.st_gid) else 0o022)
        sticky = each != path and found.st_mode & stat.S_ISVTX
        if found.st_uid not in (os.getuid(), 0) or (writable and not sticky):
            return each
    return None


@cache
def _is_private(group):
    """Whether a group is root's, or has the user's name, as systems give one to each user."""
    import grp
    import pwd

    try:
        return group == 0 or grp.getgrgid(group).gr_name == pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return False


@cache
def folder():
    """Return the folder that kernels are written to, or None where there is none."""
    for base in _bases():
        with contextlib.suppress(OSError):
            path = _within(base)
            new = not path.is_dir()
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            path.mkdir(exist_ok=True, mode=0o700)
            stranger = _stranger(path)
            if stranger is not None:
                warnings.warn(
                    f"tsdyn doesn't use {base} for its compiled kernels: they are code, and others than you can write "
                    f"to {stranger}. Take the permission away (chmod go-w), or set TSDYN_CACHE_DIR to another folder.",
                    RuntimeWarning,
                    stacklevel=2,
                )
                continue
            if hasattr(os, "getuid") and path.stat().st_uid != os.getuid():
                continue
            tempfile.TemporaryFile(dir=path).close()
            os.utime(path)
            if new:
                _prune(base, path)
            return path
    return None


def _prune(base, keep):
    """Delete the folders of other versions that no process has used for a month."""
    for old in base.iterdir():
        with contextlib.suppress(OSError):
            if old.is_dir() and old != keep and time.time() - old.stat().st_mtime > _KEEP:
                shutil.rmtree(old, ignore_errors=True)


@cache
def _prune_files():
    """Delete the kernels that no process has read for a month; once a process, when it has compiled one."""
    for file in folder().iterdir():
        with contextlib.suppress(OSError):
            if time.time() - file.stat().st_mtime > _KEEP:
                file.unlink()


def name_of(function):
    """The name of a kernel's file: its own, and the hash of all code that it depends on."""
    label = f"{function.__module__}.{function.__qualname__}".translate({ord(c): "" for c in '<>:"/\\|?*'})
    return f"{label[:100]}-{deep_hash(function)}"


def key_of(signature, target):
    """What tells a signature, and the processor, in the name of a kernel's file."""
    return hashlib.sha256(repr((signature, target)).encode()).hexdigest()[:12]


def load(name, rebuild, ours=None):
    """What `rebuild` makes of the content of a kernel's file; None where there is none, or none that can be loaded.

    ours: a folder to look in last, that is only read.
    """
    for file in (path / name for path in (*folders(), ours) if path):
        if not os.path.lexists(file):
            continue
        try:
            found = rebuild(opened(name, validation.read(file, flags=validation.NO_LINKS)))
        except Exception as error:  # whatever a damaged file makes of the loader
            if os.path.lexists(file):  # another process may just have deleted it
                report(file, error, file.parent != ours)
            continue
        with contextlib.suppress(OSError):
            if file.parent != ours and time.time() - file.stat().st_mtime > _DAY:
                os.utime(file)
        return found
    return None


def save(name, payload):
    """Write a kernel's file."""
    _write(folder() / name, payload)
    _prune_files()


def opened(name, content):
    """The content of a kernel's file without its checksum."""
    if _seal(name, content[_CHECKSUM:]) != content[:_CHECKSUM]:
        raise ValueError("the checksum is wrong: the file is damaged, or under the name of another")
    return content[_CHECKSUM:]


def report(file, error, delete=True):
    """Count a kernel that can't be loaded, note it in the folder of kernels, delete it; warn once a process."""
    statistics["damaged"] += 1
    cause = " ".join(f"{type(error).__name__}: {error}".split())
    with contextlib.suppress(OSError, TypeError), open(folder() / FAILURES, "a", encoding="utf-8") as log:  # no folder
        log.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {file.name} {cause[:200]}\n")
    if delete:
        with contextlib.suppress(OSError):
            file.unlink()
    if statistics["damaged"] == 1:
        warnings.warn(
            f"a stored kernel can't be loaded, and is compiled again: {file} ({cause}). `tsdyn info --cache` counts "
            "such files; where they become more, check the disk, or set TSDYN_CACHE_DIR to a folder on another one.",
            CompilerWarning,
            stacklevel=2,
        )


def contents():
    """What is in the folder of kernels: {"folder", "kernels", "stock", "bytes", "damaged", "failures"}.

    kernels: how many of tsdyn's own way; stock: of Numba's as it comes; bytes: of the former, with what they link in;
    damaged: [(file, cause)] of files whose checksum is wrong; failures: lines on those that couldn't be loaded before.
    """
    path, damaged, failures, sizes, kernels = folder(), [], [], [], 0
    for file in sorted([*path.glob("*.kernel"), *path.glob(f"*{CALLEE}")]) if path else ():
        try:
            content = validation.read(file, flags=validation.NO_LINKS)
            opened(file.name, content)
            sizes.append(len(content))
            kernels += file.suffix != CALLEE
        except (OSError, ValueError) as error:
            damaged.append((file.name, f"{type(error).__name__}: {error}"))
    with contextlib.suppress(OSError):
        failures = (path / FAILURES).read_text(encoding="utf-8").splitlines() if path else []
    return {
        "folder": path and str(path),
        "kernels": kernels,
        "stock": sum(1 for _ in path.glob("stock/*.stored")) if path else 0,
        "bytes": sum(sizes),
        "damaged": damaged,
        "failures": failures,
    }


def _seal(name, payload):
    """The checksum of a file: of its content and its name, so that a kernel under another's name is none."""
    return hashlib.sha256(name.encode() + b"\0" + payload).digest()


def _write(path, payload):
    """Write a file whole or not at all."""
    partial = path.with_name(f"{path.name}.{os.getpid()}-{uuid.uuid4().hex[:12]}")
    try:
        partial.write_bytes(_seal(path.name, payload) + payload)
        os.replace(partial, path)
    except OSError:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise


def environment():
    """What another process needs in its environment to use the same folder."""
    return {"NUMBA_CACHE_DIR": numba.config.CACHE_DIR}


def remove_partial_files(process):
    """Delete what a process that was killed has left."""
    for file in folder().glob(f"*.{process}-*"):
        with contextlib.suppress(OSError):
            file.unlink()


def tell(line="tsdyn: compiling kernels, once for this version and machine ..."):
    """Say, once a process, that there is something to wait for; nothing where that is said elsewhere."""
    if not _told:
        _told.append(True)
        if line and not os.environ.get("TSDYN_QUIET"):
            print(line, file=sys.stderr, flush=True)
        if folder() is None:
            _warn("tsdyn found no writable folder for its compiled kernels")


def warn_unwritable(error):
    """Say, once a process, that kernels can't be stored."""
    _warn(f"tsdyn can't store its compiled kernels in {folder()} ({error.strerror})")


@cache
def _warn(what):
    warnings.warn(
        f"{what}, so every process compiles them again; free some space there, or set TSDYN_CACHE_DIR to a folder that "
        "you can write to.",
        RuntimeWarning,
        stacklevel=2,
    )


def acquire(name, patience=300.0):
    """Lock a kernel, wait while another process compiles it; None where files can't be locked."""
    try:
        import fcntl

        handle = open(folder() / f"{name}.lock", "w")  # noqa: SIM115  (held until the kernel is saved)
    except (ImportError, OSError, TypeError):  # TypeError: no folder
        return None
    limit = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return handle
        except BlockingIOError:
            if time.monotonic() > limit:
                handle.close()
                return None
            time.sleep(0.02)
        except OSError:
            handle.close()
            return None
