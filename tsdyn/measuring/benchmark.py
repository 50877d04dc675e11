"""`benchmark`: work-precision of integration methods on a user's scene, against a reference solution."""

from __future__ import annotations

import contextlib
import datetime
import math
import platform
import signal
import threading
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..calls import fitting
from ..drawing import BLUE, GREEN, GREY, VERMILION, Tabulated, new_figure
from ..errors import InvalidArgument, Status
from ..formulations.registry import formulation as find_formulation
from ..integrators import DOP853, RK45, SDIRK54
from ..methods.integrator import Integrator, registered
from ..runs.task import interval, kind_named
from ..simulation.prepared_run import simulate
from ..simulation.scene import Scene
from ..validation import floats, positive, shown, unknown_name, whole
from .tolerances import ENOUGH, REFERENCE_TOLERANCES, ROOM

if TYPE_CHECKING:
    from ..hints import ArrayLike, Callable, Formulation, Methods, Sequence, Solution, Span

# Reference solution of a scene: two unrelated methods, refined until they agree as far as they can.

PAIRS = ((DOP853, RK45), (DOP853, SDIRK54), (SDIRK54, RK45))  # the next one where a method doesn't get through


class Reference(NamedTuple):
    """Where the bodies are at given times; k times, b bodies."""

    t: np.ndarray  # (k,), s
    r: np.ndarray  # (k, b, 3), m
    A: np.ndarray  # (k, b, 3, 3); the identity for a point mass
    trusted: float  # what r (m) and A are taken to be right to
    source: str

    @property
    def digits(self) -> float:
        """Decimals of r (m) and A that are trusted."""
        return -math.log10(self.trusted) if self.trusted > 0.0 else 16.0


def poses(solution):
    """Positions (k, b, 3) and rotation matrices (k, b, 3, 3) of a solution's bodies."""
    bodies, k = solution.scene.bodies, solution.t.size
    r = np.stack([solution.position(body) for body in bodies], axis=1)
    A = [np.broadcast_to(np.eye(3), (k, 3, 3)) if body.dimension == 3 else solution.rotation(body) for body in bodies]
    return r, np.stack(A, axis=1)


def errors(solution, reference):
    """Largest differences in r (m) and in A from a reference, over all bodies and outputs."""
    return tuple(
        float(np.abs(found - given).max(initial=0.0))
        for found, given in zip(poses(solution), (reference.r, reference.A), strict=True)
    )


def agreed(scene, t_span, times, max_steps):
    """Make a `Reference`.

    Raises
    ------
    InvalidArgument
        If no two methods reach the end within max_steps.
    KeyboardInterrupt
        If one of the runs is interrupted.
    """
    best, said = None, []
    for pair in PAIRS:
        for tol in REFERENCE_TOLERANCES:
            runs = [_run(scene, t_span, times, kind, tol, max_steps) for kind in pair]
            failed = [run for run in runs if not run.success]
            if failed:
                said += [f"{run.method}: {run.message}" for run in failed]
                break
            r, A = poses(runs[0])
            gap = max(errors(runs[1], Reference(times, r, A, 0.0, "")))
            if best is None or gap < best[0]:
                best = gap, Reference(times, r, A, 0.0, f"{runs[0].method}, from which {runs[1].method} differs by")
            if gap < ENOUGH:
                break
        if best is not None:
            break
    if best is None:
        raise InvalidArgument(
            f"no reference could be made for this scene within {max_steps} steps; shorten t_span, raise max_steps, or "
            f"give a reference. {said[-1]}"
        )
    gap, reference = best
    size = 1.0 + np.abs(reference.r).max(initial=0.0)
    trusted = max(ROOM * gap, 10.0 * np.finfo(float).eps * size)
    return reference._replace(trusted=trusted, source=f"{reference.source} {gap:.1e} at most")


def _run(scene, t_span, times, kind, tol, max_steps):
    run = simulate(scene, t_span, integrator=kind(tol, tol), t_eval=times, max_steps=max_steps)
    if run.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    return run


