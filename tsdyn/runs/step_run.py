"""Front end of the step driver, for methods with a step kernel: memory, driver loop, outcome."""

import numpy as np

from ..errors import Status
from ..formulations.registry import formulation
from .arguments import step_count
from .run_memory import Memory
from .run_state import CHART_ROWS, FILLED, IN_CHART, LANDED, MAY_PASS, NEAR_STEPS, REJECTED, STEPS, STIFF, STORED
from .segments import Relay
from .slices import drive_part
from .trajectory import Reader, Trajectory


def run_steps(task, observe=None, relay=None):
    """Run a `Task`; the `Outcome`. `observe` is given the memory before the run: one of its own.

    With a `Relay` it ends with Status.PASSAGE next to a singular configuration that there is a way past.
    """
    prepared, method = task.prepared, task.method
    form = task.form.serving(method)
    task = task._replace(form=form)
    steps = None if method.step is None else step_count(*task.span, method.step)
    packed, n, m = prepared.packed, prepared.n, prepared.m
    network = form.network(packed)
    nx, ny = form.sizes(n, m, network)
    step, tableau, scratch = method.kernel(form.first_order)
    interpolant = method.interpolant(form.first_order)
    _, kept = prepared.system(method.implicit)
    joint_rows = len(network.row) if form.basis_free else None
    kind = joint_rows, method.implicit, kept, nx, ny, tableau.size, scratch(nx, ny), interpolant.size(n, nx, ny)
    memory = None if observe else prepared.take((form.name, *kind), lambda: Memory(prepared, network, *kind))
    if memory is None or memory.network is not network:  # of the scene before it was changed
        memory = Memory(prepared, network, *kind)
    memory.clear(task)
    dense = STORED if task.dense_output else FILLED if task.events is not None else 0
    addresses = _addresses(method, form, step, interpolant, steps is None, task.within)
    memory.give_method(task, tableau, steps, dense, addresses)
    run, control = memory.run, memory.work.control
    memory.load()
    reading = _reading(packed, form, task.constraint_tol, memory.addresses.copy()) if dense else None
    if observe is not None:
        observe(memory)
    run.numbers[MAY_PASS] = relay is not None
    driven = drive_part(memory, task, relay or Relay(), reading)
    recorded = driven.recorded
    charts = recorded.charts[: run.numbers[CHART_ROWS] + 1].copy()
    charts[-1, 2:] = control.condition, control.contraction, run.numbers[IN_CHART]
    last = run.now.copy()
    trajectory = None
    if task.dense_output:
        points = recorded.points[: len(charts)].copy()
        again = read_again, packed, method, form.name, task.constraint_tol
        sides = task.span[0], last, task.angles, task.stops
        trajectory = Trajectory(reading, again, recorded.blocks, charts, points, *sides)
    counted = counts(
        run, memory.work.counters, packed, *((prepared.spheres, prepared.still) if form.basis_free else (0, 0))
    )
    outcome = driven.outcome(task, run, charts, counted, trajectory)
    if observe is None and outcome.status != Status.NOT_FINITE:  # NaN may be left in what a run takes as its own
        prepared.give((form.name, *kind), memory)
    return outcome


def _reading(packed, form, constraint_tol, addresses):
    """A reader's kind, and what to make one with."""
    n, m = int(packed.system.bodies[:, 1].sum()), len(packed.system.segments)
    network = form.network(packed)
    sizes = form.sizes(n, m, network)
    rows = len(network.row) if form.basis_free else None
    given = n, m, len(packed.bodies), constraint_tol, packed.size, rows, network, *sizes
    return Reader, packed.system, given, addresses


def read_again(packed, method, name, constraint_tol):
    """The same in another process than the run's."""
    form = formulation(name).serving(method)
    step, interpolant = method.kernel(form.first_order)[0], method.interpolant(form.first_order)
    addresses = np.array(_addresses(method, form, step, interpolant, False, True), np.int64)
    return _reading(packed, form, constraint_tol, addresses)


def _addresses(method, form, step, interpolant, adaptive, within):
    """Those that the driver and the reader are given, dense.A_PLACE ... A_SECOND."""
    errors = [kernel.address for kernel in method.errors] if adaptive else []
    return [
        *form.addresses(),
        step.address,
        *errors,
        *[0] * (2 - len(errors)),
        form.norm() if adaptive else 0,
        *([interpolant.fill.address, interpolant.value.address] if within else [0, 0]),
        method.second.address if within and method.implicit else 0,
    ]


def counts(run, counters, packed, no_spin, no_turn, constant_columns=0):
    """What `Solution.stats` counts.

    Of what each evaluation skips: the torques of no_spin bodies, the rotations of no_turn, so many columns of markers.
    """
    numbers, evaluations = run.numbers, counters.evaluations
    return {
        "steps": int(numbers[STEPS]),
        "rejected": int(numbers[REJECTED]),
        "evaluations": evaluations,
        "placements": counters.placements,
        "newton_iterations": counters.newton,
        "b_iterations": counters.b_iterations,
        "charts": counters.charts,
        "factorizations": counters.factorizations,
        "stiff": bool(numbers[STIFF]),
        "steps_near_singular": int(numbers[NEAR_STEPS]),
        "largest_landing": float(run.clock[LANDED]),
        "jacobians": counters.jacobians,
        "iteration_matrices": counters.iteration_matrices,
        "stage_iterations": counters.stage_iterations,
        "solves_skipped": counters.at_rounding,
        "checks_skipped": counters.unverified,
        "factorizations_skipped": counters.kept + counters.stage_iterations - counters.iteration_matrices,
        "gyroscopic_skipped": no_spin * evaluations,
        "rotations_skipped": no_turn * evaluations,
        "columns_skipped": constant_columns * evaluations,
        "forces_skipped": 0 if packed.loads else evaluations,
    }
