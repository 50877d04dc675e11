"""What an integrator is: a small object that holds its settings and names the kernel that makes a step."""

from copy import copy
from types import MappingProxyType

from ..calls import fitting
from ..validation import positive
from .diagonally_implicit import implicit_step
from .explicit import embedded_error, nystrom_step, runge_kutta_step, second_embedded_error, second_order_step
from .interpolants import HERMITE, HERMITE_FIRST_ORDER, hermite_second
from .tableau import RungeKuttaTableau

_registry = {}


class Integrator:
    """Base class of all methods; one file each.

    A method gives, for a second-order system vdd = f(t, v, vd) and for a first-order one (the Maggi/Kane form), a step
    kernel (see explicit.py) and the numbers that the kernel reads.

    Attributes
    ----------
    order : int
        Order of the error of v and vd at fixed time.
    step : float, s
        The fixed step; None for an adaptive run.
    margin : float
        How far below the tolerances one step's error is kept: errors of many steps add up.
    errors : tuple of Callback
        The kernels of the error estimate; a second one tempers the first (Hairer's combination of two orders).
    """

    order = 0
    embedded_order = 0  # of the error estimate; zero for a method that has none
    implicit = False
    driver = "steps"  # which one runs it; see request.py
    stability_limit = 0.0  # h |lambda| that its last stage and the step's end, of one time, may show; 0: not watched
    rtol = atol = max_step = first_step = None
    margin, errors = 30.0, (embedded_error,)

    def __init_subclass__(cls, **keywords):
        super().__init_subclass__(**keywords)
        if "__init__" in vars(cls):
            cls.__init__ = fitting(cls.__init__)
        if cls.order:
            _registry[cls.__name__.lower().replace("_", "")] = cls

    @fitting
    def __init__(self, step):
        self.step = positive(step, f"{type(self).__name__}: step (s)")

    def bounded(self, longest):
        """Return the method with steps of at most `longest`, s."""
        method = copy(self)
        method.max_step = min(self.max_step or longest, longest)
        method.step = None if self.step is None else min(self.step, longest)
        return method

    def kernel(self, first_order):
        """Return (step kernel, its numbers (float64), floats of memory it needs for systems of sizes nx, ny)."""
        raise NotImplementedError

    def interpolant(self, first_order):
        """Return the `Interpolant` of its steps; the one for every method uses their two ends alone."""
        return HERMITE_FIRST_ORDER if first_order else HERMITE

    def __repr__(self):
        return f"{type(self).__name__}(step={self.step:g})"


class ExplicitNystrom(Integrator):
    """A method that is a `NystromTableau`, with the Runge-Kutta tableau of its first-order equivalent."""

    tableau = None
    first_order = None

    def kernel(self, first_order):
        """The numbers of the tableau, and the kernel that steps by it."""
        tableau = self.first_order if first_order else self.tableau
        stages = len(tableau.c)
        if first_order:
            return runge_kutta_step, tableau.numbers, lambda nx, ny: (stages + 1) * (nx + ny)
        return nystrom_step, tableau.numbers, lambda nx, ny: (stages + 2) * nx


class Adaptive(Integrator):
    """A method that chooses its steps by an error estimate, unless it is given a fixed one."""

    def __init__(self, rtol=1e-6, atol=1e-8, step=None, max_step=None, first_step=None):
        what = type(self).__name__
        self.rtol, self.atol = positive(rtol, f"{what}: rtol"), positive(atol, f"{what}: atol")
        self.step = None if step is None else positive(step, f"{what}: step (s)")
        self.max_step = None if max_step is None else positive(max_step, f"{what}: max_step (s)")
        self.first_step = None if first_step is None else positive(first_step, f"{what}: first_step (s)")

    @property
    def stages(self):
        """Evaluations that a step takes."""
        return len(self.tableau.c)

    def step_tolerances(self):
        """Return (rtol, atol) that each step's error is held to."""
        return self.rtol / self.margin, self.atol / self.margin

    def __repr__(self):
        settings = f"rtol={self.rtol:g}, atol={self.atol:g}" if self.step is None else f"step={self.step:g}"
        return f"{type(self).__name__}({settings})"


class ExplicitRungeKutta(Adaptive):
    """A method that is a `RungeKuttaTableau` with an error estimate, applied to (v, vd)."""

    tableau = None

    def __init_subclass__(cls, **keywords):
        super().__init_subclass__(**keywords)
        if isinstance(cls.tableau, RungeKuttaTableau):  # and not one that is made when first used
            cls.embedded_order = cls.tableau.embedded_order
            cls.errors = (embedded_error, second_embedded_error)[: 2 if cls.tableau.second_error else 1]

    def kernel(self, first_order):
        """The numbers of the tableau, and the kernel that steps by it."""
        stages = len(self.tableau.c)
        step = runge_kutta_step if first_order else second_order_step
        return step, self.tableau.numbers, lambda nx, ny: (stages + 1) * (nx + ny)


class DiagonallyImplicit(Adaptive):
    """A method that is an `ImplicitTableau`; it serves the tangent-space form.

    One stiffness and damping, exact, and one factorised iteration matrix are kept over iterations, stages, steps and
    charts until the measured contraction says otherwise.
    """

    tableau = None
    implicit = True
    second = hermite_second  # accelerations between the ends of a step

    def __init_subclass__(cls, **keywords):
        super().__init_subclass__(**keywords)
        cls.embedded_order = cls.tableau.embedded_order

    def kernel(self, first_order):
        """The numbers of the tableau, and the kernel that steps by it."""
        stages = len(self.tableau.c)
        return implicit_step, self.tableau.numbers, lambda nx, ny: (stages + 1) * (nx + ny) + 6 * nx + 1


def registered():
    """Return every integrator class known, by its name in lower case."""
    return MappingProxyType(_registry)
