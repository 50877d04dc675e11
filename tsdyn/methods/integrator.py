"""The interface of an integrator: an object that holds the settings and names the step kernel."""

from __future__ import annotations

from copy import copy
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

from ..calls import complete_docstring, fitting
from ..jit.code_hash import is_ours
from ..validation import checked_once, positive
from .collocation import CollocationTableau, interpolant_of, second_derivative
from .collocation_step import collocation_step
from .collocation_step import memory_of as collocation_memory
from .diagonally_implicit import implicit_step, memory_of
from .explicit import embedded_error, nystrom_step, runge_kutta_step, second_embedded_error, second_order_step
from .interpolants import HERMITE, HERMITE_FIRST_ORDER, hermite_second
from .tableau import ImplicitTableau, NystromTableau, RungeKuttaTableau

if TYPE_CHECKING:
    from ..hints import Mapping, StepKernel

_registry = {}


class Integrator:
    """Base class of all methods; one file each.

    A method gives, for a second-order system vdd = f(t, v, vd) and for a first-order one (the Maggi/Kane form), a step
    kernel (see explicit.py) and the numbers that the kernel reads.

    Parameters
    ----------
    step : float, s, optional
        A fixed step, instead of tolerances.
    max_step, first_step : float, s, optional
        Upper bound on the steps, and the first step to try.

    Raises
    ------
    InvalidArgument
        If a tolerance or a step is not positive and finite.

    Attributes
    ----------
    order : int
        Order of the error of v and vd at fixed time.
    step : float, s
        The fixed step; None for an adaptive run.
    safety : float
        The tolerances over the error that one step may make: errors of many steps add up.
    errors : tuple of Callback
        The kernels of the error estimate; a second one tempers the first (Hairer's combination of two orders).

    Examples
    --------
    >>> import tsdyn as ts
    >>> isinstance(ts.integrators.Nystrom4(step=0.01), ts.Integrator)
    True
    """

    order = 0
    embedded_order = 0  # of the error estimate; zero for a method that has none
    implicit = False
    coupled = 0  # stages that an implicit method solves at once
    driver = "steps"  # which one runs it; see task.py
    stability_limit = 0.0  # h |lambda| that its last stage and the step's end, of one time, may show; 0: not watched
    rtol: float | None = None
    atol: float | None = None
    step: float | None
    max_step: float | None = None
    first_step: float | None = None
    safety: float = 30.0
    errors: tuple[Any, ...] = (embedded_error,)

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if "__init__" in vars(cls):
            cls.__init__ = fitting(cls.__init__)
        if "margin" in vars(cls):  # another name of `safety`
            cls.safety = cls.margin
        positive(cls.safety, f"{cls.__name__}: safety")
        complete_docstring(cls)
        if cls.order:
            _registry[cls.__name__.lower().replace("_", "")] = cls

    @fitting
    def __init__(self, step: float) -> None:
        self.step = positive(step, f"{type(self).__name__}: step (s)")

    def __repr__(self) -> str:
        return f"{type(self).__name__}(step={self.step:g})"

    def bounded(self, longest: float) -> Self:
        """Return the method with steps of at most `longest`, s."""
        method = copy(self)
        method.max_step = min(self.max_step or longest, longest)
        method.step = None if self.step is None else min(self.step, longest)
        return method

    def kernel(self, first_order: bool) -> StepKernel:
        """Return (step kernel, its numbers (float64), floats of memory it needs for systems of sizes nx, ny)."""
        raise NotImplementedError

    def interpolant(self, first_order: bool) -> Any:
        """Return the `Interpolant` of its steps; the one for every method uses their two ends alone."""
        return HERMITE_FIRST_ORDER if first_order else HERMITE


