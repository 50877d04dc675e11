"""Initial conditions of scenes of any size, by the constraint graph instead of matrices, in O(N), and their kernels."""

import math
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_rows import move_bodies, place_bodies, write_positions, write_velocities
from ..elements.tolerances import UNDIRECTED
from ..errors import InvalidArgument, RedundantConstraints, SingularConfiguration, Status
from ..formulations.locked_orientations import keep_turning, release_loose_bodies, still
from ..formulations.projection import UNHELD, factorise, find_drift, gather_speeds, land, land_velocities, move_by
from ..jit.kernels import callback, entry, integers, kernel, loader, resident, vector
from ..maths.dense_linalg import copy, dependent, is_finite, largest
from ..maths.tolerances import HALF_DIGITS, LAST_PLACE
from ..model.equations import set_time
from ..model.packed import POINT_SIZE, is_small
from ..observables.evaluate import constraint_arrays
from ..observables.reactions import singular_place
from ..observables.tolerances import KEPT_FLOATS
from ..rows.constraint_graph import (
    BIAS,
    DRIFT,
    REDUCED,
    VALUES,
    are_unequal,
    by_lengths,
    coordinate_scales,
    graph_of,
    set_redundant,
)
from ..rows.inertia_rows import axis_of
from ..rows.interface import (
    DYNAMICS,
    METRIC,
    allocate_tangent,
    evaluate_rows,
    factorise_selected_rows,
    keep_every_row,
    multiply_rows,
    project,
    rates_hold_along,
    redundant_of,
    reset_selection,
    restore_selection,
    select_rows,
    selection_parts,
    set_selection,
    singularity_indicator,
    with_all_rows,
    with_reselection,
)
from ..workspaces import Parts, no_parts, parts, words
from . import tolerances as limits
from .mobility import check_rank, mobility_at
from .motor_starts import demand_finite, demand_small, refuse_masses, refuse_vanished

# Kernels of initial conditions: residuals, projection, selection of independent rows, motion to a place near by. Rows
# are compared in the metric of lengths, and projected in that of kinetic energy.
#
# In place of a row that depends on others: there is none; rounding may hide one.
NONE, DOUBTFUL = -1, -2
HOLDS = -3  # there is none, and all rows hold
PLAIN, LANDED = 1, 2  # what `take_start` has done


class StartParts(NamedTuple):
    """What the kernels of a start find by one address: the same parts twice, but for the metric of their graphs."""

    own: Parts
    lengths: Parts  # constraint_graph.by_lengths
    unequal: np.ndarray  # int64 (1,): constraint_graph.are_unequal


load_start = loader(StartParts(no_parts(), no_parts(), np.zeros(1, np.int64)))


@entry("pvvdviwd")
def evaluate_start(context, q, qd, t, velocity, every, at, tol):
    """f.b = Phi, velocity = Phi_q qd + Phi_t, H of the graph's rows; the first row that depends on others.

    With every = 1 of every row, with 0 without the redundant ones. Where no row depends on others, NONE; DOUBTFUL, with
    every = 1, if a pivot is so small that the rounding errors it causes may hide a redundant row. HOLDS in place of
    NONE if Phi and its rate hold to tol (1 + max |q|) and tol (1 + max |qd|), and H is finite; at: where the Euler
    parameters of the rigid bodies begin.
    """
    c = load_start(context).lengths
    found = _evaluate(c, q, qd, t, velocity, every)
    if found == NONE and _hold(c.tangent.b, velocity, c.tangent.rows.H, q, qd, at, tol) == 1:
        return HOLDS
    return found


@kernel
def _evaluate(c, q, qd, t, velocity, every):
    graph, system, f = c.graph, c.system, c.tangent
    set_time(system, t)
    place_bodies(graph.bodies, q, f.poses)
    move_bodies(graph.bodies, q, qd, f.poses)
    count = keep_every_row(f) if every == 1 else -1
    evaluate_rows(graph, system, f, f.rows, t)
    gather_speeds(graph, f)
    find_drift(graph, system, f, t)
    multiply_rows(graph, f.rows, f.Z, velocity)
    for e in range(velocity.size):
        velocity[e] += f.gamma[e]
    failed = factorise_selected_rows(graph, f, f.rows, METRIC)
    if every == 1:
        restore_selection(f, count)
        if failed < 0 and singularity_indicator(graph, f.rows) < HALF_DIGITS:
            return DOUBTFUL
    return failed


