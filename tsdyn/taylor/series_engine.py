"""The engine of runs by Taylor series: run workspace, dense output (see runs/driver.py), series with joint friction."""

import numpy as np

from ..elements.loops.constraint_rows import place_bodies, turned, write_accelerations
from ..elements.loops.constraint_series import ADVANCE, BODY_ROW, RESIDUAL, S_OMEGA, S_R
from ..errors import InvalidArgument, Status
from ..formulations.accelerations import (
    accelerate_with_friction,
    body_reaction,
    factorise_loads,
    find_reactions,
    load_slope,
    refine_accelerations,
)
from ..formulations.locked_orientations import moving_parts
from ..jit.kernels import callback, kernel, matrix, stack, vector
from ..jit.simd import add, cross, first, four, put, second, splat, third
from ..maths.dense_linalg import copy
from ..maths.tolerances import LAST_PLACE
from ..model.packed import System
from ..rows.constraint_graph import BIAS, DRIFT, REDUCED, VALUES, are_unequal, redundant_rows, with_loops
from ..rows.interface import (
    add_products,
    allocate_tangent,
    evaluate_bias,
    note_loads,
    set_selection,
    solve_friction_series,
    weigh_bodies,
    with_all_rows,
)
from ..runs.dense_output import READ, SAME_STEP, WHOLE, TrajectoryReading, put_state, recall
from ..runs.run_memory import Memory
from ..workspaces import B_DATA, B_START, lay_out, load_run, plain_work, words
from .coefficients import change, exact_product, inverses, put_product, run_forces, run_loops, spin, turn, turn_ahead
from .layout import (
    SeriesContext,
    Trial,
    allocate_expansion,
    empty_series,
    is_far,
    kept_multipliers,
    load_series,
    masks,
    refusal,
    room,
    with_ground_contacts,
)
from .step_parts import (
    accelerate_here,
    begin_orders,
    check_laws,
    expand_far_series,
    expand_series,
    keep_start,
    pass_singular,
    reach,
    set_floor,
    state_within,
    write_qdd,
)
from .stepper import advance_series
from .tolerances import MANY_BODIES

# Taylor coefficients of the motion with joint friction, order by order.
#
# Friction i is g_i N_i, with the normal load N_i of the reaction of its joint. At order k it is known but for what is
# linear in lam_k:
#
#     (g_i N_i)_k = sum_{j>0} g_i,j N_i,k-j + g_i,0 (N_i,k at lam_k = 0 + N_i,lam lam_k)                (1)
#     N~ lam_k    = (k+1)(k+2) Phi_{k+2} at lam_k = 0,     N~ = S - H W sum_i g_i,0 N_i,lam              (2)
#
# N_i,lam is that of order zero, so N~ is factorised once a step, as S is without friction. At order zero N_i is not
# linear: Newton's method gives lam_0 (accelerations.py), and (2) what it lacks to rounding.

JAMMED = int(Status.JAMMED)


@kernel
def sum_reaction(reals, x, i, k):
    """Order k of the reaction that friction i depends on, about the point of its joint."""
    friction, orders = x.frictions[i], x.order.room
    F, T, p, o = splat(0.0), splat(0.0), friction.point, friction.reaction + k
    for j in range(friction.first, friction.first + friction.count):
        # Force, and torque about the joint's point: sum_l A_l s x f_{k-l}
        source = x.sources[j]
        s, forces, at = source.coordinates, source.forces, source.body * orders * BODY_ROW
        s0, s1, s2 = reals[s], reals[s + 1], reals[s + 2]
        # Of a point, its arm from the joint's point
        if source.is_point == 1:
            F = add(F, four(x.constraints, forces + 4 * k))
            s0, s1, s2 = s0 - reals[p], s1 - reals[p + 1], s2 - reals[p + 2]
        if s0 != 0.0 or s1 != 0.0 or s2 != 0.0:
            for l in range(k + 1):
                arm = turned(x.bodies, at + 12 * l, s0, s1, s2)
                T = add(T, cross(arm, four(x.constraints, forces + 4 * (k - l))))
    x.loads[o], x.loads[o + orders], x.loads[o + 2 * orders] = first(F), second(F), third(F)
    o += 3 * orders
    x.loads[o], x.loads[o + orders], x.loads[o + 2 * orders] = first(T), second(T), third(T)


@kernel
def _sum_reactions(reals, x, k):
    """What is known of order k of all reactions, and order k - 1 as a whole; that of order zero is known before."""
    for i in range(x.frictions.shape[0]):
        if k > 1:
            sum_reaction(reals, x, i, k - 1)
        sum_reaction(reals, x, i, k)


