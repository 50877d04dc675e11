"""`simulate`: check everything, lay out the memory, run the driver in slices, hand back a Solution."""

import math
import time

import numpy as np

from . import integrators as _integrators  # noqa: F401  (fills the registry)
from .checks import finite_vector, floats, positive, whole
from .errors import InconsistentState, InvalidArgument, SingularConfiguration, Status
from .formulation import formulation as find_formulation
from .initial import consistent
from .integrator import Integrator, registered
from .progress import reporter
from .run import (
    ADAPTIVE,
    ATOL,
    BEGUN,
    CHART_ROWS,
    CLOCKS,
    ERROR_BEFORE,
    EXPONENT,
    FIRST_ORDER,
    HISTORY,
    INTERVAL,
    MAX_STEP,
    NUMBERS,
    ROWS,
    RTOL,
    STEPS,
    STEPS_WANTED,
    T_END,
    T_ORIGIN,
    H,
    Run,
    T,
    advance,
)
from .scene import Scene
from .solution import Solution, remembered
from .stepping import embedded_error
from .workspace import Context, allocate

SLICE_SECONDS = 0.2  # how often a run comes back to Python: progress, interrupts
MARGIN = 30.0  # of one step's error below the tolerances: errors of many steps add up
FIRST_SLICE, LARGEST_SLICE, CHART_ROOM = 1024, 1 << 17, 4096


def simulate(
    scene,
    t_span,
    *,
    integrator=None,
    rtol=None,
    atol=None,
    formulation="tangent",
    constraint_tol=1e-12,
    initial_tol=1e-9,
    redundancy="refuse",
    t_eval=None,
    dense_output=False,
    events=None,
    max_steps=None,
    progress=None,
    chart_interval=None,
    state=None,
):
    """Integrate a scene over an interval of time; the scene is not changed.

    Parameters
    ----------
    scene : Scene
    t_span : (float, float), s
        Start and end, the end later.
    integrator : Integrator or str, optional
        A method, or its name with its defaults ("nystrom4", "rk45"); default Nystrom4(step=1e-3).
    rtol, atol : float, optional
        Tolerances for an adaptive method that is given by its name.
    formulation : {"tangent", "null-space", "maggi-kane"}
        "tangent": the tangent-space ODE, at present in the form of Eq. 26, which "null-space" names explicitly;
        "maggi-kane": Eqs. 17-18, which drift off the constraints, for comparison.
    constraint_tol : float
        u_tol and B_tol of Eqs. 28-29: bound on |Phi| (m) and on |Phi_q U B - I|.
    initial_tol : float
        Residuals of the start, relative to 1 + max |q| or 1 + max |qd|, up to which it is accepted and projected.
    redundancy : {"refuse"}
        What to do about dependent constraints.
    t_eval : array_like, s, optional
        Increasing output times within t_span, from dense output on the manifold, which never changes the steps;
        None gives every accepted step and both ends.
    dense_output, events
        Not there yet: refused.
    max_steps : int, optional
        End the run after so many steps.
    progress : bool or callable, optional
        True shows a bar (needs tqdm); a callable is given the fraction done, 0 to 1.
    chart_interval : int, optional
        Make a new chart every so many steps, whatever the criteria say; for experiments.
    state : State, optional
        Positions and velocities to start from instead of those of the bodies, such as `solution.state`.

    Returns
    -------
    Solution
        Also of a run that ended early, by Ctrl-C too: see `.success`, `.status`, `.message`; in a loop over runs call
        `.raise_if_failed()`.

    Raises
    ------
    TsdynError
        One of its kinds, before anything runs: InvalidArgument, InvalidBody, InconsistentState, RedundantConstraints,
        SingularConfiguration.
    """
    if not isinstance(scene, Scene):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    t0, t1 = _interval(t_span)
    method = _method(integrator, rtol, atol)
    form = find_formulation(formulation)
    constraint_tol = positive(constraint_tol, "constraint_tol")
    initial_tol = positive(initial_tol, "initial_tol")
    if redundancy != "refuse":
        raise InvalidArgument(f"redundancy must be 'refuse', got {redundancy!r}; other policies don't exist yet.")
    if dense_output or events is not None:
        raise InvalidArgument("dense_output and events are not there yet; give the times of output as t_eval.")
    times = _output_times(t_eval, t0, t1)
    adaptive = method.step is None
    steps = 2**62 if adaptive else _step_count(t0, t1, method.step)
    max_steps = whole(max_steps, "max_steps")
    interval = whole(chart_interval, "chart_interval") or 0
    report = reporter(progress)

    started = time.perf_counter()
    packed = scene.packed
    system = packed.system
    for motion in scene.motions():
        motion.check(t0, t1)
    q, qd = scene.start
    if state is not None:
        if not (hasattr(state, "q") and hasattr(state, "qd")):
            raise InvalidArgument(f"state must have q and qd, such as solution.state, got {state!r}.")
        q, qd = finite_vector(state.q, q.size, "state.q"), finite_vector(state.qd, q.size, "state.qd")
    q, qd = consistent(scene, system, q, qd, t0, initial_tol)
    m, n = system.segments.shape[0], q.size
    system = system._replace(reals=system.reals.copy())
    system.reals[system.memory] = remembered(state, system.memory.size)
    work = allocate(n, m, len(scene.bodies), constraint_tol, packed.size)
    work.q[:], work.qd[:] = q, qd
    step_kernel, tableau, memory = method.kernel(form.first_order)
    nx = n if form.first_order else n - m
    run = _lay_out(work, nx, n - m, tableau, memory(nx, n - m), times, form.first_order, system.memory.size)
    run.clock[[T, T_ORIGIN, T_END, H]] = t0, t0, t1, (method.first_step or 0.0) if adaptive else method.step
    if adaptive:
        run.clock[[RTOL, ATOL]] = method.rtol / MARGIN, method.atol / MARGIN
        run.clock[MAX_STEP] = method.max_step or np.inf
        run.clock[[EXPONENT, ERROR_BEFORE]] = 1.0 / (method.embedded_order + 1), 1.0
        run.numbers[ADAPTIVE] = 1
    run.now[:2] = q, qd
    run.numbers[STEPS_WANTED] = steps
    run.numbers[INTERVAL] = interval
    addresses = [*form.addresses(), step_kernel.address]
    addresses += [embedded_error.address, form.norm()] if adaptive else [0, 0]
    addresses = np.array(addresses, np.int64)
    context = Context(system, work)
    advance(context, run, addresses, 0)  # loads the driver, before the clock starts
    prepared = time.perf_counter()
    status, reason, chunks = _drive(context, run, addresses, max_steps, report, (t0, t1))
    ended = time.perf_counter()
    return Solution(
        scene,
        packed,
        reason=reason,
        method=repr(method),
        formulation=form.name,
        status=status,
        span=(t0, t1),
        run=run,
        work=work,
        chunks=chunks,
        seconds={"prepare": prepared - started, "run": ended - prepared},
    )


