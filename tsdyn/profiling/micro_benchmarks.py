"""Micro-benchmarks, at the final state of a run, of costs that timers can't separate."""

import time

from ..formulations.chart_coordinates import factorise_normal
from ..formulations.null_space import reduced_mass, velocities
from ..formulations.tangent import solve_velocities
from ..jit.kernels import entry, kernel
from ..maths.dense_linalg import copy
from ..rows.interface import DYNAMICS, factorise_selected_rows
from ..taylor.workspace import load_series
from ..workspaces.run_state import load_run
from ..workspaces.workspace import load
from .tolerances import BRIEF, ROUNDS

SYSTEM, NORMAL, VELOCITIES, MASS = range(4)


@kernel
def _system(graph, f):
    """W H^T, H W H^T and its factors."""
    factorise_selected_rows(graph, f, f.rows, DYNAMICS)


@entry
def again(context, run, what, count):
    """Repeat a part of the tangent form."""
    c, r = load(context), load_run(run)
    w, f, l = c.work, c.tangent, c.chart
    for _ in range(count):
        if what == SYSTEM:
            _system(c.graph, f)
        elif what == NORMAL:
            factorise_normal(c.graph, w, f, l)
        else:
            copy(r.y, l.y)
            solve_velocities(c.graph, c.system, w, f, l, r.clock.t)


@entry
def again_with_basis(context, run, what, count):
    """Repeat a part of the forms with a basis."""
    c, r = load(context), load_run(run)
    for _ in range(count):
        if what == MASS:
            reduced_mass(c.system, c.work)
        else:
            velocities(c.system, c.work, r.clock.t, r.y)


@entry
def again_in_series(context, run, what, count):
    """Repeat a part of a Taylor step."""
    c = load_series(context)
    for _ in range(count):
        _system(c.graph, c.tangent)


def prices(memory):
    """Return seconds of each part of the memory's form, by name, at the final state of its run."""
    if hasattr(memory, "series"):
        function, parts = again_in_series, {"system": SYSTEM}
    elif memory.basis_free:
        function, parts = again, {"system": SYSTEM, "normal": NORMAL, "velocities": VELOCITIES}
    else:
        function, parts = again_with_basis, {"mass": MASS, "velocities": VELOCITIES}
    return {name: _seconds(lambda n, what=what: function(*memory.where, what, n)) for name, what in parts.items()}


def _seconds(call):
    """Return seconds of one of n repetitions in call(n): the least of several samples."""
    call(1)
    n, spent = 1, 0.0
    while True:
        began = time.perf_counter()
        call(n)
        spent = time.perf_counter() - began
        if spent > BRIEF / 2 or n > 1 << 20:
            break
        n *= 4
    least = spent / n
    for _ in range(ROUNDS if spent < 0.1 else 0):
        began = time.perf_counter()
        call(n)
        least = min(least, (time.perf_counter() - began) / n)
    return least