class ExplicitNystrom(Integrator):
    """A method that is a `NystromTableau`, with the Runge-Kutta tableau of its first-order equivalent.

    Examples
    --------
    The midpoint rule:

    >>> import tsdyn as ts
    >>> class Midpoint(ts.ExplicitNystrom):
    ...     order = 2
    ...     tableau = ts.NystromTableau(
    ...         a=((), (1 / 2,)), abar=((), (1 / 8,)), b=(0, 1), bbar=(0, 1 / 2), c=(0, 1 / 2), order=2
    ...     )
    ...     first_order = ts.RungeKuttaTableau(a=((), (1 / 2,)), b=(0, 1), c=(0, 1 / 2), order=2)
    >>> Midpoint(step=1e-3)
    Midpoint(step=0.001)
    """

    tableau: NystromTableau | None = None
    first_order: RungeKuttaTableau | None = None

    def kernel(self, first_order: bool) -> StepKernel:
        """The numbers of the tableau, and the kernel that steps by it."""
        tableau = self.first_order if first_order else self.tableau
        stages = len(tableau.c)
        if first_order:
            return runge_kutta_step, tableau.numbers, lambda nx, ny: (stages + 1) * (nx + ny)
        return nystrom_step, tableau.numbers, lambda nx, ny: (stages + 2) * nx


class Adaptive(Integrator):
    """A method that chooses its steps by an error estimate, unless it is given a fixed one.

    Parameters
    ----------
    rtol, atol : float; default 1e-6, 1e-8
        The error of each step is kept below (atol + rtol |value|) / `safety`, in the root mean square over coordinates
        and velocities, so that the error accumulated over a run is of the size of the tolerances.

    Examples
    --------
    >>> import tsdyn as ts
    >>> method = ts.integrators.RK45(rtol=1e-6, max_step=0.1)
    >>> isinstance(method, ts.Adaptive), method
    (True, RK45(rtol=1e-06, atol=1e-08))
    """

    def __init__(
        self,
        rtol: float = 1e-6,
        atol: float = 1e-8,
        step: float | None = None,
        max_step: float | None = None,
        first_step: float | None = None,
    ) -> None:
        what = type(self).__name__
        self.rtol, self.atol = positive(rtol, f"{what}: rtol"), positive(atol, f"{what}: atol")
        self.step = None if step is None else positive(step, f"{what}: step (s)")
        self.max_step = None if max_step is None else positive(max_step, f"{what}: max_step (s)")
        self.first_step = None if first_step is None else positive(first_step, f"{what}: first_step (s)")

    @property
    def stages(self) -> int:
        """Evaluations that a step takes."""
        return len(self.tableau.c)

    def step_tolerances(self) -> tuple[float, float]:
        """Return (rtol, atol) that each step's error is held to."""
        return self.rtol / self.safety, self.atol / self.safety

    def __repr__(self) -> str:
        settings = f"rtol={self.rtol:g}, atol={self.atol:g}" if self.step is None else f"step={self.step:g}"
        return f"{type(self).__name__}({settings})"


class ExplicitRungeKutta(Adaptive):
    """A method that is a `RungeKuttaTableau` with an error estimate, applied to (v, vd).

    Examples
    --------
    The pair of Bogacki and Shampine, of order 3(2):

    >>> import tsdyn as ts
    >>> class BogackiShampine(ts.ExplicitRungeKutta):
    ...     order = 3
    ...     tableau = ts.RungeKuttaTableau(
    ...         a=((), (1 / 2,), (0, 3 / 4)), b=(2 / 9, 1 / 3, 4 / 9), c=(0, 1 / 2, 3 / 4), order=3,
    ...         error=(-5 / 72, 1 / 12, 1 / 9, -1 / 8), embedded_order=2,
    ...     )
    >>> BogackiShampine(rtol=1e-4)
    BogackiShampine(rtol=0.0001, atol=1e-08)
    """

    tableau: Any = None  # RungeKuttaTableau, or a property that makes one

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if isinstance(cls.tableau, RungeKuttaTableau):  # and not one that is made when first used
            cls.embedded_order = cls.tableau.embedded_order
            cls.errors = (embedded_error, second_embedded_error)[: 2 if cls.tableau.second_error else 1]

    def kernel(self, first_order: bool) -> StepKernel:
        """The numbers of the tableau, and the kernel that steps by it."""
        stages = len(self.tableau.c)
        step = runge_kutta_step if first_order else second_order_step
        return step, self.tableau.numbers, lambda nx, ny: (stages + 1) * (nx + ny)


