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
import pickle
import platform
import stat
import sys
import tempfile
import time
import uuid
import warnings
from collections import Counter
from functools import cache, cached_property
from pathlib import Path

import llvmlite.binding as llvm
import numba
from numba.core.caching import _Cache, dumps
from numba.core.compiler import CompileResult
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys

from .. import regular_files
from ..errors import StorageError
from .code_hash import deep_hash, is_ours, platform_hash

statistics = Counter()  # "hits", "misses", "damaged", "seconds" of reading, "waited" (s) for kernels, of this process
_DAY = 86400.0
_KEEP = 30 * _DAY  # files that nothing has read for so long are deleted
_told = []
_CHECKSUM = hashlib.sha256().digest_size
FORMAT = 2  # of the files


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
                for file in old.iterdir():
                    file.unlink()
                old.rmdir()


@cache
def _prune_files():
    """Delete the kernels that no process has read for a month; once a process, when it has compiled one."""
    for file in folder().iterdir():
        with contextlib.suppress(OSError):
            if time.time() - file.stat().st_mtime > _KEEP:
                file.unlink()


def machine():
    """The processor as machine code is made for it."""
    return [platform.machine(), *map(str, cpu_target.target_context.codegen().magic_tuple())]


class KernelCache(_Cache):
    """The disk cache of one function, with a lock so that processes starting together compile once."""

    def __init__(self, function):
        self._function = function
        self._lock = None

    @cached_property
    def _name(self):
        """Computed at first use, when all that the function names is defined."""
        function = self._function
        home = Path(function.__code__.co_filename).stem
        label = f"{home}.{function.__qualname__}".translate({ord(c): "" for c in '<>:"/\\|?*'})
        return f"{label[:100]}-{deep_hash(function)}"

    @property
    def cache_path(self):
        """The folder that kernels are written to."""
        return str(folder())

    def enable(self):
        """Do nothing: kernels are always cached."""

    disable = flush = enable

    def load_overload(self, sig, target_context):
        """Return the compiled function, or None; a miss takes the lock that save_overload gives back."""
        started = time.perf_counter()
        if is_ours(self._function.__module__):
            rtsys.initialize(target_context)
        else:  # libraries that a user's kernel calls, such as LAPACK, are found by what Numba imports here
            target_context.refresh()
        file = self._file(sig, target_context.codegen())
        found = self._load(file, target_context)
        if found is None:
            self.release()  # of a compilation that was interrupted
            self._lock = _acquire(file)
            found = self._load(file, target_context)
        if found is None:
            target_context.refresh()  # before the compiler's own context stands over it
            statistics["misses"] += 1
            tell()
        else:
            statistics["hits"] += 1
            self.release()
        statistics["seconds"] += time.perf_counter() - started
        return found

    def has(self, sig, codegen):
        """Whether there is a file of the compiled function."""
        name = self._file(sig, codegen)
        return any((path / name).exists() for path in folders())

    def save_overload(self, sig, data):
        """Store the compiled function and let waiting processes read it."""
        try:
            if not data.lifted and not data.library.has_dynamic_globals and folder() is not None:
                plain = data._replace(type_annotation="")  # the source's text, which generated functions don't have
                (name, kind, (code, bitcode)), *others = plain._reduce()
                payload = dumps(((name, kind, (code, _without_bodies(bitcode))), *others))
                _write(folder() / self._file(sig, data.codegen), payload)
                _prune_files()
        except OSError as error:
            _warn(f"tsdyn can't store its compiled kernels in {folder()} ({error.strerror})")
        finally:
            self.release()

    def release(self):
        """Give the lock back, if it is held."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def _file(self, sig, codegen):
        key = hashlib.sha256(repr((sig, codegen.magic_tuple())).encode()).hexdigest()
        return f"{self._name}-{key[:12]}.kernel"

    def _load(self, name, target_context):
        for path in folders():
            with contextlib.suppress(OSError, StorageError):
                file = path / name
                content = regular_files.read(file, flags=regular_files.NO_LINKS)
                try:
                    if _seal(name, content[_CHECKSUM:]) != content[:_CHECKSUM]:
                        raise ValueError("checksum")
                    found = CompileResult._rebuild(target_context, *pickle.loads(content[_CHECKSUM:]))
                except Exception:  # whatever a damaged file makes of the loader
                    statistics["damaged"] += 1
                    file.unlink()
                    continue
                with contextlib.suppress(OSError):
                    if time.time() - file.stat().st_mtime > _DAY:
                        os.utime(file)
                return found
        return None


def _without_bodies(bitcode):
    """LLVM's code with empty functions of the same names, which is all that is read of it: nothing links it in."""
    functions = [found for found in llvm.parse_bitcode(bitcode).functions if not found.is_declaration]
    return llvm.parse_assembly(
        "\n".join(f'define void @"{found.name}"() {{ ret void }}' for found in functions)
    ).as_bitcode()


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
    for file in folder().glob(f"*.kernel.{process}-*"):
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


@cache
def _warn(what):
    warnings.warn(
        f"{what}, so every process compiles them again; free some space there, or set TSDYN_CACHE_DIR to a folder that "
        "you can write to.",
        RuntimeWarning,
        stacklevel=2,
    )


def _acquire(name, patience=300.0):
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
