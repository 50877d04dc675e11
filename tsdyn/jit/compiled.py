"""Kernels with machine code of their own: `entry`s, which Python calls, and `Callback`s, which kernels call by address.

Both are cached on disk, and compiled or loaded when they are first needed. With a signature that is known before the
first call they can be compiled ahead of it, by worker processes (`tsdyn.ahead`).
"""

import contextlib
import os
import threading
import time

import numba
from numba.core.ccallback import CFunc
from numba.core.registry import cpu_target
from numba.core.typing import signature as numba_signature

from .cache import KernelCache, statistics
from .compiler import OPTIONS, Compiler
from .interrupts import prompt_interrupts

DEBUG = os.environ.get("TSDYN_DEBUG", "") not in ("", "0")
_lock, _within = threading.RLock(), threading.local()
table = [None]  # debug mode: what an address stands for; zero is no address
letters = {"i": numba.types.int64, "d": numba.types.float64, "p": numba.types.int64}
_letters = {**letters, "v": numba.types.float64[::1], "w": numba.types.int64[::1]}
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
        with prompt_interrupts():
            yield
    finally:
        if outermost:
            _within.block = False
            statistics["waited"] += time.perf_counter() - began


def entry(*arguments):
    """Decorate a function that Python calls with arrays: cached, and run without the GIL.

    With arguments it can be compiled ahead of its first call. They are strings of letters (those of a `Callback`, v and
    w vectors of floats and of integers) and values of the types of further arguments.
    """
    if len(arguments) == 1 and callable(arguments[0]):
        return _entry(arguments[0])

    def decorate(function):
        made = _entry(function)
        _entries[function] = arguments
        return made

    return decorate


def _entry(function):
    if DEBUG:
        return function
    dispatcher = numba.njit(nogil=True, pipeline_class=Compiler, **OPTIONS)(function)
    dispatcher._cache = KernelCache(function)
    dispatcher.compile = _compiling()(dispatcher.compile)
    return dispatcher


class Callback:
    """A cached kernel that others call by `address`; compiled or loaded when the address is first asked for.

    The signature has a letter an argument: i an integer, d a float, p the address of an array. It returns an integer.
    """

    def __init__(self, function, signature, result="i", allocates=False):
        self.py_func = getattr(function, "py_func", function)
        self.options = {**OPTIONS, "_nrt": allocates}
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

    def types(self):
        """Numba's types of the arguments, and of the result."""
        return tuple(letters[c] for c in self.signature), letters[self.result]

    def _compile(self):
        cfunc = CFunc(self.py_func, self.types(), locals={}, options=self.options, pipeline_class=Compiler)
        cfunc._cache = cache = KernelCache(self.py_func)
        try:
            with _compiling():
                cfunc.compile()
        finally:
            cache.release()
        self._cfunc = cfunc  # keeps the code alive
        return cfunc.address


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
    """Whether the cache on disk has the machine code."""
    if isinstance(kernel, Callback):
        arguments, result = kernel.types()
        key, cache = numba_signature(result, *arguments), KernelCache(kernel.py_func)
    else:
        key, cache = _types(kernel), kernel._cache
    return cache.has(key, cpu_target.target_context.codegen())


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