class DiagonallyImplicit(Adaptive):
    """A method that is an `ImplicitTableau`; it serves the tangent form and the null-space form.

    One stiffness and damping, and one factorised iteration matrix, sparse in the tangent form and dense in the
    null-space form, are kept over iterations, stages, steps and charts until the measured contraction says otherwise.

    Examples
    --------
    The trapezoidal rule, with fixed steps:

    >>> import tsdyn as ts
    >>> class Trapezoid(ts.DiagonallyImplicit):
    ...     order = 2
    ...     tableau = ts.ImplicitTableau(a=((0,), (1 / 2, 1 / 2)), c=(0, 1), order=2, embedded_order=2)
    >>> Trapezoid(step=1e-3)
    Trapezoid(step=0.001)
    """

    tableau: ImplicitTableau | None = None
    implicit = True
    second = hermite_second  # accelerations between the ends of a step

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        cls.embedded_order = cls.tableau.embedded_order

    def kernel(self, first_order: bool) -> StepKernel:
        """The numbers of the tableau, and the kernel that steps by it."""
        stages = len(self.tableau.c)
        return implicit_step, self.tableau.numbers, lambda nx, ny: memory_of(stages, nx, ny)


class Collocation(Adaptive):
    """A method that is a `CollocationTableau`, for stiff scenes in the tangent form.

    All stages of a step are solved at once, by one real factorised matrix and one complex one for each further pair of
    stages, kept over iterations, steps and charts. Order reduction begins at the number of stages only.

    Examples
    --------
    Radau IIA of order 5:

    >>> import tsdyn as ts
    >>> root = 6**0.5
    >>> class Radau5(ts.Collocation):
    ...     order = 5
    ...     tableau = ts.CollocationTableau(((4 - root) / 10, (4 + root) / 10, 1), order=5)
    >>> Radau5(rtol=1e-6)
    Radau5(rtol=1e-06, atol=1e-08)
    """

    tableau: Any = None  # CollocationTableau, or a property that gives one
    implicit = True
    second = second_derivative

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if isinstance(cls.tableau, CollocationTableau):
            cls.embedded_order = cls.coupled = len(cls.tableau.nodes)

    def kernel(self, first_order: bool) -> StepKernel:
        """The numbers of the tableau, and the kernel that steps by it."""
        stages = self.coupled
        return collocation_step, self.tableau.numbers, lambda nx, ny: collocation_memory(stages, nx)

    def interpolant(self, first_order: bool) -> Any:
        """The polynomials that the stages lie on."""
        return interpolant_of(self.coupled)


def frozen(method: Integrator) -> Integrator:
    """Return a method as it is now, the same object as long as it has the same attributes; itself if it isn't plain."""
    known = vars(method)
    return _frozen(type(method), (*known,), *known.values()) if is_plain(method) else method


@checked_once
def _frozen(kind, names, *values):
    method = kind.__new__(kind)
    vars(method).update(zip(names, values, strict=True))
    return method


def is_plain(method: Integrator) -> bool:
    """Whether a method is one of tsdyn's, with its own driver: numbers among its attributes say all about it."""
    return is_own(type(method)) and "driver" not in vars(method)


@cache
def is_own(kind: type[Integrator]) -> bool:
    """Whether a class is one of tsdyn's."""
    return is_ours(kind.__module__)


def registered() -> Mapping[str, type[Integrator]]:
    """Return every integrator class known, by its name in lower case."""
    return MappingProxyType(_registry)
