"""Laws that see the whole scene: functions of time and of a state with all bodies and joints, as forces and torques."""

from __future__ import annotations

import contextlib
import dis
from types import CodeType, FunctionType, MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..jit.kernels import Callback
from ..motions.signals import numbers_of, starred
from ..motions.tracing import names_of
from ..validation import positive
from .loops import laws as loops
from .loops.constraint_series import SIGNATURE as SERIES
from .loops.coordinate_rows import SIGNATURE
from .loops.forces import JACOBIAN
from .loops.law_check import MARGIN
from .loops.law_check import SIGNATURE as CHECK

if TYPE_CHECKING:
    from ..hints import Function

METHODS = frozenset((  # of a state, and its attributes
    "t", "q", "qd", "qdd", "position", "velocity", "acceleration", "orientation", "rotation", "angular_velocity",
    "angular_acceleration", "angle", "angle_rate", "angle_acceleration", "displacement", "displacement_rate",
    "displacement_acceleration", "reaction", "multipliers",
))  # fmt: skip
KERNELS = MappingProxyType(
    {
        "force": Callback(loops.forces, SIGNATURE),
        "jacobian": Callback(loops.jacobian, JACOBIAN),
        "remember": Callback(loops.remembers, SIGNATURE),
        "series": Callback(loops.series, SERIES),
    }
)
CHECKS = MappingProxyType({"check": Callback(loops.check, CHECK), "margin": Callback(loops.margin, MARGIN)})


class LawKernels(dict):
    """The callbacks of one law: each law is run by itself; with those that check series where they are `checked`."""

    def __init__(self, checked=False):
        super().__init__({**KERNELS, **CHECKS} if checked else KERNELS)

    __hash__ = object.__hash__

    def __reduce__(self):
        return LawKernels, ("check" in self,)


class Action(NamedTuple):
    """What a value of a law acts as: a force or a torque on a body, and the opposite on another one.

    A force acts at a point of a, and the opposite on b at the same place.
    """

    turns: bool  # a torque
    a: Any
    b: Any  # None or the ground: nothing
    frame: Any  # the body in whose axes the direction is; None for the ground
    direction: tuple[float, ...] = ()  # its size multiplies the value; () for that from the point of a to one of b
    point: tuple[float, ...] = (0.0, 0.0, 0.0)  # of a
    other: tuple[float, ...] = ()  # the point of b that () refers to


class SceneLaw:
    """Mixed into forces whose user's function sees the whole scene; `given` names the attribute that holds it."""

    analytic = False
    period: float | None = None
    given: str
    positive = ()
    no_series = "its function can't be traced"
    checked = False  # whether its series are checked against the law, which isn't analytic everywhere
    each = ""  # what the numbers of the function are, in messages

    @staticmethod
    def law(x, xd, par, t, out):
        """Not used: the force is that of loops/laws.py."""

    @property
    def kernels(self) -> Any:
        """The callbacks of the present function, whatever its numbers."""
        function = getattr(self, self.given)
        if _code(self.__dict__.get("_of")) is not _code(function):
            self.__dict__.update(_kernels=LawKernels(self.checked), _of=function)
        return self.__dict__["_kernels"]

    @property
    def function_of_state(self) -> Any:
        """The user's function where it is asked at all times; a sampled one is none of the state."""
        if self.period is not None:
            raise AttributeError("function_of_state")
        return getattr(self, self.given)

    def forget(self) -> None:
        """It is traced again when the scene is packed again."""

    def parameters(self) -> tuple[float, ...]:
        """The numbers of the function, by keyword."""
        return tuple(numbers_of(getattr(self, self.given)).values())

    def actions(self) -> list[Action]:
        """What each value acts as."""
        raise NotImplementedError

    @property
    def bodies(self) -> tuple[Any, ...]:
        """The bodies that it acts on."""
        found = [body for one in self.actions() for body in (one.a, one.b) if body is not None and body.dimension]
        return tuple(dict.fromkeys(found))

    def results(self, function: Any, t: Any, state: Any, numbers: Any) -> list[Any]:
        """What a function makes of its arguments; numbers: of its keyword arguments, in their order."""
        given = function(t, state, **dict(zip(numbers_of(getattr(self, self.given)), numbers, strict=True)))
        return [given] if np.ndim(given) == 0 else list(np.asarray(given).ravel())


def _code(function):
    """What is the same for a function with other numbers; an object to be called is that itself."""
    return getattr(getattr(function, "py_func", function), "__code__", function)


def arguments_of(function):
    """The number of arguments of a plain Python function, but for numbers by keyword; 0 for anything else."""
    plain = getattr(function, "py_func", function)
    if not isinstance(plain, FunctionType) or starred(function):
        return 0
    if plain.__code__.co_kwonlyargcount != len(numbers_of(function)):
        return 0
    return plain.__code__.co_argcount


def scene_law(value: Any, what: str, error: Any) -> Any:
    """Anything that can be called with (t, state); raises `error` for anything else."""
    if not callable(value):
        raise error(f"{what} must be a function of (t, state), such as lambda t, state: 5.0, got {value!r}.")
    if arguments_of(value) not in (0, 2) or starred(value):
        raise error(f"{what} must be a function of two arguments (t, state), got {value!r}{starred(value)}.")
    return value


def instants(value: Any, what: str, error: Any) -> float | None:
    """A period, s, or None."""
    return None if value is None else positive(value, f"{what} (s)", error)


def sees_scene(function: Function, known: tuple[Any, ...] = ()) -> bool:
    """Whether a function, or one that it calls by name, asks an argument for a method of a state: state.angle(...).

    It then gets the state of the scene; one that doesn't gets the array of its own body.
    """
    plain = getattr(function, "py_func", function)
    if not isinstance(plain, FunctionType) or plain in known:
        return False
    code = plain.__code__
    if _asks(code, code.co_varnames[: code.co_argcount]):
        return True
    return any(sees_scene(each, (*known, plain)) for each in captured(plain))


def _asks(code, arguments):
    """Whether a function, or one within it such as a comprehension, asks one of the arguments for a method."""
    before = None
    for each in dis.get_instructions(code):
        asks = each.opname in ("LOAD_ATTR", "LOAD_METHOD") and each.argval in METHODS
        if asks and before in arguments:
            return True
        loads = each.opname.startswith(("LOAD_FAST", "LOAD_DEREF"))
        before = (each.argval[-1] if isinstance(each.argval, tuple) else each.argval) if loads else None
    return any(_asks(inner, arguments) for inner in code.co_consts if isinstance(inner, CodeType))


def captured(plain: FunctionType) -> list[Any]:
    """The values that a plain function looks up beyond its arguments: of its closure, and globals by name."""
    found = []
    for cell in plain.__closure__ or ():
        with contextlib.suppress(ValueError):  # an empty cell
            found.append(cell.cell_contents)
    names = names_of(plain.__code__)
    return found + [plain.__globals__[name] for name in sorted(names) if name in plain.__globals__]