@kernel
def _find_slopes(graph, system, w, x, f):
    """Set the derivatives of the normal loads by lam_0, and order zero of the reactions."""
    r, reaction, out = f.friction, stack(6), stack(13)
    for i in range(graph.frictions.shape[0]):
        friction, series = graph.frictions[i], x.frictions[i]
        # N, N_lam and the reaction of order zero
        body_reaction(graph, f, friction, r.lam, reaction)
        load_slope(system, series.slope, friction, w.q, w.qd, x.order.time, reaction, out)
        for c in range(7):
            r.load[7 * i + c] = out[c]
        for c in range(6):
            x.loads[series.reaction + c * x.order.room] = out[7 + c]


@kernel
def _start(graph, system, w, x, f):
    """Z <- accelerations, r.lam <- lam_0, from Z = W F without friction; False if no reactions balance the friction."""
    r = f.friction
    x.low_r2[:] = 0.0
    note_loads(f)
    # Newton's method for lam_0; if it fails from the last multipliers, from zero
    evaluate_bias(graph, system, f, x.order.time)
    if find_reactions(graph, system, f, w.q, w.qd, x.order.time, LAST_PLACE):
        return True
    copy(r.Z, f.Z)
    for e in range(r.lam.size):
        r.lam[e] = 0.0
    return find_reactions(graph, system, f, w.q, w.qd, x.order.time, LAST_PLACE)


@kernel
def _correct(graph, system, k, exact, x, f):
    """Correct the series by Eq. (2) for its residuals; f.gamma is lam_k so far."""
    orders, inverse = x.order.room, inverses(k, exact)
    # Residuals of Phi_{k+2}
    run_loops(graph, system.reals, RESIDUAL, k, x, f)
    # less what r_2 has lost to rounding
    if k == 0 and exact:
        for b in range(graph.bodies.shape[0]):
            put(f.Z, 8 * b, add(four(x.low_r2, 4 * b), four(x.low_r2, 4 * b)))
            put(f.Z, 8 * b + 4, splat(0.0))
        add_products(graph, f.rows, f.Z, f.b)
    # Eq. (2)
    solve_friction_series(graph, f, x.bodies, S_OMEGA * orders + 4 * (k + 1), BODY_ROW * orders, k)
    for e in range(f.b.size):
        f.gamma[e] += f.b[e]
    for b in range(graph.bodies.shape[0]):
        change(graph, b, x, k, inverse, exact, f.Z)


@kernel
def expand_with_friction(graph, system, w, k, last, refine, x, f):
    """As `coefficients.expand`; False if no reactions balance the friction at order zero."""
    bodies, Z, orders, r, exact = x.bodies, f.Z, x.order.room, f.friction, refine > 1
    # Reactions by earlier multipliers, friction as far as it is known, Eq. (1), other forces
    run_loops(graph, system.reals, ADVANCE, k, x, f)
    if k > 0:
        _sum_reactions(system.reals, x, k)
    run_forces(system.reals, x, k, f)
    weigh_bodies(graph, Z)
    # At order zero all of the friction
    if k == 0 and not _start(graph, system, w, x, f):
        return False
    g, h, g_low, h_low = inverses(k, exact)
    for b in range(graph.bodies.shape[0]):
        # Coefficients with lam_k = 0, or at order zero with lam_0
        at = b * orders * BODY_ROW
        put_product(bodies, at + S_R * orders + 4 * (k + 2), four(Z, 8 * b), h, h_low, exact)
        if graph.bodies[b, 1] == 7:
            put_product(bodies, at + S_OMEGA * orders + 4 * (k + 1), four(Z, 8 * b + 4), g, g_low, exact)
            turn(bodies, at, k + 2, exact_product(four(Z, 8 * b + 4), h, h_low))
    # lam_k, refined
    for e in range(f.gamma.size):
        f.gamma[e] = r.lam[e] if k == 0 else 0.0
    for _ in range(1 + (x.order.sweeps if k < refine else 0)):
        _correct(graph, system, k, exact, x, f)
    # lam_k stays in b for the next order
    copy(f.gamma, f.b)
    # N~ of order zero serves all orders
    if k == 0:
        copy(f.gamma, r.lam)
        _find_slopes(graph, system, w, x, f)
        if not factorise_loads(graph, f, False):
            return False
    for b in range(graph.bodies.shape[0]):
        # What order k + 1 begins with
        put(Z, 8 * b, splat(0.0))
        if graph.bodies[b, 1] == 7 and not last:
            put(Z, 8 * b + 4, spin(graph, b, bodies, b * orders * BODY_ROW, orders, k + 1))
            turn_ahead(bodies, b * orders * BODY_ROW, orders, k + 2, exact)
    return True