def _drive(context, run, addresses, max_steps, report, span):
    """Run slice by slice; returns the status, why it was interrupted, and rows of outputs, history and charts."""
    chunks = {"out": [], "history": []}
    most, limit = FIRST_SLICE, int(run.numbers[STEPS_WANTED]) if max_steps is None else max_steps
    per_step = run.t_eval.size == 0
    width = 1 + 3 * context.work.q.size + run.remembered.size

    def fresh(run, rows):
        """New arrays for the next slice; what the last one filled goes to the chunks."""
        _collect(run, chunks, per_step)
        changes = {"history": np.empty((rows, 3))}
        if per_step:
            changes["out"] = np.empty((rows + 1, width))
        if run.numbers[CHART_ROWS] + CHART_ROOM > run.charts.shape[0]:
            changes["charts"] = np.resize(run.charts, (2 * run.charts.shape[0], 5))
        return run._replace(**changes)

    status, reason = Status.SLICE_DONE, ""
    try:
        run = fresh(run, min(most, limit))
        while status == Status.SLICE_DONE:
            done = int(run.numbers[STEPS])
            if done >= limit:
                status = Status.MAX_STEPS
                break
            started = time.perf_counter()
            rows = min(most, limit - done)
            status = Status(advance(context, run, addresses, rows))
            seconds = time.perf_counter() - started
            if not run.numbers[BEGUN]:
                singular = status in (Status.SINGULAR, Status.MASS_SINGULAR)
                kind = SingularConfiguration if singular else InconsistentState
                raise kind(f"no step could be made from the start. {status.sentence} {status.remedy}")
            if seconds < SLICE_SECONDS / 2:
                most = min(2 * most, LARGEST_SLICE)
            elif seconds > 2 * SLICE_SECONDS:
                most = max(most // 2, 1)
            try:
                report((run.clock[T] - span[0]) / (span[1] - span[0]))
            except Exception as error:  # what has been computed is worth more than a progress bar
                if status == Status.SLICE_DONE:
                    status, reason = Status.INTERRUPTED, f"progress raised {type(error).__name__}: {error}."
            run = fresh(run, min(most, max(limit - int(run.numbers[STEPS]), 1)))
    except KeyboardInterrupt:
        if run.clock[T] >= span[1]:
            status = Status.SUCCESS
        elif status == Status.SLICE_DONE:
            status = Status.INTERRUPTED
    finally:
        report(None)
    _collect(run, chunks, per_step)
    chunks["charts"] = run.charts
    if not per_step:
        chunks["out"] = [run.out[: run.numbers[ROWS]]]
    return status, reason, chunks


def _collect(run, chunks, per_step):
    if per_step:
        chunks["out"].append(run.out[: run.numbers[ROWS]])
        run.numbers[ROWS] = 0
    chunks["history"].append(run.history[: run.numbers[HISTORY]])
    run.numbers[HISTORY] = 0


def _lay_out(work, nx, ny, tableau, memory, times, first_order, slots):
    n = work.q.size
    zeros = np.zeros
    numbers = zeros(NUMBERS, np.int64)
    numbers[FIRST_ORDER] = first_order
    return Run(
        **{name: zeros(nx) for name in ("x", "xd", "xd_old", "dx", "x_low", "x_low_old", "x_old", "xs")},
        **{name: zeros(ny) for name in ("y", "yd", "dy", "y_low", "y_low_old", "y_old", "yd_old", "ys", "yds")},
        now=zeros((3, n)),
        before=zeros((3, n)),
        warm=zeros(work.u.size + work.v.size + work.B.size + work.T.size),
        remembered=zeros(slots),
        tableau=tableau,
        memory=zeros(memory),
        t_eval=times,
        clock=zeros(CLOCKS),
        numbers=numbers,
        out=np.empty((times.size, 1 + 3 * n + slots)),
        history=np.empty((0, 3)),
        charts=zeros((2 * CHART_ROOM, 5)),
    )


def _interval(t_span):
    span = floats(t_span)
    if span.shape != (2,) or not np.isfinite(span).all():
        raise InvalidArgument(f"t_span must be two finite times in s, (start, end), got {t_span!r}.")
    t0, t1 = map(float, span)
    if not t1 > t0:
        raise InvalidArgument(
            f"t_span must end after it starts, got ({t0:g}, {t1:g}); swap them, or choose a later end."
        )
    return t0, t1


def _method(integrator, rtol, atol):
    known = registered()
    tolerances = {name: value for name, value in (("rtol", rtol), ("atol", atol)) if value is not None}
    if integrator is None:
        integrator = "nystrom4"
    if tolerances and not (isinstance(integrator, str) and getattr(known.get(_key(integrator)), "embedded_order", 0)):
        raise InvalidArgument(
            f"{' and '.join(tolerances)} set the tolerances of an adaptive method given by its name, such as "
            f"integrator='rk45', not of {integrator!r}; give an instance its own, such as RK45(rtol=1e-8)."
        )
    if isinstance(integrator, str):
        if _key(integrator) not in known:
            raise InvalidArgument(f"unknown integrator {integrator!r}; there are {', '.join(map(repr, known))}.")
        return known[_key(integrator)](**tolerances)
    if isinstance(integrator, type) and integrator in known.values():
        return integrator()
    if not isinstance(integrator, Integrator):
        raise InvalidArgument(
            f"integrator must be a name or an instance such as ts.integrators.Nystrom4(step=1e-3), got {integrator!r}."
        )
    return integrator


def _key(name):
    return name.lower().replace("-", "").replace("_", "")


def _output_times(t_eval, t0, t1):
    if t_eval is None:
        return np.empty(0)
    times = floats(t_eval)
    if times.ndim != 1 or times.size == 0 or not np.isfinite(times).all():
        raise InvalidArgument("t_eval must be a non-empty vector of finite times in s.")
    if (np.diff(times) <= 0.0).any():
        raise InvalidArgument("t_eval must increase from each time to the next.")
    if times[0] < t0 or times[-1] > t1:
        raise InvalidArgument(
            f"t_eval must lie within t_span, ({t0:g}, {t1:g}); it runs from {times[0]:g} to {times[-1]:g}."
        )
    return times


def _step_count(t0, t1, step):
    count = (t1 - t0) / step
    if not count < 2**53 or t0 + step == t0:
        raise InvalidArgument(f"the step of {step:g} s is too small for the interval ({t0:g}, {t1:g}).")
    return max(1, math.ceil(count * (1.0 - 1e-12)))