# The work-precision figure of `benchmark`: one panel a scene, one line a method.

COLOURS = (BLUE, VERMILION, GREEN, "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = "osD^vPX"


def figure(benchmarks):
    """Draw benchmarks side by side."""
    with new_figure(1.0 + 4.0 * len(benchmarks), 4.4) as drawn:
        panels = drawn.subplots(1, len(benchmarks), sharey=True, squeeze=False)[0]
        names = list(dict.fromkeys(row.method for benchmark in benchmarks.values() for row in benchmark.rows))
        for ax, (title, benchmark) in zip(panels, benchmarks.items(), strict=True):
            _panel(ax, benchmark, names)
            ax.set_title(title, loc="left", fontsize=11)
        panels[0].set_ylabel("run time (s)")
        handles = {name: line for ax in panels for line, name in zip(*ax.get_legend_handles_labels(), strict=True)}
        if handles:
            drawn.legend(
                handles.values(),
                handles.keys(),
                loc="outside lower center",
                ncols=len(handles),
                frameon=False,
                fontsize=9,
            )
    return drawn


def _panel(ax, benchmark, names):
    """One line a method, and the errors that the reference can't distinguish in grey."""
    ax.set(xscale="log", yscale="log", xlabel="largest error in position (m) and rotation matrix")
    ax.grid(True, which="major", color="#dddddd", linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    for i, name in enumerate(names):
        points = sorted((row.error, row.seconds) for row in benchmark.rows if row.method == name and not row.message)
        if points:
            look = {"color": COLOURS[i % len(COLOURS)], "marker": MARKERS[i % len(MARKERS)]}
            ax.plot(*zip(*points, strict=True), label=name, markersize=4, linewidth=1.3, **look)
    if benchmark.reference is not None and ax.lines:
        trusted = benchmark.reference.trusted
        ax.axvline(trusted, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)))
        ax.annotate(
            f"reference: {benchmark.reference_digits:.0f} digits", (trusted, 0.98), (3, 0), color=GREY, fontsize=8,
            xycoords=ax.get_xaxis_transform(), textcoords="offset points", rotation=90, va="top",
        )  # fmt: skip
    ax.invert_xaxis()  # better to the right


# The result of `benchmark`: rows, their table, and the figure.

COUNTS = (
    "steps",
    "rejected",
    "evaluations",
    "placements",
    "jacobians",
    "iteration_matrices",
    "factorizations",
    "charts",
)
HEADS = ("steps", "rejected", "evaluations", "placements", "Jacobians", "iter.mat.", "factor.", "charts")


class Row(NamedTuple):
    """One method at one tolerance, or of one step; nan and zeros where it didn't run to the end."""

    method: str
    setting: str  # "tolerance" or "step"
    value: float  # the tolerance, or the step in s
    error_r: float  # m, largest over all bodies and outputs
    error_A: float  # entries of the rotation matrix
    trusted: bool  # whether the error is above what the reference is trusted to
    seconds: float  # median over the repeats, of the run without its preparation
    steps: int
    rejected: int
    evaluations: int
    placements: int
    jacobians: int
    iteration_matrices: int
    factorizations: int
    charts: int
    status: str
    message: str  # empty for a run that reached its end

    @property
    def error(self) -> float:
        """The larger of the two."""
        return max(self.error_r, self.error_A)

    @classmethod
    def of(
        cls,
        method: str,
        setting: str,
        value: float,
        solution: Solution | None,
        off: tuple[float, float],
        floor: float,
        message: str,
    ) -> Row:
        """The row of a run that has not been timed."""
        stats = None if solution is None else solution.stats
        counts = {name: getattr(stats, name, 0) for name in COUNTS}
        status = "refused" if solution is None else str(solution.status)
        return cls(
            method, setting, value, *off, bool(max(off) > floor), np.nan, **counts, status=status, message=message
        )


_HEAD = ("method", "tol or step", "error r (m)", "error A", "", "time (ms)", *HEADS, "status")