@kernel
def _hold(b, velocity, H, q, qd, at, tol):
    """Return 1 if Phi, b, and its rate hold, and H is finite; else 0."""
    far, fast, size = 0.0, 0.0, 0.0
    for i in range(q.size):
        far, fast = max(far, abs(q[i])), max(fast, abs(qd[i]))
    near, slow = tol * (1.0 + far), tol * (1.0 + fast)
    for e in range(b.size):
        if not (abs(b[e]) <= near and abs(velocity[e]) <= slow):
            return 0
    for i in at:
        square, rate = -1.0, 0.0
        for j in range(i, i + 4):
            square += q[j] * q[j]
            rate += q[j] * qd[j]
        if not (abs(0.5 * square) <= near and abs(rate) <= slow):
            return 0
    for i in range(H.size):
        size += H[i]
    return 1 if size - size == 0.0 else 0


@entry("pd")
def land_start(context, t):
    """Project w.q and w.qd onto the constraint manifold. Status."""
    return _land(load_start(context).own, t)


@kernel
def _land(c, t):
    graph, system, w, f = c.graph, c.system, c.work, c.tangent
    set_time(system, t)
    place_bodies(graph.bodies, w.q, f.poses)
    move_bodies(graph.bodies, w.q, w.qd, f.poses)
    status = land(graph, system, w, f, t)
    if status != 0:
        return status
    write_positions(graph.bodies, f.poses, w.q)
    find_drift(graph, system, f, t)
    land_velocities(graph, f)
    write_velocities(graph.bodies, f.poses, w.qd)
    return 0


@entry("pdd")
def select_redundant(context, t, share):
    """Select redundant rows at the poses, those with pivots below a share; return their number, or -1."""
    c = load_start(context).lengths
    graph, f = c.graph, c.tangent
    count = select_rows(graph, c.system, f, t, share)
    return count if factorise_selected_rows(graph, f, f.rows, METRIC) < 0 else -1


@entry("pvd")
def failing_row(context, q, t):
    """Return the row at which S = H W H^T of the kept rows turns out singular at q, or -1.

    That of a massless axis: rotation about it is free. Any other, if rows are independent: masses are too unequal.
    """
    return _failing_row(load_start(context).own, q, t)


@kernel
def _failing_row(c, q, t):
    graph, f = c.graph, c.tangent
    set_time(c.system, t)
    place_bodies(graph.bodies, q, f.poses)
    evaluate_rows(graph, c.system, f, f.rows, t)
    failed = factorise_selected_rows(graph, f, f.rows, DYNAMICS)
    return failed if failed >= 0 else factorise_selected_rows(graph, f, f.rows, METRIC)


@callback("pppppidd")
def take_start(context, q, qd, velocity, at, count, t, tol):  # eight: addresses
    """Make q and qd consistent, in place, as `initial_conditions.consistent` does where all rows are independent.

    The workspace is as `StartWorkspace.enter` leaves it. Return PLAIN if q and qd were at rounding, LANDED if they have
    been projected, and 0 if the start needs further checks.
    """
    parts = load_start(context)
    c = parts.own
    w, f, n = c.work, c.tangent, c.work.q.size
    x, xd, at = vector(q, n), vector(qd, n), integers(at, count)
    rates = vector(velocity, c.graph.row.shape[0])
    _set_floor(w.control, x, at)
    # Rows at the start, and S = H W H^T in the metric of lengths: regular, or it is for Python to judge
    if _evaluate(parts.lengths, x, xd, t, rates, 1) != NONE:
        return 0
    if (c.graph.axes.rows.shape[0] > 0 or parts.unequal[0] != 0) and _failing_row(c, x, t) >= 0:
        return 0
    # |Phi| and |Phi_q qd + Phi_t|: at rounding, within the tolerance, or beyond it
    if _hold(f.b, rates, f.rows.H, x, xd, at, min(LAST_PLACE, tol)) == 1:
        return PLAIN
    far, fast = _residuals(c, rates, x, xd, at)
    whole, rate = 1.0 + largest(x), 1.0 + largest(xd)
    if not (far <= tol * whole and fast <= tol * rate and is_finite(f.rows.H)):
        return 0
    # Project: p to unit length, positions, then velocities
    if far > LAST_PLACE * whole:
        for i in at:
            length = math.sqrt(x[i] * x[i] + x[i + 1] * x[i + 1] + x[i + 2] * x[i + 2] + x[i + 3] * x[i + 3])
            for j in range(i, i + 4):
                x[j] /= length
    elif fast <= LAST_PLACE * rate:
        return PLAIN
    copy(x, w.q)
    copy(xd, w.qd)
    if _land(c, t) != 0:
        return 0
    copy(w.q, x)
    copy(w.qd, xd)
    return LANDED


