"""Loads that are users' functions of time and state: on points, bodies and joints, as kernels."""

from __future__ import annotations

import math
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Never, Self

import numpy as np

from ..errors import InvalidForce
from ..jit.compiled import compiled_once
from ..jit.kernels import kernel, part, specialised, stack
from ..jit.resident import spread
from ..maths.recurrences import rotated, rotation
from ..maths.vectors import rotate
from ..motions.signals import Signal, numbers_of, positional, starred
from ..motions.tracing import Untraceable, Writer, demand_same, retold, traced
from ..validation import label, one_of, shown_for_handle
from .force import callbacks
from .laws import Action, SceneLaw, arguments_of, instants, sees_scene
from .markers import TURN

if TYPE_CHECKING:
    from ..hints import AnyBody, Attachment, Floats, JointLaw, Random


# Users' functions of time and state as force kernels, with one set of callbacks for each function.

STATE = 13  # position, Euler parameters, velocity, angular velocity


class FunctionKernels(dict):
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
    return compiled_once(kind, plain, partial(FunctionKernels, kind, function))


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
    """A plain function of (t, state), of the array of its body."""
    return _two_arguments(value, what, error, "the array of its body", False)


def scene_load(value, what, error):
    """A plain function of (t, state), of the state of the scene."""
    return _two_arguments(value, what, error, "the state of the scene", True)


