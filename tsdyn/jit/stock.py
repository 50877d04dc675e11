"""Kernels compiled by Numba's public interface alone: `njit`, `cfunc`, `intrinsic`, and Numba's own cache.

Numba stamps what it stores with one source file, and so answers with stale code after an edit of a callee elsewhere. A
function that is to be stored claims therefore to stand in a file of the kernel folder, empty, whose name contains the
hash of all code that it depends on.
"""

import types
from functools import cached_property

import numba
from numba import NumbaError
from numba.extending import intrinsic, overload_attribute

from . import cache
from .target import of_numba as target


def options(allocates):
    """What kernels have beside the options that `njit` documents: nothing."""
    return {}


def callee(function, options, allocates):
    """What compiles a kernel that kernels call."""
    return numba.njit(**options)(function)


def entry(function, options, around):
    """What compiles a kernel that Python calls; `around` decorates what compiles it."""
    return StockEntry(function, options, around)


class StockEntry:
    """A kernel that Python calls, compiled for the types of the arguments that it is given."""

    def __init__(self, function, options, around):
        self.py_func, self.targetoptions, self._around = function, options, around

    @cached_property
    def _dispatcher(self):
        copy, stored = _stamped(self.py_func)
        dispatcher = numba.njit(cache=stored, **self.targetoptions)(copy)
        own = dispatcher.compile

        def compile_for(arguments):
            tell = _counting(self.py_func, arguments)
            found = _loaded(self.py_func, lambda: own(arguments))
            tell(bool(dispatcher.stats.cache_hits.get(arguments)))
            return found

        dispatcher.compile = self._around(compile_for)
        return dispatcher

    def __call__(self, *arguments):
        """Call it, compiled for the types of these."""
        return self._dispatcher(*arguments)

    def compile(self, arguments):
        """Compile it for these types."""
        return self._dispatcher.compile(arguments)

    @property
    def overloads(self):
        """What is compiled, by the types of arguments."""
        return self._dispatcher.overloads


def callback(function, signature, options, allocates):
    """Compile a kernel that others call by address."""
    copy, stored = _stamped(function)
    tell = _counting(function, signature)
    made = _loaded(function, lambda: numba.cfunc(signature, cache=stored, **options)(copy))
    tell(made.cache_hits > 0)
    return made


def is_stored(function, signature):
    """Whether the cache on disk has the machine code."""
    folder = _folder()
    return folder is not None and _marker(folder, function, signature).exists()


def attributes(kind, resolve, lower):
    """Give all types of a class attributes: of the types resolve(kind, name), by the code of `lower`.

    Returns what to call with each type and the names of its attributes.
    """

    def expose(kind, names):
        for name in names:
            _expose(kind, name, resolve, lower)

    return expose


def _expose(kind, name, resolve, lower):
    @intrinsic
    def read(typing, value):
        def generate(context, builder, signature, arguments):
            return lower(context, builder, kind, arguments[0], name)

        return resolve(kind, name)(value), generate

    @overload_attribute(kind, name)
    def attribute(value):
        return lambda value: read(value)


def _folder():
    """Where Numba stores kernels, in the folder of kernels; None where nothing can be written."""
    if cache.folder() is None:
        return None
    folder = cache.folder() / "stock"
    folder.mkdir(exist_ok=True, mode=0o700)
    return folder


def _stamped(function):
    """The function, as of a file that is named after the hash of its code; and whether there is such a file."""
    folder = _folder()
    if folder is None:
        return function, False
    file = folder / f"{cache.name_of(function)}.py"
    try:
        if not file.exists():  # its time stays: older Numbas take it for that of the code
            file.touch()
    except OSError as error:
        cache.warn_unwritable(error)
        return function, False
    code, names = function.__code__.replace(co_filename=str(file)), function.__globals__
    copy = types.FunctionType(code, names, function.__name__, function.__defaults__, function.__closure__)
    for name in ("__kwdefaults__", "__module__", "__qualname__"):
        setattr(copy, name, getattr(function, name))
    return copy, True


def _loaded(function, compile_now):
    """Return compile_now(); where what Numba has stored of the function can't be loaded, once more without it."""
    try:
        return compile_now()
    except NumbaError:
        raise
    except Exception as error:
        folder = _folder()
        damaged = list(folder.rglob(f"{cache.name_of(function)}*.nb[ci]")) if folder else []
        for file in damaged:
            cache.report(file, error)
        if not damaged:
            raise
        return compile_now()


def _marker(folder, function, signature):
    """The file that says that a kernel is stored."""
    return folder / f"{cache.name_of(function)}-{cache.key_of(signature, target())}.stored"


def _counting(function, signature):
    """Announce a compilation; return what counts it, told whether the kernel was stored."""
    folder = _folder()
    marker = folder and _marker(folder, function, signature)
    if not (marker and marker.exists()):
        cache.tell()

    def tell(hit):
        cache.statistics["hits" if hit else "misses"] += 1
        if marker:
            marker.touch()

    return tell