@kernel
def _set_floor(control, q, at):
    """As `StartWorkspace.enter` sets it."""
    far, scale = largest(q), 1.0
    if 0.0 < control.size < POINT_SIZE:
        far, scale, last = 0.0, control.size, 0
        for i in range(q.size):
            turns = last < at.size and i >= at[last]
            far = max(far, abs(q[i]) * scale if turns else abs(q[i]))
            if turns and i == at[last] + 3:
                last += 1
    control.floor = LAST_PLACE * (control.size + far)


@kernel
def _residuals(c, rates, q, qd, at):
    """The largest residual of positions and of velocities; inf if one is not finite."""
    far, fast, row, b = 0.0, 0.0, c.graph.row, c.tangent.b
    for e in range(row.shape[0]):
        if row[e] >= 0:
            if not (abs(b[e]) < math.inf and abs(rates[e]) < math.inf):
                return math.inf, math.inf
            far, fast = max(far, abs(b[e])), max(fast, abs(rates[e]))
    for i in at:
        square, rate = 0.0, 0.0
        for j in range(i, i + 4):
            square += q[j] * q[j]
            rate += q[j] * qd[j]
        far, fast = max(far, abs(0.5 * (square - 1.0))), max(fast, abs(rate))
    return far, fast


@entry("pdvd")
def go_near_by(context, t, way, far):
    """Move along the manifold, at most by `far` (rad, or share of the scene's size), and project. Status.

    way (bodies, 8) is any direction; its tangent part is taken.
    """
    c = load_start(context).lengths
    graph, f = c.graph, c.tangent
    status = factorise(graph, c.system, c.work, f, t)
    if status != 0:
        return status
    for i in range(f.Z.size):
        f.Z[i] = way[i]
    wanted = _farthest(c)
    for _ in range(2):
        project(graph, f.rows, f.Z, f.b)
    # Without freedom what is left of the way is rounding, and says nothing
    found = _farthest(c)
    free = found > UNDIRECTED * wanted
    if free and not rates_hold_along(graph, f, f.Z):
        return UNHELD
    scale = far / found if free else 0.0
    for i in range(f.Z.size):
        f.Z[i] *= scale
    move_by(graph, f, True)
    return land(graph, c.system, c.work, f, t)


@kernel
def _farthest(c):
    """Return the largest entry of Z: rotations, and displacements as shares of the scene's size."""
    Z, part, found = c.tangent.Z, 1.0 / max(c.work.control.size, POINT_SIZE), 0.0
    for b in range(c.graph.bodies.shape[0]):
        for i in range(3):
            found = max(found, max(abs(Z[8 * b + i]) * part, abs(Z[8 * b + 4 + i])))
    return found


# The workspace in which a start is checked; one that is idle serves the next start of the scene.