def _two_arguments(value, what, error, state, whole):
    if arguments_of(value) != 2 or sees_scene(value) != whole:
        raise error(
            f"{what} must stay a plain Python function of two arguments (t, state) of {state}, got "
            f"{value!r}{starred(value)}."
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


# Applied loads, the base of PointForce and Torque: constant, f(t) or f(t, state), in the ground or body frame.

FIRST = 0


class Given:
    """Mixed into forces of one vector, the attribute `given`, conjugate to their first marker.

    Parameters
    ----------
    frame : {"ground", "body"}
        The axes in which the vector is given.

    Raises
    ------
    InvalidForce
        If the vector is not three finite numbers or a function of t or of (t, state), or the frame is unknown.
    InvalidBody
        If a torque is on a point mass.
    """

    given, positive = "", ()

    def __new__(cls, *others: Any, frame: str = "ground", **more: Any) -> Self:
        """Choose the kernel by frame and by the sort of the vector."""
        if arguments_of(more.get(cls.given)) == 2:
            cls = variant(cls, GivenByScene if sees_scene(more[cls.given]) else GivenByState)
        elif isinstance(frame, str) and frame == "body":
            cls = variant(cls, GivenInBody)
        return super().__new__(cls)

    def take(self, value: Any, frame: str, hint: str) -> None:
        """Take the vector over, and the frame that it is in; hint is how to write it, with its unit."""
        self.frame = one_of(frame, ("ground", "body"), f"{self.name}: frame", InvalidForce)
        if value is None:
            raise InvalidForce(f"{self.name}: no {self.given} given; set {self.given}={hint}, or a function of time.")
        setattr(self, self.given, value)

    def demand_effect(self) -> None:
        """Zero is given, not forgotten: an action, an edit or a study may set another vector."""

    def parameters(self) -> tuple[Any, ...]:
        """The vector."""
        return Signal.places(getattr(self, self.given))

    @staticmethod
    def law(x, xd, par, t, out):
        """The vector as it is."""
        for i in range(3):
            out[i] = par[i] + 0.0 * x[i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        """The vector at order zero."""
        if k == 0:
            for i in range(3):
                out[i] = par[i]

    @staticmethod
    def driven_series(x, xd, par, k, s, out):
        """The vector's."""
        for i in range(3):
            out[i] = s[i, k]


class GivenInBody:
    """Mixed in before `Given`, with the markers' Parameters second: in axes of the body."""

    slots = 13

    @staticmethod
    def law(x, xd, par, t, out):
        """A(p_a) times the vector."""
        rotate(x[3:], par, out)
        for i in range(4):
            out[3 + i] = 0.0 * x[3 + i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of A(p) times the vector; rows of p, then of A."""
        for i in range(4):
            s[i, k] = x[3 + i]
        rotation(s, 0, 4, k)
        for i in range(3):
            out[i] = s[4 + i, k] * par[0] + s[7 + i, k] * par[1] + s[10 + i, k] * par[2]

    @staticmethod
    def driven_series(x, xd, par, k, s, out):
        """Of A(p) times the vector, in rows 13 to 15."""
        for i in range(4):
            s[i, k] = x[3 + i]
        rotation(s, 0, 4, k)
        out[0], out[1], out[2] = rotated(s, 4, 13, k)


@kernel
def given_series(x, par, k, s):
    """Coefficient k, a tuple of three, of the vector in rows 0 to 2 of s, turned where par says so; p is x[3:7]."""
    if par[0] == 0.0:
        return s[0, k], s[1, k], s[2, k]
    for i in range(4):
        s[3 + i, k] = x[3 + i]
    rotation(s, 3, 7, k)
    return rotated(s, 7, 0, k)


class GivenByState(ByState):
    """Mixed in before `Given`, with the markers Point, Parameters, Turn: a function of time and state.

    `first` is where in out the vector goes: 0 for a force, 7 for a torque.
    """

    first = 0
    arguments, given_numbers, slots, begin = (1, STATE), 3, 16, 1
    hint = (
        " Its state is the array (13,) of its body, as no function that it calls by name asks state for a method, such "
        "as state.angle(joint)."
    )

    @staticmethod
    def results(function, t, state):
        """Three numbers."""
        return function(t[0], state)

    @staticmethod
    def inputs(x, xd, par, k, first, s):
        """The state."""
        fill_state_series(x, xd, 0, k, first, s)
        for i in range(1, par.size):
            s[first + STATE - 1 + i, k] = par[i] if k == 0 else 0.0

    @staticmethod
    def series(x, xd, par, k, s, out):
        """The vector in rows 0 to 2, a force; rows of p, then of A."""
        out[0], out[1], out[2] = given_series(x, par, k, s)

    def parameters(self):
        """One flag: the vector is given in the body frame; then the numbers of the function."""
        return (float(self.frame == "body"), *super().parameters())

    @classmethod
    def _wrap(cls, inner, owner, **others):
        """The kernel of a user's function; others: as of `specialised`."""
        name = f"{owner.__qualname__}.{cls.given}"
        return specialised(_law, name, owner, function=inner, FIRST=cls.first, **others)


class GivenByScene(SceneLaw):
    """Mixed in before `Given`: a function of time and of the state of the scene."""

    turns = False

    def actions(self):
        """One for each component."""
        point = () if self.turns else (tuple(self.coordinates[0].tolist()),)
        frame = self.a if self.frame == "body" else None
        return [Action(self.turns, self.a, None, frame, tuple(e), *point) for e in np.eye(3).tolist()]


def _law(x, xd, par, t, out):
    state, given = stack(13), stack(3)
    fill_state(x, xd, 0, state)
    try:
        value = function(t, state, par)
        given[0], given[1], given[2] = value[0], value[1], value[2]
    except Exception:
        given[0], given[1], given[2] = math.nan, math.nan, math.nan
    for i in range(10):
        out[i] = 0.0
    if par[0] == 0.0:
        for i in range(3):
            out[FIRST + i] = given[i]
    else:
        rotate(x[3:], given, out[FIRST:])


# Base of JointTorque and JointForce: a function of time, joint coordinate and rate, continuous or sampled.


def law_of_joint(value, what, error):
    """Anything that can be called."""
    if not callable(value):
        raise error(f"{what} must be a function of (t, coordinate, rate), such as lambda t, x, v: 5.0, got {value!r}.")
    return value


class JointLoad:
    """Mixed into forces of one joint coordinate; the load does its work on that coordinate.

    With a period the load is held between instants and is what such a force remembers: see runs/driver.py.
    """

    loads, given = ("function",), "function"
    permanent = ("joint", "which")
    memory, positive = 1, ()
    quantities = MappingProxyType({"function": law_of_joint, "period": instants})
    coordinate = ""  # "angle" or "displacement"
    kind_of_example: Any = None  # a class of joints with such a coordinate and an axis
    remembers_angle = False  # of its joint, from the start of a run on

    def __new__(cls, *given: Any, period: float | None = None, **others: Any) -> Self:
        """Choose the kernel: held, or by the function; a copy has its class already."""
        continuous = (given or others) and period is None
        return super().__new__(variant(cls, ByState) if continuous else cls)

    def __init__(
        self, joint: Attachment, *, function: JointLaw, period: float | None = None, which: int = 0, name: str = ""
    ) -> None:
        self._join(joint, which, name)
        self.function, self.period = function, period

    def _join(self, joint, which, name):
        """Attach it to a coordinate of a joint."""
        kind = self._kind()
        name = label(name, kind, InvalidForce)
        geometries = self.geometries(joint) if hasattr(joint, "joint_coordinates") else []
        if not geometries:
            raise InvalidForce(
                f"{name or kind}: joint must be one with {self.coordinate}, got {shown_for_handle(joint)}."
            )
        if not isinstance(which, (int, np.integer)) or which not in range(len(geometries)):
            raise InvalidForce(
                f"{name or kind}: which must be from 0 to {len(geometries) - 1}, as {joint.name!r} has "
                f"{len(geometries)} of {self.coordinate}; got {which!r}."
            )
        self.__dict__.update(joint=joint, which=int(which))
        own, other = self.geometry[:2]
        super().__init__(own, other, self.coordinates, name)

    def _untitled(self, bodies):
        return f"{self._kind()}({self.joint.name})"

    @property
    def geometry(self) -> Any:
        """Where the coordinate is measured: a `element.AngleGeometry` or `DisplacementGeometry`."""
        return self.geometries(self.joint)[self.which]

    @property
    def coordinates(self) -> tuple[Floats, ...]:
        """Where the markers are, (3,) each: where the joint measures."""
        given = iter(self.directions(self.geometry))
        return tuple(np.zeros(3) if marker.code == TURN else np.array(next(given)) for marker in self.markers)

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an attribute, checked; where it acts is the joint's."""
        if name == "coordinates":
            return
        if name in (*self.permanent, "geometry") or name in [marker.argument for marker in self.markers]:
            raise self.error(f"{self.name}: {name} is that of its joint {self.joint.name!r}; set it there.")
        if name == "period" and self.added and (value is None) != (self.period is None):
            raise self.error(f"{self.name}: make a new one to change between a continuous and a sampled load.")
        super().__setattr__(name, value)

    def check(self) -> None:
        """A joint that the scene has; of a continuous load a plain function of three arguments."""
        self._demand_added(self.joint)
        if self.__dict__.get("period") is None and arguments_of(self.function) != 3:
            raise self.error(
                f"{self.name}: function must be a plain Python function of three arguments (t, {self.coordinate}, "
                f"rate), got {self.function!r}{starred(self.function)}. With period= it may be any object to be called "
                "so."
            )

    def parameters(self) -> tuple[Any, ...]:
        """None but what it remembers."""
        return ()

    @classmethod
    def example(cls, rng: Random, a: AnyBody, b: AnyBody) -> Self:
        """A damper that is sampled, on a joint that is added to the scene."""
        joint = cls.kind_of_example(a, b, axis_a=rng.normal(size=3), axis_b=rng.normal(size=3))
        return cls(a.scene.add(joint), function=lambda t, x, rate: -rate, period=0.1)
