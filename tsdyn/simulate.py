"""`simulate`: check everything, lay out the memory, run the driver, hand back a Solution."""

import math
import time

import numpy as np

from . import choice
from .checks import finite_vector, floats, positive, whole
from .dense import Reader, Trajectory
from .drive import drive, lay_out
from .errors import InvalidArgument, Status
from .events import Watch, prepare
from .force_pack import with_force_jacobians
from .formulation import formulation as find_formulation
from .implicit import prepare_implicit
from .integrator import Integrator, registered
from .progress import reporter
from .run import advance
from .run_state import (
    ADAPTIVE,
    ATOL,
    ERROR_BEFORE,
    EXPONENT,
    FILLED,
    INTERVAL,
    LAST_STAGE,
    LEAVE_WHEN_STIFF,
    MAX_STEP,
    RTOL,
    STABLE,
    STAGE_AT,
    STEPS_WANTED,
    STORED,
    T_END,
    T_ORIGIN,
    H,
    T,
)
from .scene import Scene
from .solution import Solution
from .start import consistent
from .state import remembered
from .system import with_curvatures
from .workspace import Context, allocate, allocate_linear, basis_free_parts


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
        A method, or its name with its defaults ("nystrom4", "rk45", "dop853", ...). By default DOP853, and SDIRK54
        from the start where the motion turns out to be stiff and evaluations are saved by it.
    rtol, atol : float, optional
        Tolerances for the default method, 1e-8 if not given, or for an adaptive method that is given by its name.
    formulation : {"tangent", "null-space", "maggi-kane"}
        "tangent": the tangent-space ODE without a basis, at a cost that grows with the scene's size and fill;
        "null-space": the same by Eq. 26, as in the paper; "maggi-kane": Eqs. 17-18, which drift off the constraints,
        for comparison. Implicit methods solve Eq. 26 in either of the first two.
    constraint_tol : float
        u_tol and B_tol of Eqs. 28-29: bound on |Phi| (m) and on |Phi_q U B - I|.
    initial_tol : float
        Residuals of the start, relative to 1 + max |q| or 1 + max |qd|, up to which it is accepted and projected.
    redundancy : {"refuse"}
        What to do about dependent constraints.
    t_eval : array_like, s, optional
        Increasing output times within t_span, from dense output on the manifold, which never changes the steps;
        None gives every accepted step and both ends.
    dense_output : bool
        Keep every step's interpolant, for `solution.at(t)` at any time.
    events : callable or list of callables, optional
        f(t, state) -> float, state being a `State`; each change of its sign is found on the manifold and recorded in
        `solution.t_events`, which never changes the steps. As for scipy.integrate.solve_ivp, an attribute
        `direction` > 0 or < 0 restricts to rising or falling ones, and `terminal` = True, or a number of occurrences,
        ends the run there. A function that raises, or gives no finite number, ends it too, with success=False.
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
    method = choice.explicit(rtol, atol) if integrator is None else _method(integrator, rtol, atol)
    form = find_formulation(formulation)
    if method.implicit and form.first_order:
        others = ", ".join(repr(name) for name, kind in registered().items() if not kind.implicit)
        raise InvalidArgument(
            f"{type(method).__name__} solves its stages in the tangent-space form only; formulation={form.name!r} is "
            f"served by {others}."
        )
    constraint_tol = positive(constraint_tol, "constraint_tol")
    initial_tol = positive(initial_tol, "initial_tol")
    if redundancy != "refuse":
        raise InvalidArgument(f"redundancy must be 'refuse', got {redundancy!r}; other policies don't exist yet.")
    if not isinstance(dense_output, (bool, np.bool_)):
        raise InvalidArgument(f"dense_output must be True or False, got {dense_output!r}.")
    watched = prepare(events)
    times = _output_times(t_eval, t0, t1)
    adaptive = method.step is None
    steps = 2**62 if adaptive else _step_count(t0, t1, method.step)
    max_steps = whole(max_steps, "max_steps")
    interval = whole(chart_interval, "chart_interval") or 0
    report = reporter(progress)

    started = time.perf_counter()
    scene.refresh()
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
    kept = 0
    if method.implicit:
        system, kept = with_force_jacobians(packed._replace(system=with_curvatures(packed)))
    system = system._replace(reals=system.reals.copy())
    system.reals[system.memory] = remembered(state, system.memory.size)
    form = form.serving(method, packed)
    network = form.network(packed)
    sizes = n, m, len(scene.bodies), constraint_tol, packed.size, len(network.row) if form.basis_free else None
    work = allocate(*sizes)
    work.q[:], work.qd[:] = q, qd
    step_kernel, tableau, memory = method.kernel(form.first_order)
    nx, ny = form.sizes(n, m, len(scene.bodies))
    interpolant = method.interpolant(form.first_order)
    width = interpolant.size(n, nx, ny)
    dense = STORED if dense_output else FILLED if watched is not None else 0
    run = lay_out(work, nx, ny, tableau, memory(nx, ny), times, form.first_order, width, dense, system.memory.size)
    run.clock[[T, T_ORIGIN, T_END, H]] = t0, t0, t1, _first_step(method) if adaptive else method.step
    if adaptive:
        run.clock[[RTOL, ATOL]] = method.step_tolerances()
        run.clock[MAX_STEP] = method.max_step or np.inf
        run.clock[[EXPONENT, ERROR_BEFORE]] = 1.0 / (method.embedded_order + 1), 1.0
        run.numbers[ADAPTIVE] = 1
    run.now[:2] = q, qd
    run.numbers[STEPS_WANTED] = steps
    run.numbers[INTERVAL] = interval
    choose = None
    if method.stability_limit and adaptive and not form.first_order:
        run.clock[STABLE] = method.stability_limit
        run.numbers[LAST_STAGE] = 2 * len(method.tableau.c) * nx
        if integrator is None:
            run.numbers[LEAVE_WHEN_STIFF] = 1
            options = {"constraint_tol": constraint_tol, "initial_tol": initial_tol}
            choose = choice.chooser(simulate, scene, method, t1, options)
    errors = [kernel.address for kernel in method.errors] if adaptive else []
    errors += [0] * (2 - len(errors))
    addresses = [*form.addresses(), step_kernel.address, *errors, form.norm() if adaptive else 0]
    addresses += [kernel.address for kernel in interpolant[:2]] if dense or times.size else [0, 0]
    addresses.append(method.second.address if method.implicit and (dense or times.size) else 0)
    addresses = np.array(addresses, np.int64)
    linear = allocate_linear(system, n, m, method.implicit, kept)
    if method.implicit:
        linear = prepare_implicit(linear, method, form.implicit(), run)
        run.numbers[STAGE_AT] = (2 * len(method.tableau.c) + 1) * nx
    context = Context(system, work, linear, *basis_free_parts(network, n))
    advance(context, run, addresses, 0)  # loads the driver, before the clock starts
    sizes = *sizes, network, nx, ny
    watch = None if watched is None else Watch(watched, packed, Reader(packed.system, sizes, addresses), t0)
    prepared = time.perf_counter()
    status, reason, chunks = drive(context, run, addresses, max_steps, report, (t0, t1), watch, choose)
    if status == Status.STIFF:
        return simulate(
            scene,
            t_span,
            integrator=choice.implicit(method),
            formulation=formulation,
            constraint_tol=constraint_tol,
            initial_tol=initial_tol,
            redundancy=redundancy,
            t_eval=t_eval,
            dense_output=dense_output,
            events=events,
            max_steps=max_steps,
            progress=progress,
            chart_interval=chart_interval,
            state=state,
        )
    ended = time.perf_counter()
    trajectory = None
    if dense_output:
        trajectory = Trajectory(packed.system, sizes, addresses, *chunks["dense"], t0, np.array([*run.now]))
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
        trajectory=trajectory,
        events=None if watch is None else watch.found(n),
        seconds={"prepare": prepared - started, "run": ended - prepared},
    )


def _first_step(method):
    """The first step to try, s; 0 for one of the driver's own choice."""
    return min(method.first_step or 0.0, method.max_step or np.inf)


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