class StartWorkspace:
    """System, scratch memory and address of what the kernels of a start use; one start at a time.

    Parameters
    ----------
    packed : Packed
    graph : ConstraintGraph
    n : int
        Coordinates.
    """

    def __init__(self, packed, graph, n):
        self.graph = graph
        own = packed.system._replace(reals=packed.system.reals.copy())
        selects = packed.derived.redundant is not None and packed.derived.switched is None
        whole = parts(own, graph if selects else with_all_rows(graph), n)
        if selects:
            whole = whole._replace(tangent=allocate_tangent(graph, n, redundant=True))
        self.reals, self.tangent, self.work, self.rates = own.reals, whole.tangent, whole.work, np.zeros(len(graph.row))
        measured = whole._replace(graph=by_lengths(packed, graph))
        if selects:  # rows are selected again in the same metric
            measured = measured._replace(tangent=with_reselection(measured.graph, whole.tangent))
        self.unequal = are_unequal(packed.system)
        self.address, *self._keep = resident(StartParts(whole, measured, np.array([self.unequal], np.int64)))
        rigid = graph.bodies[graph.bodies[:, 1] == 7, 0]
        self.at, self.first_parameters = rigid[:, None] + np.arange(3, 7), rigid + 3  # Euler parameters

    def enter(self, reals, size, q, tol):
        """As if it were new, for the numbers and size of a system and a start that is checked to a tolerance."""
        tangent, control = self.tangent, self.work.control
        for array in (self.work.q.base, tangent.b, tangent.gamma, tangent.Z, tangent.a):
            array.fill(0.0)
        tangent.landing.clear()
        reset_selection(self.graph, tangent)
        self.reals[...] = reals
        control.u_tol, control.size = tol, size
        far = np.abs(q)
        if is_small(size):
            far[self.at] *= size
        control.floor = LAST_PLACE * (size + far.max())

    def entered(self):
        """The arrays that `enter` sets but for reals."""
        tangent = self.tangent
        arrays, records = selection_parts(tangent)
        arrays += [self.work.q.base, tangent.b, tangent.gamma, tangent.Z, tangent.a]
        return [*arrays, *map(words, (tangent.landing, *records))]


def taken(packed, graph, n):
    """Return a `StartWorkspace` of a packed scene: an idle one of this graph, or a new one."""
    try:
        found = packed.derived.start_workspaces.pop()
    except IndexError:
        found = None
    if found is None or found.graph.row is not graph.row:
        return StartWorkspace(packed, graph, n)
    found.graph = graph  # with other redundant rows, of another phase
    return found


def give(packed, workspace):
    """Take back a workspace that is no longer in use, unless it is large."""
    small, known = workspace.tangent.rows.S.size + workspace.tangent.rows.H.size < KEPT_FLOATS, packed.derived
    if small and (known.redundant is None or known.switched is not None) and not known.start_workspaces:
        packed.derived.start_workspaces.append(workspace)


NO_CHOICE = (
    "Phi_q has dependent rows, and no independent selection of its rows was found: a row may be zero here. Start from "
    "another configuration."
)
STRAIGHT = " Long straight chains look so, too: their rows depend on each other to rounding. Bend them."
DEPENDENT = (
    "Phi_q has dependent rows.\nRemove the redundant rows, or use a joint with fewer rows. If the rows are independent "
    "elsewhere, this is a singular configuration: start from another one."
)


def consistent(scene, system, q, qd, t, tol, allowed=False):
    """Check positions and velocities against the constraints, then project them to rounding. Return (q, qd).

    The projection is the smallest in the metric of kinetic energy. If redundant rows are `allowed`, the constraint
    graphs of the packed scene drop them from now on.
    """
    packed = scene.packed
    if place := singular_place(packed, q):
        raise SingularConfiguration(f"{place}: a singular configuration. Start from another one.")
    start = _Start(scene, system, q, qd, t, tol)
    if packed.derived.redundant is None and start.is_regular():
        release_loose_bodies(packed, start.graph, start.tangent.rows.H)
        give(packed, start.workspace)
        return q, qd
    if packed.derived.switched is not None:
        return start.of_phase()
    dependent = start.check()
    if dependent >= 0 and not allowed:
        _refuse(scene, start, dependent)
        dependent = NONE
    start.demand_velocities()
    known = packed.derived.redundant
    if dependent == NONE or (dependent == DOUBTFUL and not allowed):
        if known is not None:  # an earlier start had redundant rows
            set_redundant(packed, None)
            start = start.again()
        start.demand_inertia()
        release_loose_bodies(packed, start.graph, start.tangent.rows.H)
        landed = start.landed()
        give(packed, start.workspace)
        return landed
    if known is None:
        set_redundant(packed, np.zeros(0, np.int64))
        start = start.again()
    rows = start.redundant_rows()
    start.demand_inertia()
    if known is None or len(known) != len(rows):
        set_redundant(packed, rows if len(rows) else None)
        start = start.again()
    elif still(packed).bodies.size:
        start.check()  # for H where it starts
    release_loose_bodies(packed, start.graph, start.tangent.rows.H)
    return start.landed()