@callback("pii")
def expand_friction_series(context, start, end):
    """As `step_parts.expand_series`. Status."""
    c = load_series(context)
    x, refine = c.expansion, begin_orders(c, start)
    for k in range(start, end):
        last = k > 0 and k + 1 == x.order.top
        if not expand_with_friction(c.graph, c.system, c.work, k, last, refine, x, c.tangent):
            return JAMMED
    if start == 0:
        write_qdd(c)
    return 0


@callback("pdd")
def accelerate_with_friction_here(context, t, h):
    """As `step_parts.accelerate_here`. Status.

    Newton's method starts from zero, so that what is between the steps depends on nothing that was asked for before.
    """
    c = load_series(context)
    f, r, kept = c.tangent, c.tangent.friction, c.expansion.kept
    copy(r.lam, kept)
    for e in range(r.lam.size):
        r.lam[e] = 0.0
    found = accelerate_with_friction(c.graph, c.system, c.work, f, t, LAST_PLACE)
    refine_accelerations(c.graph, f)
    write_accelerations(c.graph.bodies, f.poses, f.Z, c.work.qdd)
    copy(kept, r.lam)
    return 0 if found else JAMMED


# Dense output of a Taylor run: the series of a step, evaluated and projected onto the manifold.


@callback(READ)
def read_series(context, run, size, block, begun, width, point, t, asked, out):  # ten: as of `dense_output.read`
    """out (3, n): q, qd, qdd at t within the step of a block; as runs.dense_output.read. Status."""
    c, r, step = load_series(context), load_run(run), vector(block, size)
    w, x, data = c.work, c.expansion, step[B_DATA:]
    # A block is the whole series of a step, which serves for all times in the step
    if asked % WHOLE != SAME_STEP:
        x.order.top = int(data[0])
        copy(data[1 + w.q.size :][: x.bodies.size], x.bodies)
    # Poses of the start are where Euler parameters are followed from
    copy(data[1:][: w.q.size], w.q)
    recall(c.system, step)
    set_floor(c, w.q)
    place_bodies(c.graph.bodies, w.q, c.tangent.poses)
    keep_start(c.graph, c.tangent.poses, x.start)
    status = state_within(context, c, r.kernels, t, t - step[B_START], asked >= WHOLE)
    if status == 0:
        put_state(w, matrix(out, 3, w.q.size))
    return status


def reading_workspace(system, graph, orders, size):
    """Context and run of a reader, with room for so many orders; size: of the numbers in the constraints."""
    own = system._replace(reals=system.reals.copy())
    n = int(own.bodies[:, 1].sum())
    work = plain_work(n)
    work.control.size = size
    expansion = empty_series(orders, np.zeros((len(graph.bodies) + 1) * BODY_ROW * orders), kept_multipliers(graph))
    return SeriesContext(own, work, graph, allocate_tangent(graph, n), expansion, Trial()), lay_out(n, 0, 0, 0, 0)


# Run workspace of the Taylor driver, and what all Taylor runs of a scene share.

PASSAGE = Status.PASSAGE


class Series:
    """What the Taylor runs of a packed scene share: its graph, with the loops that they need.

    Parameters
    ----------
    packed : Packed
    found : str
        Its `layout.refusal`.

    Raises
    ------
    InvalidArgument
        If a part of the scene has no series, or an inertia has no inverse; names them.
    """

    def __init__(self, packed, found):
        if found:
            raise InvalidArgument(found)
        graph, self.kinds = moving_parts(packed)
        if packed.derived.switched is not None:
            graph = with_all_rows(graph)
        self.constant_columns = _masks_once(graph, packed)
        self.graph = with_ground_contacts(with_loops(graph, self.kinds, REDUCED, VALUES, BIAS, DRIFT), self.kinds)
        self.refined = int(len(graph.bodies) > MANY_BODIES or are_unequal(packed.system))
        self.engines = {}  # scene_cache.Prepared.engine
        self.idle = {}  # readers that are not in use, by their highest orders: of phases


def _masks_once(graph, packed):
    """As `layout.masks`, which scenes of a family with the same parameters of constraints share."""
    shared = packed.derived.shared
    if shared is None:
        return masks(graph, packed)
    key = masks, graph.row.tobytes(), graph.bodies.tobytes()
    given, table, constant = shared.get(key, (None, None, 0))
    if given == packed.parameters:
        graph.table[...] = table
        return constant
    constant = masks(graph, packed)
    shared[key] = packed.parameters, graph.table.copy(), constant
    return constant


