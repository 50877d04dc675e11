"""`benchmark`: work-precision of integration methods on a user's scene."""

from __future__ import annotations

import contextlib
import signal
import threading
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..calls import fitting
from ..errors import InvalidArgument, Status
from ..formulations.registry import formulation as find_formulation
from ..methods.integrator import Integrator, registered
from ..simulation.scene import Scene
from ..simulation.simulate import simulate
from ..validation import floats, positive, unknown_name, whole
from .reference_solution import Reference, agreed, errors
from .report import Benchmark, Row

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..hints import ArrayLike, Formulation, Methods, Span


@fitting
def benchmark(  # many arguments, by name: those of runs, and of how they are measured
    scene: Scene,
    methods: Methods | None = None,
    tolerances: Sequence[float] = (1e-4, 1e-6, 1e-8, 1e-10),
    t_span: Span = (0.0, 10.0),
    *,
    steps: Sequence[float] = (),
    t_eval: ArrayLike | None = None,
    repeats: int = 3,
    formulation: Formulation = "tangent",
    constraint_tol: float = 1e-12,
    max_steps: int = 200_000,
    reference: Reference | None = None,
    progress: Callable[[float], object] | None = None,
) -> Benchmark:
    """Measure run time against error of integration methods on a scene; the scene is not changed.

    Parameters
    ----------
    scene : Scene
    methods : sequence, or dict of label to method, optional
        Each a name ("rk45"), an Integrator class, or a callable (rtol, atol) -> instance; a class or name of a method
        without an error estimate runs with each of `steps`. Default all known adaptive methods that serve the
        formulation.
    tolerances : sequence of float
        Values of rtol and atol.
    t_span : (float, float), s
    steps : sequence of float, s
        For methods with fixed step.
    t_eval : array_like, s, optional
        Times of error evaluation; default 101 over t_span. Ignored with a reference.
    repeats : int
        Timed runs of each method and tolerance, interleaved; their median is reported.
    formulation, constraint_tol
        As for `simulate`. The reference always uses the tangent-space ODE.
    max_steps : int
        A run with more steps is reported as failed.
    reference : reference_solution.Reference, optional
        Default: two methods, refined until they agree.
    progress : callable, optional
        Receives the fraction done, 0 to 1.

    Returns
    -------
    Benchmark
        With `rows`, `table()` and `plot()`. A run that fails or is refused is reported in its row. After Ctrl-C the
        result holds the measurements so far, and `interrupted` is True.

    Raises
    ------
    TsdynError
        Before anything is measured, if an argument is wrong, the scene can't be run, or has no reference.

    Examples
    --------
    A pendulum by two methods, at one tolerance only:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> report = ts.benchmark(scene, ["rk45", "taylor"], tolerances=(1e-6,), t_span=(0, 1), repeats=1)
    >>> [(row.method, row.value, row.status) for row in report.rows]
    [('RK45', 1e-06, 'success'), ('Taylor', 1e-06, 'success')]
    """
    if not isinstance(scene, Scene):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    form = find_formulation(formulation)
    tolerances = _positives(tolerances, "tolerances")
    steps = _positives(steps, "steps", " (s)")
    if repeats is None or max_steps is None:
        raise InvalidArgument(
            f"repeats and max_steps must be positive whole numbers, got {repeats!r} and {max_steps!r}."
        )
    repeats, max_steps = whole(repeats, "repeats"), whole(max_steps, "max_steps")
    if progress is not None and not callable(progress):
        raise InvalidArgument(f"progress must be a callable that is given the fraction done, got {progress!r}.")
    if reference is not None and not isinstance(reference, Reference):
        raise InvalidArgument(f"reference must be a reference_solution.Reference of benchmarking, got {reference!r}.")
    plan = _plan(methods, tolerances, steps, form)
    t_span = _span(t_span)
    times = _times(t_eval, t_span) if reference is None else reference.t
    run = partial(
        simulate, scene, t_span, t_eval=times, formulation=formulation, constraint_tol=constraint_tol,
        max_steps=max_steps,
    )  # fmt: skip
    simulate(scene, t_span, t_eval=times, formulation=formulation, constraint_tol=constraint_tol, max_steps=1)
    report = progress or (lambda fraction: None)
    rows, interrupted = [], False
    with _interrupts() as pressed:
        try:
            reference = reference or agreed(scene, t_span, times, max_steps)
            _measure(plan, run, reference, repeats, rows, report, pressed)
        except KeyboardInterrupt:
            interrupted = True
    return Benchmark(tuple(rows), reference, t_span, formulation, repeats, interrupted)