class Benchmark(Tabulated):
    """Run time against error of methods on one scene.

    Attributes
    ----------
    rows : tuple of Row
    reference : Reference, or None if it was interrupted before there was one
    reference_digits : float
        Decimals of positions (m) and rotation matrices that the reference is trusted to.
    interrupted : bool
        Whether Ctrl-C ended it; rows not reached are missing, those not timed have nan seconds.
    machine : str
        Processor, versions and date.
    """

    _left = (0, 4, len(_HEAD) - 1)

    def __init__(
        self,
        rows: tuple[Row, ...],
        reference: Reference | None,
        span: tuple[float, float],
        formulation: str,
        repeats: int,
        interrupted: bool,
    ) -> None:
        self.rows, self.reference, self.span, self.formulation = rows, reference, span, formulation
        self.repeats, self.interrupted, self.machine = repeats, interrupted, machine()

    @property
    def reference_digits(self) -> float:
        """Decimals that the reference is trusted to; 0 without one."""
        return 0.0 if self.reference is None else self.reference.digits

    def table(self) -> str:
        """The rows as text, with where the errors come from and the machine."""
        return str(self)

    def _shown(self):
        if self.reference is None:
            return ["Benchmark, interrupted before there was a reference."], [], []
        marked = any(not row.trusted and not row.message for row in self.rows)
        above = [
            f"Run time against error, {self.span[0]:g} to {self.span[1]:g} s, formulation {self.formulation!r}.",
            f"Errors are the largest over all bodies and {self.reference.t.size} outputs; run times are medians of "
            f"{self.repeats} interleaved runs, without compilation and preparation.",
            f"Reference: {self.reference.source}; {self.reference_digits:.1f} digits are trusted.",
            *(["* below what the reference is trusted to."] if marked else []),
            *(["Interrupted: what there was so far."] if self.interrupted else []),
            self.machine,
            "",
        ]
        said = [f"{row.method}, {row.setting} {row.value:g}: {row.message}" for row in self.rows if row.message]
        return above, [_HEAD, *map(_cells, self.rows)], said

    def __repr__(self) -> str:
        return f"<Benchmark: {len(self.rows)} runs, reference trusted to {self.reference_digits:.1f} digits>"

    def figure(self) -> Any:
        """Draw it; return the matplotlib Figure."""
        return figure({"": self})


def _cells(row):
    setting = f"{row.value:.0e}" if row.setting == "tolerance" else f"{row.value:g} s"
    off = [f"{value:.1e}" if np.isfinite(value) else "-" for value in (row.error_r, row.error_A)]
    mark = "" if row.trusted or row.message else "*"
    seconds = f"{1e3 * row.seconds:.3g}" if np.isfinite(row.seconds) else "-"
    return (row.method, setting, *off, mark, seconds, *(str(getattr(row, name)) for name in COUNTS), row.status)


def machine() -> str:
    """Processor, versions and date in one line."""
    from .._version import __version__

    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = [
            line.partition(":")[2].strip() for line in cpuinfo.read_text().splitlines() if line.startswith("model name")
        ]
        name = models[0] if models else name
    versions = f"Python {platform.python_version()}, NumPy {np.__version__}, Numba {version('numba')}"
    return f"{name}, {platform.system()}; tsdyn {__version__}, {versions}; {datetime.date.today()}."


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
    reference : Reference, optional
        That of another `Benchmark`. Default: two methods, refined until they agree.
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
        raise InvalidArgument(f"reference must be the attribute reference of a Benchmark, got {shown(reference)}.")
    plan = _plan(methods, tolerances, steps, form)
    t_span = interval(t_span)
    times = np.linspace(*t_span, 101) if t_eval is None else floats(t_eval)
    times = times if reference is None else reference.t
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
    """A list that Ctrl-C fills: a run that it meets at its very end would not report it."""
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
            named = kind_named(method)
            if named is None:
                raise unknown_name("integrator", method, known)
            method = named
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