class RegularStarts:
    """Checks one start after the other of a scene whose numbers change in place, as `consistent` does.

    Parameters
    ----------
    scene : Scene, or what has its `packed`, bodies and names of rows
    q, qd, t, tol
        As of `consistent`, of a first start.
    """

    def __init__(self, scene, q, qd, t, tol):
        self._start, self._system = _Start(scene, scene.packed.system, q, qd, t, tol), scene.packed.system

    def are_plain(self, q, qd):
        """Whether a start is at rounding, its rows independent, and every axis has inertia: it stays as it is."""
        start = self._start
        start.q, start.qd = q, qd
        start.workspace.reals[...] = self._system.reals
        regular = start.is_regular()
        if regular and still(start.packed).bodies.size:
            release_loose_bodies(start.packed, start.graph, start.tangent.rows.H)
        return regular

    def kernel(self):
        """What `take_start` is called with but for q and qd, and its workspace, entered."""
        start = self._start
        workspace = start.workspace
        workspace.enter(self._system.reals, start.packed.size, start.q, start.tol)
        self._at = np.ascontiguousarray(workspace.first_parameters, np.int64)
        addresses = start.context, start.rates.ctypes.data, self._at.ctypes.data, len(self._at)
        return (take_start.address, *addresses, start.t, start.tol), workspace


class RedundantStarts:
    """The same for scenes with redundant rows, which are selected at each start.

    Parameters
    ----------
    scenes : list of three
        The scene with redundant rows unknown, none, and those of a first start.
    """

    def __init__(self, scenes, q, qd, t, tol):
        self._starts = [_Start(scene, scene.packed.system, q, qd, t, tol) for scene in scenes]

    def landed(self, q, qd):
        """Return (q, qd) as `consistent` does; None where other rows are redundant."""
        for start in self._starts:
            start.renew(q, qd)
        first, again, last = self._starts
        if first.check() == NONE:
            return None
        first.demand_velocities()
        again.check()
        if not np.array_equal(again.redundant_rows(), last.packed.derived.redundant):
            return None
        again.demand_inertia()
        last.check()
        release_loose_bodies(last.packed, last.graph, last.tangent.rows.H)
        return last.landed()


class DependentRows(SingularConfiguration):
    """Other rows than the known ones are redundant."""


