"""Kernels with machine code of their own: `entry`s, which Python calls, and `Callback`s, which kernels call by address.

Both are cached on disk, and compiled or loaded when they are first needed. With a signature that is known before the
first call they can be compiled ahead of it, by worker processes (`tsdyn.ahead`).
"""

import contextlib
import os
import threading
import time
from functools import cached_property, partial, update_wrapper

import numba
from numba.extending import typeof_impl

from . import stock
from .cache import statistics
from .code_hash import deep_hash
from .compilers import attempt, callback_frames, current
from .interrupts import CollectionsDeferred, prompt_interrupts

# Users' functions, compiled once a process: equal source and constants share one compiled function.
#
# Compiled code is never freed, so compiled functions are kept and reused.

_made = {}


def compiled_once(kind, function, make):
    """What `make()` makes of a user's function, for use as `kind`; the same one for the same code and constants."""
    key = kind, deep_hash(function)
    found = _made.get(key)
    return _made.setdefault(key, make()) if found is None else found


OPTIONS = {"error_model": "numpy"}  # of every kernel
DEBUG = os.environ.get("TSDYN_DEBUG", "") not in ("", "0")
_lock, _within = threading.RLock(), threading.local()
table = [None]  # debug mode: what an address stands for; zero is no address
letters = {"i": numba.types.int64, "d": numba.types.float64, "p": numba.types.int64}
_letters = {**letters, "v": numba.types.float64[::1], "m": numba.types.float64[:, ::1], "w": numba.types.int64[::1]}
_entries = {}  # of functions: what their signatures are made of


def clock():
    """The time in s, of a clock that stands still while kernels are compiled or loaded."""
    return time.perf_counter() - statistics["waited"]


@contextlib.contextmanager
def _compiling():
    """A block that compiles a kernel or loads it."""
    began, outermost = time.perf_counter(), not getattr(_within, "block", False)
    _within.block = True
    try:
        with CollectionsDeferred(), prompt_interrupts(callback_frames()):
            yield
    finally:
        if outermost:
            _within.block = False
            statistics["waited"] += time.perf_counter() - began


def entry(*arguments):
    """Decorate a function that Python calls with arrays: cached, and run without the GIL.

    With arguments it can be compiled ahead of its first call. They are strings of letters (those of a `Callback`, v and
    m vectors and matrices of floats, w vectors of integers) and values of the types of further arguments.
    """
    if len(arguments) == 1 and callable(arguments[0]):
        return _entry(arguments[0])

    def decorate(function):
        made = _entry(function)
        _entries[function] = arguments
        return made

    return decorate


def _entry(function):
    return function if DEBUG else _for_python(function, {"nogil": True, **OPTIONS})


def _for_python(function, options, allocates=False):
    """A kernel that Python calls, compiled or loaded at its first call for some types of arguments."""
    plain = stock.entry(function, options, _compiling())
    if current() is stock:
        return plain

    def guarded(compile_own):
        def compile_for(arguments):
            with _compiling():
                return attempt(function, partial(compile_own, arguments), partial(plain.compile, arguments))

        return compile_for

    return current().entry(function, options, allocates, guarded)


def is_copy(function):
    """Whether a function, or its kernel, is a copy of one of tsdyn's (`kernels.specialised`)."""
    return getattr(function, "is_copy", False)


class Callee:
    """A kernel that kernels call; what Numba needs to compile it is made when a caller is compiled."""

    def __init__(self, py_func, options, allocates):
        self.py_func, self.targetoptions, self._allocates, self._made = py_func, options, allocates, {}
        update_wrapper(self, py_func)

    def dispatcher(self):
        """What Numba compiles it by."""
        way = current()
        if way not in self._made:
            self._made[way] = way.callee(self.py_func, self.targetoptions, self._allocates)
        return self._made[way]

    @cached_property
    def _from_python(self):
        return _for_python(self.py_func, self.targetoptions, self._allocates)

    def __call__(self, *arguments, **keywords):
        """For whoever tries a kernel: it is compiled, or loaded, for Python."""
        return self._from_python(*arguments, **keywords)

    def __reduce__(self):
        """By name, as functions are; a copy, which no module has under its name, by what it is made of."""
        return (Callee, (self.py_func, self.targetoptions, self._allocates)) if is_copy(self) else self.__qualname__


@typeof_impl.register(Callee)
def _type_of_callee(value, context):
    return numba.types.Dispatcher(value.dispatcher())


class Callback:
    """A cached kernel that others call by `address`; compiled or loaded when the address is first asked for.

    The signature has a letter an argument: i an integer, d a float, p the address of an array. It returns an integer.
    """

    def __init__(self, function, signature, result="i", allocates=False):
        self.py_func = getattr(function, "py_func", function)
        self.allocates = allocates
        self.signature = signature
        self.result = result
        self._address = None

    @property
    def address(self):
        """The address to hand to a kernel."""
        if self._address is None:
            with _lock:  # threads that ask together compile, or load, once
                if self._address is None:
                    self._address = self._register() if DEBUG else self._compile()
        return self._address

    def _register(self):
        table.append(self.py_func)
        return len(table) - 1

    def type(self):
        """Numba's signature."""
        return letters[self.result](*(letters[c] for c in self.signature))

    def _compile(self):
        given = self.py_func, self.type(), OPTIONS, self.allocates
        with _compiling():
            self._kept = attempt(self.py_func, lambda: current().callback(*given), partial(stock.callback, *given))
        return self._kept.address


def callback(signature, result="i"):
    """Decorate a function to make it a `Callback`."""
    return lambda function: Callback(function, signature, result)


def is_declared(value):
    """Whether it is a kernel whose signature is known before the first call."""
    return isinstance(value, Callback) or getattr(value, "py_func", None) in _entries


def is_loaded(kernel):
    """Whether this process has the machine code."""
    return kernel._address is not None if isinstance(kernel, Callback) else bool(kernel.overloads)


def is_stored(kernel):
    """Whether the machine code is on disk."""
    return current().is_stored(kernel.py_func, signature_of(kernel))


def signature_of(kernel):
    """Numba's signature of a declared kernel, or the types of its arguments."""
    return kernel.type() if isinstance(kernel, Callback) else _types(kernel)


def load(kernel):
    """Compile the kernel, or load it."""
    if isinstance(kernel, Callback):
        return kernel.address
    return kernel.compile(_types(kernel))


def _types(dispatcher):
    found = []
    for given in _entries[dispatcher.py_func]:
        found += [_letters[c] for c in given] if isinstance(given, str) else [numba.typeof(given)]
    return tuple(found)