def _measure(plan, run, reference, repeats, rows, report, pressed):
    """Run everything once for the errors, which compiles the kernels, then the timed rounds."""
    total, made = len(plan) * (1 + repeats), []
    for i, (label, setting, value, make) in enumerate(plan):
        solution, message = _try(make, run, pressed)
        off = errors(solution, reference) if message == "" else (np.nan, np.nan)
        rows.append(Row.of(label, setting, value, solution, off, reference.trusted, message))
        if message == "":
            made.append((i, make))
        report((i + 1) / total)
    seconds = {i: [] for i, _ in made}
    for turn in range(repeats):
        for i, make in made:
            solution, message = _try(make, run, pressed)
            if message == "":
                seconds[i].append(solution.stats.seconds["run"])
                rows[i] = rows[i]._replace(seconds=float(np.median(seconds[i])))
        report((len(plan) * (2 + turn)) / total)


def _try(make, run, pressed):
    """Return a solution, or None, and the reason of a failure."""
    solution = None
    try:
        solution = run(integrator=make())
        message = "" if solution.success else solution.message
    except Exception as error:  # also a plug-in's own: it is one row of many
        message = f"{type(error).__name__}: {error}"
    if pressed or (solution is not None and solution.status == Status.INTERRUPTED):
        raise KeyboardInterrupt
    return solution, message


@contextlib.contextmanager
def _interrupts():
    """A list that Ctrl-C fills: a run that it meets at its very end would not tell of it."""
    pressed = []
    if threading.current_thread() is not threading.main_thread():
        yield pressed
        return
    before = signal.getsignal(signal.SIGINT)
    if not callable(before):
        yield pressed
        return

    def press(number, frame):
        pressed.append(number)
        before(number, frame)

    signal.signal(signal.SIGINT, press)
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, before)


def _plan(methods, tolerances, steps, form):
    """(label, "tolerance" or "step", value, what makes the integrator) of every run."""
    known = registered()
    if methods is None:
        methods = [kind for kind in known.values() if kind.embedded_order and not (kind.implicit and form.first_order)]
    if isinstance(methods, (str, type)) or callable(methods):
        methods = [methods]
    if isinstance(methods, dict):
        given = list(methods.items())
    else:
        try:
            given = [(None, method) for method in methods]
        except TypeError:
            raise InvalidArgument(
                f"methods must be a sequence of names, classes or callables, got {methods!r}."
            ) from None
    if not given:
        raise InvalidArgument("methods must hold at least one method.")
    plan = []
    for label, method in given:
        if isinstance(method, str):
            key = method.lower().replace("-", "").replace("_", "")
            if key not in known:
                raise unknown_name("integrator", method, known)
            method = known[key]
        if isinstance(method, Integrator) or not callable(method):
            raise InvalidArgument(
                f"methods must hold names, Integrator classes or callables (rtol, atol) -> instance, got {method!r}; "
                "benchmark chooses the tolerances."
            )
        name = label or getattr(method, "__name__", type(method).__name__)
        if isinstance(method, type) and not getattr(method, "embedded_order", 0):
            if not steps:
                raise InvalidArgument(f"{name} has a fixed step: say which to try, such as steps=(1e-2, 1e-3).")
            plan += [(name, "step", value, partial(method, step=value)) for value in steps]
        else:
            if not tolerances:
                raise InvalidArgument(f"{name} is adaptive: tolerances must hold at least one.")
            by_name = isinstance(method, type)  # the second of Taylor's is its order
            makes = [
                partial(method, rtol=tol, atol=tol) if by_name else partial(method, tol, tol) for tol in tolerances
            ]
            plan += [(name, "tolerance", tol, make) for tol, make in zip(tolerances, makes, strict=True)]
    return plan


def _positives(values, what, unit=""):
    try:
        values = list(values)
    except TypeError:
        raise InvalidArgument(f"{what} must be a sequence of positive numbers, got {values!r}.") from None
    return [positive(value, f"{what}{unit}: each") for value in values]


def _span(t_span):
    """Checked further by `simulate`; here what the default times need."""
    span = floats(t_span)
    if span.shape != (2,) or not np.isfinite(span).all() or not span[1] > span[0]:
        raise InvalidArgument(f"t_span must be two finite times in s, (start, end), got {t_span!r}.")
    return tuple(map(float, span))


def _times(t_eval, t_span):
    return np.linspace(*t_span, 101) if t_eval is None else floats(t_eval)