class _Start:
    """A start under check, with its workspace."""

    def __init__(self, scene, system, q, qd, t, tol):
        self.given = scene, system, q, qd, t, tol
        self.scene, self.packed, self.q, self.qd, self.t, self.tol = scene, scene.packed, q, qd, t, tol
        self.graph, self.m = graph_of(self.packed, REDUCED, VALUES, BIAS, DRIFT), len(system.segments)
        self.workspace = workspace = taken(self.packed, self.graph, q.size)
        workspace.enter(system.reals, self.packed.size, q, tol)
        self.tangent, self.work, self.rates = workspace.tangent, workspace.work, workspace.rates
        self.context, self.at = workspace.address, workspace.at
        self.found, self.far, self.fast = None, False, False

    def renew(self, q, qd):
        """Take other positions and velocities, and the numbers of the system as they are now."""
        self.q, self.qd, self.found, self.far, self.fast = q, qd, None, False, False
        self.workspace.enter(self.packed.system.reals, self.packed.size, q, self.tol)

    def demand_velocities(self):
        """Refuse velocities that violate the constraints."""
        tol = self.tol * (1.0 + np.abs(self.qd).max())
        demand_small(self.scene, self.velocity, tol, "velocity", "Phi_q qd + Phi_t", (self.t, self.q, self.qd))

    def failing_row(self):
        """Return the row at which the dynamics of the kept rows are singular, or -1."""
        some = len(self.graph.axes.rows) or self.workspace.unequal
        return failing_row(self.context, self.q, self.t) if some else -1

    def loose_axis(self):
        """Return the row of a massless axis about which the kept rows leave rotation free, or -1."""
        row = self.failing_row()
        return row if row in self.graph.axes.rows["row"] else -1

    def demand_inertia(self):
        """Refuse a massless axis about which rotation is free, and masses so unequal that S is singular."""
        row = self.failing_row()
        if row >= 0 and row not in self.graph.axes.rows["row"]:
            refuse_masses(self.scene, self.graph, row)
        self.refuse_axis(row)

    def refuse_axis(self, row):
        """Refuse the axis of a row, by its body; -1 is none."""
        if row < 0:
            return
        body, axis = axis_of(self.graph.axes, row)
        raise SingularConfiguration(
            f"{self.scene.bodies[body].name}: rotation about the axis {np.round(axis, 3) + 0.0} of its frame is free "
            "and carries no inertia, so the accelerations are not determined. Give it inertia about that axis, or add "
            "the constraint that holds it."
        )

    def again(self):
        """Return the same start on the present constraint graph."""
        other = _Start(*self.given)
        other.check()
        return other

    def check(self):
        """Refuse violated rows; return the first row of H that depends on those before it, NONE or DOUBTFUL."""
        scene, graph, tangent, q, qd = self.scene, self.graph, self.tangent, self.q, self.qd
        dependent = self.evaluate() if self.found is None else self.found
        self.found = None
        rows, real = graph.normals[graph.normals >= 0], graph.row >= 0
        Phi, velocity = np.zeros(self.m), np.zeros(self.m)
        Phi[graph.row[real]], velocity[graph.row[real]] = tangent.b[real], self.rates[real]
        p, pd = q[self.at], qd[self.at]
        Phi[rows], velocity[rows] = 0.5 * ((p * p).sum(axis=1) - 1.0), (p * pd).sum(axis=1)
        H = np.ones((self.m, 1))
        H[graph.row[real], 0] = tangent.rows.H.reshape(-1, 16)[: real.size][real].sum(axis=1)
        demand_finite(scene, Phi, H, velocity)
        demand_small(scene, Phi, self.tol * (1.0 + np.abs(q).max()), "position", "Phi", (self.t, q))
        self.velocity = velocity
        self.far = np.abs(Phi).max(initial=0.0) > LAST_PLACE * (1.0 + np.abs(q).max())
        self.fast = np.abs(velocity).max(initial=0.0) > LAST_PLACE * (1.0 + np.abs(qd).max())
        return NONE if dependent == HOLDS else dependent

    def evaluate(self, every=1):
        """As of `evaluate_start`; HOLDS is to rounding."""
        where, tol = self.workspace.first_parameters, min(LAST_PLACE, self.tol)
        return evaluate_start(self.context, self.q, self.qd, self.t, self.rates, every, where, tol)

    def is_regular(self):
        """Whether rows are independent and hold to rounding, as `check` finds it, with inertia about every axis."""
        self.found = self.evaluate()
        return self.found == HOLDS and self.failing_row() < 0

    def of_phase(self):
        """As `consistent`, of a phase whose redundant rows are known; raises `DependentRows` where others are, too."""
        self.found = self.evaluate(0)
        if self.check() != NONE or self.failing_row() >= 0:
            raise DependentRows(NO_CHOICE)
        self.demand_velocities()
        release_loose_bodies(self.packed, self.graph, self.tangent.rows.H)
        landed = self.landed()
        give(self.packed, self.workspace)
        return landed

    def redundant_rows(self):
        """Return the rows that are redundant here and nearby; refuse a singular configuration."""
        names, row, H = self.scene.row_names(), self.graph.row, self.tangent.rows.H.reshape(-1, 16)
        present = H.any(axis=1)
        np.logical_or.at(present, self.graph.tails, present[row.size :])
        gone = np.flatnonzero(~present[: row.size] & (row >= 0))
        if gone.size:
            refuse_vanished(names[row[gone[0]]])
        way = np.random.default_rng(0).normal(size=(len(self.graph.bodies) + 1, 8))
        way[:, :3] *= max(self.packed.size, POINT_SIZE)
        way[-1] = way[:, 3] = way[:, 7] = 0.0
        loose = -1
        for share in limits.REDUNDANT_SHARES:
            self.evaluate()
            if select_redundant(self.context, self.t, share) < 0:
                raise SingularConfiguration(NO_CHOICE)
            loose = self.loose_axis()
            if loose >= 0:
                continue
            rows = redundant_of(self.tangent)
            if not rows.size or self.hold_near_by(way.ravel()):
                return rows
        self.refuse_axis(loose)
        chosen = self.chosen_of_all()
        if chosen.size and self.serve(chosen) and self.hold_near_by(way.ravel()):
            return chosen
        long = int((row >= 0).sum()) > limits.MANY_ROWS
        raise SingularConfiguration(self._singular([names[i] for i in sorted(row[rows])]) + STRAIGHT * long)

    def _singular(self, which):
        """What to say of a configuration in which rows, by name, are dependent that don't hold nearby."""
        found, counts = None, ""
        with suppress(InvalidArgument):  # too large
            found = mobility_at(self.scene, self.q, self.t, self.given[1])
        if found is not None and found.singular:
            real, free = int((self.graph.row >= 0).sum()), found.degrees_of_freedom
            counts = (
                f": of {real} rows of the joints {real - found.rows + found.rank} are independent here, so {free} "
                f"direction{'s are' if free != 1 else ' is'} free at this point and "
                f"{found.generic_degrees_of_freedom or 'none'} next to it"
            )
            which = [each.name for each in found.dependent_here]
        return (
            f"Phi_q has a lower rank in this configuration than nearby{counts}. {', '.join(which[:8])} "
            f"depend{'s' if len(which) == 1 else ''} on other rows just here. Branches of the motion meet, and its "
            "branch is not determined: start from another configuration, on the intended branch."
        )

    def chosen_of_all(self):
        """Return the redundant rows by pivoted QR of all rows: for scenes in which block-wise selection fails."""
        graph, q = self.graph, self.q
        joints = np.flatnonzero(graph.row >= 0)
        if q.size * joints.size > limits.DENSE_ENTRIES or graph.welds.size:
            return np.empty(0, int)
        A = constraint_arrays(self.given[1], q, self.qd, self.t)[1][graph.row[joints]]
        for at in self.at:  # without the component along p, which the normalisations hold
            A[:, at] -= np.outer(A[:, at] @ q[at], q[at])
        return joints[np.sort(dependent(A * coordinate_scales(self.packed)))]

    def serve(self, rows):
        """Take these rows for redundant; return True if S of the others is nonsingular."""
        set_selection(self.tangent, rows)
        return self.evaluate(0) < 0 and self.loose_axis() < 0

    def hold_near_by(self, way):
        """Return True if the redundant rows hold along the way to a nearby configuration."""
        gone, leg = 0.0, limits.NEIGHBOURHOOD
        while gone < limits.NEIGHBOURHOOD:
            here = self.tangent.poses.copy()
            status = go_near_by(self.context, self.t, way, leg)
            if status == Status.UNHELD:
                return False
            if status == Status.SUCCESS:
                gone += leg
                continue
            self.tangent.poses[:] = here
            leg *= limits.SHORTENING
            if leg < limits.SHORTEST_LEG * limits.NEIGHBOURHOOD:
                return gone >= limits.LEAST_NEIGHBOURHOOD
        return True

    def landed(self):
        """Return positions and velocities, projected unless they are at rounding."""
        q, qd, at = self.q, self.qd, self.at
        if self.far:
            q = q.copy()
            q[at] /= np.linalg.norm(q[at], axis=1)[:, None]
        if self.far or self.fast:
            self.work.q[:], self.work.qd[:] = q, qd
            if land_start(self.context, self.t) == 0:
                q, qd = self.work.q.copy(), self.work.qd.copy()
            else:  # a locked orientation was not corrected
                keep_turning(self.packed, still(self.packed).bodies.tolist())
        return q, qd


def _refuse(scene, start, dependent):
    """Refuse dependent rows, by name; return if dense rank analysis finds none."""
    graph, tangent, q = start.graph, start.tangent, start.q
    if q.size * len(scene.system.segments) < limits.LISTED_ENTRIES:
        check_rank(scene, constraint_arrays(scene.system, q, start.qd, start.t)[1])
        return
    if graph.row[dependent] < 0:
        hub = scene.bodies[dict(graph.welds.tolist())[dependent]].name
        raise RedundantConstraints(f"the constraints at {hub} depend on one another: {DEPENDENT}")
    name = scene.row_names()[graph.row[dependent]]
    pairs = [dependent, *(len(graph.row) + np.flatnonzero(graph.tails == dependent))]
    if not tangent.rows.H.reshape(-1, 16)[pairs].any():
        refuse_vanished(name)
    raise RedundantConstraints(f"{name} depends on other constraint rows: {DEPENDENT}")
