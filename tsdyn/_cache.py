"""A kernel cache on disk that never answers with a stale kernel.

Numba stamps a cached kernel with the content of its own file only, so an edited callee elsewhere is answered with the
old machine code. Here the folder is named by a hash of every source file of the package, and a plug-in's kernel
further by a hash of all code and constants that it can reach. Numba's own settings and classes are left alone.
"""

import contextlib
import hashlib
import os
import pickle
import sys
import tempfile
import time
import types
import warnings
from collections import Counter
from functools import cache
from pathlib import Path

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache, _CacheLocator

statistics = Counter()  # "hits", "misses", "seconds" of this process
_KEEP_DAYS = 30


def package_folders():
    """Return the four folders whose sources make up the package."""
    here = Path(__file__).resolve().parent
    beside = here if (here / "constraints").is_dir() else here.parent
    return here, here / "forces", beside / "constraints", beside / "integrators"


@cache
def fingerprint():
    """Hash every source file of the package, the Numba version and the Python version."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version_info[:2]}".encode())
    files = [file for folder in package_folders() for file in sorted(folder.glob("*.py"))]
    if not files:
        return ""  # an install without sources: nothing says which kernels are its own
    for file in files:
        digest.update(f"{file.parent.name}/{file.name}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()


def _candidates():
    if numba.config.CACHE_DIR:
        yield Path(numba.config.CACHE_DIR) / "tsdyn"
    elif sys.platform == "win32" and "LOCALAPPDATA" in os.environ:
        yield Path(os.environ["LOCALAPPDATA"]) / "tsdyn" / "Cache"
    elif sys.platform == "darwin":
        yield Path("~/Library/Caches/tsdyn").expanduser()
    else:
        yield Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "tsdyn"
    owner = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    yield Path(tempfile.gettempdir()) / f"tsdyn-{owner}"


@cache
def folder():
    """Return the writable cache folder of these sources, or None where there is none."""
    for base in _candidates() if fingerprint() else ():
        try:
            path = base / fingerprint()[:24]
            new = not path.is_dir()
            base.mkdir(parents=True, exist_ok=True, mode=0o700)
            if hasattr(os, "getuid") and base.stat().st_uid != os.getuid():
                continue
            path.mkdir(parents=True, exist_ok=True, mode=0o700)
            if hasattr(os, "getuid") and path.stat().st_uid != os.getuid():
                continue  # somebody else's folder: its pickles are not to be trusted
            tempfile.TemporaryFile(dir=path).close()
            os.utime(path)
            if new:
                _prune(base, path)
            return path
        except (OSError, RuntimeError):  # RuntimeError: no home folder
            continue
    warnings.warn(
        "tsdyn found no writable folder for its compiled kernels, so every process compiles them again; "
        "set NUMBA_CACHE_DIR to a folder that you can write to.",
        stacklevel=2,
    )
    return None


def _prune(base, keep):
    """Drop the kernels of other versions that nothing has used for a month."""
    for old in base.iterdir():
        with contextlib.suppress(OSError):
            if old.is_dir() and old != keep and time.time() - old.stat().st_mtime > _KEEP_DAYS * 86400:
                for file in old.iterdir():
                    file.unlink()
                old.rmdir()


def _foreign(module):
    """Whether a module's version, or the package's own fingerprint, says all about it."""
    return module.__name__.split(".")[0] in ("numpy", "numba", "math", "cmath", "scipy", "tsdyn")


def deep_hash(function):
    """Hash a function with all the code, constants and modules that its compiled form depends on."""
    digest, seen = hashlib.sha256(), set()

    def add_code(code, namespace):
        digest.update(code.co_code)
        named = [namespace.get(name) for name in code.co_names]
        modules = [m for m in named if isinstance(m, types.ModuleType) and not _foreign(m)]
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                add_code(constant, namespace)
            else:
                digest.update(repr(constant).encode())
        for name in code.co_names:
            digest.update(name.encode())
            if name in namespace:
                add(namespace[name])
        for module in modules:  # what is reached as module.name, or package.module.name
            for name in code.co_names:
                value = getattr(module, name, None)
                if not isinstance(value, types.ModuleType):
                    if hasattr(module, name):
                        add(value)
                elif value not in modules and not _foreign(value):
                    add(value)
                    modules.append(value)

    def add(value):
        value = getattr(value, "py_func", getattr(value, "_defn", value))  # of a kernel, of an intrinsic
        if isinstance(value, types.FunctionType):
            if value in seen:
                return
            seen.add(value)
            add_code(value.__code__, value.__globals__)
            for default in (*(value.__defaults__ or ()), *(value.__kwdefaults__ or {}).items()):
                add(default)
            for cell in value.__closure__ or ():
                add(cell.cell_contents)
        elif isinstance(value, types.ModuleType):
            file = getattr(value, "__file__", None) or ""
            digest.update(f"{value.__name__} {getattr(value, '__version__', '')}".encode())
            if file.endswith(".py") and not _foreign(value):
                digest.update(Path(file).read_bytes())
        elif type(value).__module__.startswith("llvmlite"):  # its pickle changes when it has been used, its text may
            digest.update(repr(type(value)).encode())
        else:
            try:
                digest.update(pickle.dumps(value))
            except Exception:  # an object without a value of its own: its name has to do
                digest.update(repr(type(value)).encode())

    add(function)
    return digest.hexdigest()[:24]


class _Locator(_CacheLocator):
    def __init__(self, function, file):
        inside = Path(file).resolve().parent in package_folders()
        self._mark = str(function.__code__.co_firstlineno) if inside else deep_hash(function)

    def get_cache_path(self):
        return str(folder())

    def get_source_stamp(self):
        return fingerprint()

    def get_disambiguator(self):
        return self._mark

    @classmethod
    def from_function(cls, function, file):
        return cls(function, file)


class _Impl(CompileResultCacheImpl):
    _locator_classes = (_Locator,)

    def __init__(self, function):
        override = getattr(numba.config, "CACHE_LOCATOR_CLASSES", "")
        if not override:
            super().__init__(function)
            return
        numba.config.CACHE_LOCATOR_CLASSES = ""
        try:
            super().__init__(function)
        finally:
            numba.config.CACHE_LOCATOR_CLASSES = override


class KernelCache(FunctionCache):
    """Numba's cache of one function, in our folder, with a lock so that processes starting together compile once."""

    _impl_class = _Impl
    _lock = None
    _told = False

    def load_overload(self, sig, target_context):
        """Return the compiled function, or None; a miss takes the lock that save_overload gives back."""
        started = time.perf_counter()
        found = super().load_overload(sig, target_context)
        if found is None:
            self.release()  # of a compilation that was interrupted
            self._lock = _acquire(Path(self.cache_path) / f"{self._impl.filename_base}.lock")
            found = super().load_overload(sig, target_context)
        if found is None:
            statistics["misses"] += 1
            self._tell()
        else:
            statistics["hits"] += 1
            self.release()
        statistics["seconds"] += time.perf_counter() - started
        return found

    def save_overload(self, sig, data):
        """Store the compiled function and let waiting processes read it."""
        try:
            super().save_overload(sig, data)
        finally:
            self.release()

    def release(self):
        """Give the lock back, if it is held."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    @classmethod
    def _tell(cls):
        if not KernelCache._told and not os.environ.get("TSDYN_QUIET"):
            KernelCache._told = True
            print(
                "tsdyn: compiling kernels, once for this version and machine (about a minute) ...",
                file=sys.stderr,
                flush=True,
            )


def _acquire(path, patience=300.0):
    """Lock a file, wait while another process compiles the same kernel; None where files can't be locked."""
    try:
        import fcntl
    except ImportError:
        return None
    try:
        handle = open(path, "w")  # noqa: SIM115  (held until the kernel is saved)
    except OSError:
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


def cache_of(function):
    """Return the disk cache of a function, or Numba's null cache where nothing can be written."""
    return NullCache() if folder() is None else KernelCache(function)
