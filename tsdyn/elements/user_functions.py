"""Users' functions of time and state as force kernels, with one set of callbacks for each function."""

from __future__ import annotations

import math
from functools import partial
from types import FunctionType
from typing import Any

from ..jit.compiled_once import compiled_once
from ..jit.kernels import kernel, part, specialised
from ..jit.spread import spread
from ..motions.keywords import numbers_of, positional, starred
from ..motions.state_program import Writer
from ..motions.tracing import Untraceable, demand_same, retold, traced
from .force import callbacks

STATE = 13  # position, Euler parameters, velocity, angular velocity


class Kernels(dict):
    """The callbacks of one kind with one function; pickled as the two."""

    def __init__(self, kind, function):
        self.names = tuple(numbers_of(function))
        plain = positional(function) if self.names else function
        functions = {"law": kind._wrap(_with_numbers(kind, plain, len(self.names)), plain)}
        if kind.memory:
            functions["remember"] = kind.remember
        series = {name: kind.own_kernels[name] for name in ("series", "check")}
        super().__init__({**callbacks(kind, functions, plain), **series})
        self.made_of, self.programs = (kind, function), {}

    def program(self, numbers):
        """The program of the function, a list of floats, for forces with so many parameters.

        Raises
        ------
        Untraceable
            If the function can't be traced.
        """
        if numbers not in self.programs:
            try:
                self.programs[numbers] = _program(*self.made_of, self.names, numbers)
            except Untraceable as reason:
                self.programs[numbers] = reason
        if isinstance(self.programs[numbers], Untraceable):
            raise self.programs[numbers]
        return self.programs[numbers]

    __hash__ = object.__hash__

    def __reduce__(self):
        return kernels_of, self.made_of


def _program(kind, function, names, numbers):
    """What `Kernels.program` gives; names: of the function's numbers."""
    counts, first = kind.arguments, sum(kind.arguments)
    if names or kind.has_numbers:
        counts = (*counts, len(names) or numbers)
    results = traced(_results(kind, retold(function), names), counts, kind.given_numbers)
    demand_same(results, _results(kind, getattr(function, "py_func", function), names), counts)
    fixed = range(first, sum(counts))
    return Writer(results, sum(counts), fixed, kind.slots, kind.place).numbers()


def _results(kind, function, names):
    """What a function makes of its arguments, the last of which are its numbers, if it has names for some."""
    if not names:
        return partial(kind.results, function)
    return lambda *given: kind.results(partial(function, **dict(zip(names, given[-1], strict=True))), *given[:-1])


def kernels_of(kind, function):
    """The kernels of a kind with a user's function; the same ones for the same two, whatever the function's numbers."""
    function = getattr(function, "py_func", function)
    plain = positional(function) if numbers_of(function) else function
    return compiled_once(kind, plain, partial(Kernels, kind, function))


BEGIN = COUNT = 0  # where the numbers of a function are in par; filled in, as is the function


def _bare_of_state(t, state, par):
    return function(t, state)


def _bare_of_joint(t, coordinate, rate, par):
    return function(t, coordinate, rate)


def _tuned_of_state(t, state, par):
    return function(t, state, *spread(par[BEGIN:], COUNT))


def _tuned_of_joint(t, coordinate, rate, par):
    return function(t, coordinate, rate, *spread(par[BEGIN:], COUNT))


def _with_numbers(kind, plain, count):
    """The function as a kernel of its arguments and par; that of a kind whose function takes par itself is as it is."""
    inner = kernel(plain, allocates=True)
    if kind.has_numbers:
        return inner
    of_state = len(kind.arguments) == 2
    tuned, bare = (_tuned_of_state, _bare_of_state) if of_state else (_tuned_of_joint, _bare_of_joint)
    name = f"{plain.__qualname__}.{kind.__name__}.call"
    call = specialised(tuned if count else bare, name, plain, function=inner, BEGIN=kind.begin, COUNT=count)
    return kernel(call, allocates=True)


def arguments_of(function):
    """The number of arguments of a plain Python function, but for numbers by keyword; 0 for anything else."""
    plain = getattr(function, "py_func", function)
    if not isinstance(plain, FunctionType) or starred(function):
        return 0
    if plain.__code__.co_kwonlyargcount != len(numbers_of(function)):
        return 0
    return plain.__code__.co_argcount


@kernel
def fill_state_series(x, xd, first, k, row, s):
    """Coefficient k of `fill_state`, into rows from `row` on."""
    for i in range(7):
        s[row + i, k] = x[first + i]
    for i in range(3):
        s[row + 7 + i, k] = xd[first + i]
        s[row + 10 + i, k] = xd[first + 7 + i]


@kernel
def fill_state(x, xd, first, out):
    """out (13,) from the markers Point, Parameters, Turn that begin at `first`."""
    for i in range(7):
        out[i] = x[first + i]
    for i in range(3):
        out[7 + i] = xd[first + i]
        out[10 + i] = xd[first + 7 + i]


def state_load(value, what, error):
    """A plain function of (t, state)."""
    if arguments_of(value) != 2:
        raise error(
            f"{what} must stay a plain Python function of two arguments (t, state), got {value!r}{starred(value)}."
        )
    return value


def variant(cls, mixin):
    """The private subclass of a public class that has a mixin, or the class itself where there is none."""
    private = (kind for kind in cls.__subclasses__() if kind.__name__.startswith("_"))
    return next((kind for kind in private if issubclass(kind, mixin)), cls)


function = None  # filled in by `ByState`


@part
def load_at(t, coordinate, rate, par):
    """The load of a user's function of a joint coordinate; NaN if it raises."""
    load = math.nan
    try:
        load = float(function(t, coordinate, rate, par))
    except Exception:
        load = math.nan
    return load


class ByState:
    """Mixed into forces that are given by a user's function, which the attribute named by `given` holds.

    Where the function can be traced, the series are those of its program: the kernel `inputs(x, xd, par, k, first, s)`
    writes coefficient k of the arguments but t into rows from `first` on, and `series` makes the law of the results, in
    rows from `place` on.
    """

    analytic = False
    sharp = True
    template: Any = None  # the law, with the name `function` to be filled in
    arguments: tuple[int, ...] = ()  # how many numbers each has, t first
    has_numbers = False  # whether par is one more
    given_numbers, place = 1, 0  # results, and their first row
    begin = 0  # where the numbers of the function are in par

    @staticmethod
    def results(function, *arguments):
        """What a function makes of its arguments, each an array: `given_numbers` values."""
        return [function(*(each[0] for each in arguments))]

    @classmethod
    def _wrap(cls, inner, owner, **others):
        """Return the law with a user's function, compiled with its file; others: as of `specialised`."""
        return specialised(cls.template, f"{owner.__qualname__}.{cls.__name__}", owner, function=inner, **others)

    @staticmethod
    def law(x, xd, par, t, out):
        """Of no function: what instances replace."""
        for i in range(x.size):
            out[i] = math.nan

    @property
    def kernels(self):
        """The callbacks of the present function."""
        function = self.function_of_state
        if self.__dict__.get("_of") is not function:
            self.__dict__["_kernels"], self.__dict__["_of"] = kernels_of(type(self), function), function
        return self.__dict__["_kernels"]

    @property
    def function_of_state(self) -> Any:
        """The user's function."""
        return getattr(self, self.given)

    def forget(self) -> None:
        """Drop its compiled form; it is made again when asked for."""
        self.__dict__.pop("_of", None)

    def check(self):
        """Nothing is known of a function."""

    def parameters(self):
        """The numbers of the function, by keyword."""
        return tuple(numbers_of(self.function_of_state).values())