class SeriesMemory(Memory):
    """The memory of a run by series.

    Parameters
    ----------
    prepared : Prepared
    highest : int
        The highest order that there is room for.
    """

    driver = advance_series

    def __init__(self, prepared, highest):
        self.series, packed, n = prepared.series, prepared.packed, prepared.n
        graph, system = self.series.graph, System(*(array.copy() for array in packed.system))
        expansion = allocate_expansion(graph, self.series.kinds, packed, highest)
        tangent, trial = allocate_tangent(graph, n), Trial()
        trial.left = 1.0
        if expansion.forces["check"].any():
            trial.check, trial.sharp = check_laws.address, int(expansion.forces["sharp"].any())
        block = 1 + n + expansion.bodies.size
        run = lay_out(n, 0, 0, prepared.handles.count, system.memory.size, block=block)
        context = SeriesContext(system, plain_work(n), graph, tangent, expansion, trial)
        super().__init__(prepared, graph, context, run)
        self.reals = packed.system.reals
        self._laid_out.append(words(expansion.order))
        self.nbytes = 8 * (expansion.bodies.size + expansion.constraints.size + tangent.rows.S.size + run.block.size)

    def enter(self, engine, task, may_pass):
        """As of `Memory`; the numbers of a phase may be others."""
        self.reals = task.prepared.packed.system.reals
        super().enter(engine, task, may_pass)

    def advance(self, log, most):
        """As of `Memory`."""
        status = super().advance(log, most)
        if status is PASSAGE:  # the run ends next to a singular configuration
            self.run.kernels.pass_singular = pass_singular.address
            status = super().advance(log, most)
        return status


# The engine of runs by Taylor series; see runs/driver.py.


class SeriesEngine:
    """A run by Taylor series, in the tangent form."""

    layouts, readings = 0, (None, (None, None))

    def __init__(self, prepared, method, form, within):
        self.method, self.form, self.within = method, form, within
        self.series, self.orders = prepared.series, method.orders()
        self.highest = self.orders[2]
        self.kind = "taylor", self.highest
        self.skipped = prepared.spheres, prepared.still, self.series.constant_columns

    def memory(self, prepared):
        """A new `SeriesMemory`."""
        return SeriesMemory(prepared, self.highest)

    def serves(self, memory):
        """Whether the memory is not that of the scene before it was changed."""
        return memory.series is self.series

    def lay_out(self, memory, interval):
        """Enter the orders of the method and the kernels; no chart is forced by an interval."""
        method, graph = self.method, self.series.graph
        order = memory.context.expansion.order
        order.room, (order.top, order.lowest, order.highest) = room(self.highest), self.orders
        order.next = order.top
        order.refined = max(method.refined, self.series.refined)
        if method.step is not None:  # the order follows from tolerances even so
            memory.run.clock.rtol, memory.run.clock.atol = method.step_tolerances()
        _set_kernels(memory.run, graph, self.highest, self.within)

    def reading(self, memory, prepared, constraint_tol):
        """A `Reading` of the steps; a function and its arguments that make it in another process."""
        packed = prepared.packed
        return _reading(packed, self.series, self.highest), (read_again, packed, self.highest)


def read_again(packed, highest):
    """A `Reading` in another process than the run's."""
    return _reading(packed, Series(packed, refusal(packed)), highest)


def _reading(packed, series, highest):
    def workspace():
        context, run = reading_workspace(system, graph, room(highest), packed.size)
        _set_kernels(run, graph, highest, True)
        return context, run

    def begin(context):
        set_selection(context.tangent, off)

    system, graph, idle = packed.system, series.graph, series.idle.setdefault(highest, [])
    if packed.derived.switched is None:
        return TrajectoryReading(read_series, workspace, system, 0, 16, idle=idle)
    off = np.flatnonzero(np.isin(graph.row, redundant_rows(packed)))
    return TrajectoryReading(read_series, workspace, system, 0, 16, begin=begin, idle=idle)


def expanding(rough, far):
    """What expands the series; rough: of a scene with joint friction, far: of many bodies."""
    return expand_friction_series if rough else expand_far_series if far else expand_series


def accelerating(rough):
    """What gives accelerations between the steps."""
    return accelerate_with_friction_here if rough else accelerate_here


def _set_kernels(run, graph, highest, within):
    """Addresses that the driver and readers call; within: whether anything is asked for between the steps."""
    kernels, rough = run.kernels, len(graph.frictions) > 0
    kernels.expand, kernels.reach = expanding(rough, is_far(graph, highest)).address, reach.address
    if within:
        kernels.accelerate_here, kernels.pass_singular = accelerating(rough).address, pass_singular.address
