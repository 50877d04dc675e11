"""Scratch memory of a run: every array is laid out once, before the first step."""

import ctypes
import math
from functools import cache
from typing import NamedTuple

import numpy as np

from .jit.kernels import Record, loader
from .jit.resident import zeros
from .model.packed import WIDTH, System, no_system
from .rows.constraint_graph import ConstraintGraph, no_graph
from .rows.interface import Rows, TangentWorkspace, allocate_rows, allocate_tangent, lu_factors
from .rows.saddle_matrix import BLOCK, SaddleGraph, no_saddle

# Arrays and records cut from one block of memory.


def carve(shapes, **records):
    """Records of these classes and arrays of these shapes, by name, all zero, cut in this order from one block.

    The block is the `base` of each array.
    """
    sizes = {name: math.prod(shape) for name, shape in shapes.items()}
    words = {name: ctypes.sizeof(kind) // 8 for name, kind in records.items()}
    block, found, at = np.zeros(sum(words.values()) + sum(sizes.values())), {}, 0
    for name, kind in records.items():
        found[name] = kind.from_buffer(block, 8 * at)
        at += words[name]
    for name, shape in shapes.items():
        found[name] = block[at : at + sizes[name]].reshape(shape)
        at += sizes[name]
    return found


def divided(block, *parts):
    """A block in two: the records and arrays that it begins with, and the rest."""
    at = sum(part.size if isinstance(part, np.ndarray) else ctypes.sizeof(part) // 8 for part in parts)
    return block[:at], block[at:]


def words(record):
    """The numbers of a record as an array of words, which is copied and cleared in less time."""
    return np.frombuffer(record, np.int64)


def arrays_of(value):
    """The arrays of named tuples, and their records as arrays of words."""
    if isinstance(value, np.ndarray):
        return [value]
    return [array for part in value for array in arrays_of(part)] if isinstance(value, tuple) else [words(value)]


# The chart workspace of the tangent form: base point q0, normal space at q0, chart coordinates of the bodies.
#
# The chart coordinates of a body are a row of eight floats, (rho, 0, eta, 0): r = r0 + rho, p = p0 o (d0, d) with d =
# eta / 2 and d0 = sqrt(1 - |d|^2), so that p has length one. It is the paper's chart q = q0 + V v - U u with xi = V v
# and U spanning W0 Phi_q0^T, W0 the inverse mass matrix: xi_p is orthogonal to p0, and the component of u along a
# normalisation row is d0 - 1.


class ChartState(Record):
    """What is known at the present configuration."""

    time: float  # of the last position solve
    factored: int  # 1 if lower and upper hold factors of N
    off: float  # error of these factors at the configuration itself, relative
    made: int  # 1 if lower and upper hold factors of N at any configuration of this chart
    formed: int  # 1 if S is that of a stage, not factored yet
    bare: int  # 1 if a position is asked for without factors of S, velocities without forces; tangent form
    turn_limit: float  # |d| of a body beyond which the chart is left
    free: int  # 1 at a stage off the manifold, where S isn't factorised if there is joint friction
    loads_left: float  # relative error of the multipliers that such a stage may leave with joint friction


class ChartWorkspace(NamedTuple):
    """b bodies and the ground, m rows that are no normalisations; "computed by" names the kernel."""

    base: np.ndarray  # ((b + 1) * 8,)  r0 and a zero, p0; charts.set_base_point
    d: np.ndarray  # ((b + 1) * 4,)  d, d0 - 1 at present; charts.displace
    x: np.ndarray  # ((b + 1) * 8,)  its coordinates; tangent.place
    y: np.ndarray  # ((b + 1) * 8,)  their rates; tangent.accelerate
    rows0: Rows  # H0, Y0, S0: the rows at q0; charts.set_base_point
    X: np.ndarray  # (pairs * 16,)  C Y0; schur_complement.factorise_chart_matrix
    lower: np.ndarray  # factors of N = H C Y0; schur_complement.factorise_chart_matrix
    upper: np.ndarray
    drift: np.ndarray  # (m,)  Phi_t
    state: ChartState


def allocate_chart(graph):
    """Lay it out; the ground doesn't move, nor does a point mass turn."""
    nb, m = len(graph.bodies), len(graph.row)
    base = zeros(8 * (nb + 1))
    base[4::8] = 1.0
    return ChartWorkspace(
        base, zeros(4 * (nb + 1)), zeros(8 * (nb + 1)), zeros(8 * (nb + 1)),
        allocate_rows(graph), zeros(16 * len(graph.sides)), *lu_factors(graph.pattern), zeros(m), ChartState(),
    )  # fmt: skip


# The workspace of the saddle-point matrix: blocks of stiffness and damping, factors, derivatives of one instance.

LOCAL = 14  # coordinates of two bodies


class SaddleWorkspace(NamedTuple):
    """nb bodies, m rows, s unknowns, r rows of the longest constraint; of no size but for implicit methods."""

    graph: SaddleGraph
    K: np.ndarray  # (blocks * 36,)  stiffness, body by body: (r, pi'); saddle_point.py
    C: np.ndarray  # (blocks * 36,)  damping
    B: np.ndarray  # (nb * 9,)  omega' by pi' at constant rates of chart coordinates; saddle_point.py
    lower: np.ndarray  # factors; saddle_point.factorise
    upper: np.ndarray
    multipliers: np.ndarray  # (m,)  what the last Newton correction led to; implicit_tangent.correct
    before: np.ndarray  # (m,)  those of the stage before; implicit_tangent.py
    a: np.ndarray  # ((nb + 1) * 8,)  accelerations of bodies, the same
    x: np.ndarray  # (s,)  right-hand side and solution, in order of elimination
    r: np.ndarray  # ((nb + 1) * 8,)  tangent part of a vector of chart coordinates
    e: np.ndarray  # ((nb + 1) * 8,)  the same of an error of positions
    loads: np.ndarray  # ((nb + 1) * 8,)  forces on bodies at a stage; implicit_tangent.py
    z: np.ndarray  # (m,)  normal part of the velocities: xd - Y0 z; implicit_tangent.py
    stages: np.ndarray  # (p, 3 m)  of a collocation method's p stages: u, z, multipliers; implicit_tangent.py
    last: np.ndarray  # (p, 3 m)  those of the step before
    normal: np.ndarray  # (p, m)  multipliers of the normal parts of accelerations
    right: np.ndarray  # (p, s)  right-hand sides, then corrections
    solved: np.ndarray  # (p, s)  corrections, in coefficients of the eigenvectors
    turns: np.ndarray  # (p, (nb + 1) * 4)  d of the chart at each stage
    changes: np.ndarray  # (p, (nb + 1) * 8)  corrections of the accelerations of chart coordinates
    complex_lower: np.ndarray  # (p // 2, 2 size)  factors with complex steps, numbers in pairs
    complex_upper: np.ndarray
    complex_x: np.ndarray  # (2 s,)
    q: np.ndarray  # (14,)  coordinates of an instance's two bodies
    qd: np.ndarray  # (14,)
    R: np.ndarray  # (14,)  generalised forces
    lam: np.ndarray  # (r,)  its multipliers
    X: np.ndarray  # (14, 14)  its derivatives in these coordinates
    Xd: np.ndarray  # (14, 14)
    rows: np.ndarray  # (r, 14)  its rows of Phi_q
    own: np.ndarray  # int64 (8,)  its table, as if there were no other bodies: coordinate_rows.py


def allocate_saddle(graph=None, coupled=0):
    """Lay it out for a `SaddleGraph`; `coupled` stages are solved at once."""
    wanted, graph = graph is not None, graph or no_saddle()
    nb, s, size = len(graph.body_at), int(graph.pattern.shape[0]), int(graph.pattern.shape[2])
    m, pairs = len(graph.row_at), coupled // 2
    local, most = LOCAL * wanted, int(graph.constraints["rows"].max(initial=0))
    shapes = {
        **dict.fromkeys(("K", "C"), (BLOCK * len(graph.blocks),)),
        "B": (9 * nb,),
        **dict.fromkeys(("lower", "upper"), (size,)),
        "x": (s,),
        **dict.fromkeys(("multipliers", "before", "z"), (m,)),
        **dict.fromkeys(("a", "r", "e", "loads"), (8 * (nb + 1) * wanted,)),
        **dict.fromkeys(("stages", "last"), (coupled, 3 * m)),
        "normal": (coupled, m),
        **dict.fromkeys(("right", "solved"), (coupled, s)),
        "turns": (coupled, 4 * (nb + 1)),
        "changes": (coupled, 8 * (nb + 1)),
        **dict.fromkeys(("complex_lower", "complex_upper"), (pairs, 2 * size)),
        "complex_x": (2 * s if coupled else 0,),
        **dict.fromkeys(("q", "qd", "R"), (local,)),
        "lam": (most,),
        **dict.fromkeys(("X", "Xd"), (local, local)),
        "rows": (most, local),
    }
    return SaddleWorkspace(graph, **carve(shapes), own=np.array([0, 7, 0, 0, 0, 7, 0, LOCAL], np.int64))


# Numbers and addresses of an implicit method's stages, in its `ImplicitWorkspace`.


class StageNumbers(Record):
    """Settings of the stages' Newton iteration, and what it knows from one stage to the next."""

    rtol: float
    atol: float
    kappa: float  # error norm that the iteration of a stage may leave
    slips: int  # whether there is friction, and so velocities of stages are predicted
    g: float  # h a_ii of the factors in P; 0 where there are none
    chart: int  # counter of charts when P was made, for a form whose P serves one chart only
    every_chart: int  # 1 for one whose P serves every chart
    known: int  # whether there are stiffness and damping
    left: float  # error norm after a first correction as last measured, growing with every stage since
    first: float  # size of that correction
    slow: float  # contraction above which P is rebuilt, if no new one contracts below the usual limit; else 0
    t_before: float  # s, start of the last step; -inf for the first one
    eager: int  # stages that are still to be begun with a matrix of their own
    rates_of: int  # counter of charts when z of the stages was last set; 0 where z and multipliers are unknown
    time: float  # s, of the last stage, and of the one before; -inf where they are unknown
    time_before: float
    lag: float  # contraction of corrections by factors of N of an older configuration, as last measured
    fresh: int  # 1 if the derivatives of the forces' laws are to be taken by saddle_point.reduce


class StageIteration(Record):
    """Newton's iteration of one stage: its limits, and what its corrections have shown so far."""

    floor: float  # error norm of a correction that is rounding
    limit: float  # contraction above which the matrix is renewed
    before: float  # error norm of the correction before, by the same matrix; inf for none
    theta: float  # contraction: the last one measured, or assumed
    measured: int  # whether it has been measured
    first: float  # size of the first correction, and of what it left; inf where that is unknown
    second: float
    trusted: int  # whether this stage's first correction leaves what those before it have left
    renewed: int  # whether the matrix was renewed in this stage
    poor: int  # matrices that were renewed for poor contraction
    diverged: int  # iterations that diverged with a new matrix
    eager: int  # whether the stage begins with a matrix of its own


class StageKernels(Record):
    """Addresses of the kernels in formulations/linearisation.py or saddle_point.py, of `recall`, of the error norm.

    `residual`, `correct` and `distance` are those of implicit_tangent.py; 0 for a form without them.
    """

    linearise: int
    reduce: int
    factorise: int
    solve: int
    soften: int
    recall: int
    error_norm: int
    residual: int
    correct: int
    distance: int
    take_stage: int  # those of collocation_stages.py: take_stage to solve_stages
    balance_stage: int
    factorise_stages: int
    solve_stages: int


# The state of one run: arrays and numbers that drivers, step kernels and interpolants share, and their layout.

AGAIN = 2  # Numbers.rejected_last: by a failed stage
MIXED = 2  # Numbers.first_order: velocities have fewer coordinates than positions
FILLED, STORED = 1, 2  # Numbers.dense: every step's block is made, and kept
# block: what it begins with, before the interpolant's data
B_START, B_H, B_END, B_CHART, B_DATA = range(5)


class Clock(Record):
    """Times (s), tolerances and factors of a run."""

    t: float  # of the last accepted point
    t_origin: float
    t_end: float
    h: float  # of the next step: proposed, or fixed
    rtol: float
    atol: float
    max_step: float
    exponent: float  # of the error, in the choice of a step
    error_before: float  # of the last accepted step, over the tolerance
    acceleration: float  # |qdd| at the end of that step; zero: not known
    change: float  # log(a0 / a1) of that step, step_control.py
    ideal: float  # log H of that step
    along: float  # faded sum of log(a0 / a1) times the change of log H after it
    square: float  # faded sum of log(a0 / a1)^2
    stability_limit: float  # of h |lambda|; zero: not watched
    turn_share: float  # of the longest step that rotations allow
    largest_landing: float  # m; how far a projection near a singular configuration has moved a body at most


class RunNumbers(Record):
    """Counts, settings and states of a run; settings and states that are no numbers are 0 or 1."""

    first_order: int  # whether x' is not y; MIXED: and x not q
    adaptive: int
    steps_wanted: int
    chart_interval: int  # steps between charts that are forced; 0 for none
    free_stages: int  # whether stages stay where their sums put them, off the manifold
    dense: int  # 0, FILLED or STORED
    may_pass: int  # whether a singular configuration ends the run with PASSAGE
    leave_when_stiff: int
    begun: int
    waiting: int  # whether a stop waits for Python
    steps: int
    rejected: int
    rejected_last: int  # 1: by its error; AGAIN
    failed: int  # Status of the last step that was not made, 0 after one that was
    cuts: int  # fixed steps cut at stops
    in_chart: int  # steps on the present chart
    near_steps: int  # near a singular configuration
    rows: int  # of the log's out that are written
    history: int  # of its history
    chart_rows: int  # of its charts that are closed
    blocks: int  # of its blocks
    next_eval: int  # in its t_eval
    next_stop: int  # in its stops
    normal_at: int  # where in a block the normal coordinates of the step's ends begin; 0: it has none
    last_stage: int  # where in memory an explicit method leaves its last stage; 0: stiffness is not watched
    stage_at: int  # where in memory an implicit method leaves its last stage; 0 for others
    at_limit: int  # steps at the limit of stability, or in which little moves
    below_limit: int
    still: int  # steps of an explicit stage method in which hardly anything moves; of an implicit one, joints at rest
    stiff: int


class RunKernels(Record):
    """Addresses of what drivers call; zero for what a run doesn't."""

    place: int  # the formulation's: place to normal
    accelerate: int
    stage_place: int  # place and accelerate of an explicit step's stages
    stage_accelerate: int
    complete: int
    check: int
    start_chart: int
    error_norm: int
    normal: int  # of a form with a basis: u and ud
    step: int  # the method's: step to second
    plug_in: int  # the step kernel of a plug-in; see methods/explicit.py
    error: int
    second_error: int
    fill: int
    value: int
    second: int
    watch: int  # step_control.watch, where functions of the state are loads
    expand: int  # of a Taylor step: see taylor/step_parts.py
    reach: int
    accelerate_here: int
    pass_singular: int


class RunState(NamedTuple):
    """The state of a run, and the driver's scratch. x, y are v, vd (tangent-space ODE), v, w (mixed) or q, w."""

    x: np.ndarray  # (nx,)
    y: np.ndarray  # (ny,)
    yd: np.ndarray  # (ny,)
    xd: np.ndarray  # (nx,)
    dx: np.ndarray  # (nx,)  increments of a step, then its error; scratch of dense output
    dy: np.ndarray  # (ny,)
    x_low: np.ndarray  # (nx,)  what the additions have lost so far (Kahan)
    y_low: np.ndarray  # (ny,)
    x_old: np.ndarray  # (nx,)  at the start of the step, for dense output and to go back to
    y_old: np.ndarray  # (ny,)
    yd_old: np.ndarray  # (ny,)
    xd_old: np.ndarray  # (nx,)
    x_low_old: np.ndarray  # (nx,)
    y_low_old: np.ndarray  # (ny,)
    now: np.ndarray  # (3, n)  q, qd, qdd at the last accepted point
    before: np.ndarray  # (3, n)  at the one before; kept for a first-order system and for implicit methods
    warm: np.ndarray  # what `dense_output.keep` copies while dense output moves it
    xs: np.ndarray  # (nx,)  dense output and the guess of a first step
    ys: np.ndarray  # (ny,)
    yds: np.ndarray  # (ny,)
    remembered: np.ndarray  # (angles + slots,)  angles of joints at the last accepted point, and what forces remember
    frames: np.ndarray  # (angles, 9)  f, g and h of each angle; see joint_turns.py
    joints: np.ndarray  # int64 (angles, 4)  where its two bodies' coordinates begin, and how many they are
    watched: np.ndarray  # int64 (kinds,)  rows of System.forces that are sampled along steps; see step_control.py
    loaded: np.ndarray  # int64 (bodies,)  that they act on
    path: np.ndarray  # scratch of step_control.py
    tableau: np.ndarray  # the method's numbers
    memory: np.ndarray  # the method's scratch
    normal: np.ndarray  # (2 m,)  normal coordinates u and ud at the last accepted point; of no size without a basis
    block: np.ndarray  # the present step's: start, h, end, chart; the interpolant's data; u, ud of its ends; ...
    clock: Clock
    numbers: RunNumbers
    kernels: RunKernels


def enter_joints(run, handles, remembered):
    """Let a run count the angles of a scene's joints from those remembered on."""
    run.joints[:], run.frames[:], run.remembered[:] = handles.joints, handles.frames, remembered


def lay_out(n, nx, ny, angles, slots, *, tableau=0, memory=0, warm=0, block=0, normal=0, path=0, watched=0, loaded=0):
    """The `RunState` of a system of sizes nx, ny, whose forces remember so many `slots`.

    The other lengths are those of its arrays; a block is longer than its interpolant's data, which is what is given.
    """
    shapes = {
        **dict.fromkeys(("now", "before"), (3, n)),
        "remembered": (angles + slots,),
        "frames": (angles, 9),
        "tableau": (tableau,),
        **dict.fromkeys(("x", "xd", "xd_old", "dx", "x_low", "x_low_old", "x_old", "xs"), (nx,)),
        **dict.fromkeys(("y", "yd", "dy", "y_low", "y_low_old", "y_old", "yd_old", "ys", "yds"), (ny,)),
        "warm": (warm,),
        "memory": (memory,),
        "normal": (2 * normal,),
        "block": (B_DATA + block + 4 * normal + angles + slots,),
        "path": (path,),
    }
    whole = {"joints": (angles, 4), "watched": (watched,), "loaded": (loaded,)}
    integers = {name: np.zeros(shape, np.int64) for name, shape in whole.items()}
    return RunState(**carve(shapes, clock=Clock, numbers=RunNumbers, kernels=RunKernels), **integers)


load_run = loader(lay_out(1, 1, 1, 1, 1))


# The workspace of a run: all arrays are laid out once, before the first step.


class LevelControl(Record):
    """Tolerances, and criteria of the present chart."""

    u_tol: float  # |Phi| of the position solve, Eq. 29
    b_tol: float  # ||Phi_q U B - I||, Eq. 28
    size: float  # of the numbers that enter Phi, m
    floor: float  # |Phi| that rounding leaves
    rate: float  # of Newton's method for positions: of residuals, in the tangent form over the residual
    contraction: float  # of the chart, dimensionless; charts.py
    condition: float  # of N as far as the contraction says


class Counters(Record):
    """How often it was done in a run."""

    evaluations: int  # of accelerations
    placements: int  # of position solves
    newton: int  # sweeps of Eq. 29
    b_iterations: int  # of Eq. 28
    factorizations: int
    charts: int
    jacobians: int  # of implicit methods
    iteration_matrices: int
    stage_iterations: int
    at_rounding: int  # position solves that started at rounding
    unverified: int  # corrections that were known to suffice
    kept: int  # factorisations whose older factors served


class Work(NamedTuple):
    """n coordinates, m constraints, k = n - m + d degrees of freedom, d redundant and i inertia rows, b bodies.

    "computed by" names the kernel. What belongs to a redundant row is zero, on the diagonal of N and B one.
    """

    q: np.ndarray  # (n,)    positions; computed by null_space_chart.solve_positions
    qd: np.ndarray  # (n,)   velocities; computed by null_space.velocities
    qdd: np.ndarray  # (n,)  accelerations; computed by null_space.complete
    Phi: np.ndarray  # (m,)  constraints at q; null_space_chart.solve_positions, and scratch of null_space.complete
    Phi_t: np.ndarray  # (m,)  their time derivative; null_space.velocities
    gamma: np.ndarray  # (m,)  acceleration bias; null_space.reduced_acceleration
    z: np.ndarray  # (m,)    B f, f being Phi, Phi_t, gamma, ...; null_space_chart, null_space; scratch elsewhere
    Phi_q: np.ndarray  # (m, n)  Jacobian at q; null_space_chart.tangent_map, new_chart
    q0: np.ndarray  # (n,)   base point of the chart; null_space_chart.new_chart
    U: np.ndarray  # (n, m)  spans W0 Phi_q(q0)^T, in place of Eq. 5; null_space_chart.new_chart
    V: np.ndarray  # (n, k)  orthonormal basis of ker Phi_q(q0); null_space_chart.new_chart
    L: np.ndarray  # (n, k)  transposed: V^T P0, P0 the projection along U; null_space_chart.new_chart
    B: np.ndarray  # (m, m)  (Phi_q U)^-1, Eqs. 7, 28, warm-started; null_space_chart.update_b
    u: np.ndarray  # (m,)    normal coordinates, Eqs. 19-21, warm-started; null_space_chart, tangent.place
    T: np.ndarray  # (m, k)  B Phi_q V = du/dv; null_space_chart.tangent_map
    v: np.ndarray  # (k,)    tangent coordinates of the latest u; null_space_chart.solve_positions
    base: np.ndarray  # (n,)   q0 + V v; null_space_chart.solve_positions
    N: np.ndarray  # (m, m)  Phi_q U; null_space_chart.tangent_map
    R: np.ndarray  # (m, m)  residual of Eq. 28, and scratch of factorisations; null_space_chart.update_b
    X: np.ndarray  # (m, k)  Phi_q V, or U^T V; null_space_chart.tangent_map, new_chart
    D: np.ndarray  # (n, k)  (I - U B Phi_q) V, Eq. 9; null_space_chart.tangent_map
    E: np.ndarray  # (3 b, k)  body angular velocity per tangent velocity, omega' = E vd; null_space.reduced_mass
    A: np.ndarray  # (k, k)  D^T M D, then its Cholesky factor; null_space.reduced_mass
    inertia: np.ndarray  # (i, 14)  inertia rows; null_space.reduced_mass
    inertia_D: np.ndarray  # (i, k)  their products with D; null_space.reduced_mass
    inertia_bias: np.ndarray  # (i,)  gamma of these rows; null_space.reduced_acceleration
    Q: np.ndarray  # (n,)    applied forces without gravity; null_space.reduced_acceleration
    h: np.ndarray  # (n,)    -U B gamma; null_space.reduced_acceleration
    householder: np.ndarray  # (n, m)  R of U / scale = Q R, above the reflectors of Q; dense_linalg.null_space
    control: LevelControl
    counters: Counters
    redundant: np.ndarray  # int64 (d + 1,)  number of redundant rows of Phi, and which; null_space_chart.take_selection


class ImplicitWorkspace(NamedTuple):
    """What implicit methods need besides; empty for explicit ones. l = 6 a rigid body and 3 a point mass.

    Body frame means: of a body's displacement, the components A^T dr and dpi' = 2 G dp.
    """

    K: np.ndarray  # (n, n)  stiffness in q, then scratch; linearisation.linearise
    C: np.ndarray  # (n, n)  damping in q, then scratch; linearisation.linearise
    G1: np.ndarray  # (m, n)  (Phi_q qd + Phi_t)_q; equations.constraint_curvature
    G2: np.ndarray  # (m, n)  (Phi_q qdd + gamma)_q; equations.constraint_curvature
    UB: np.ndarray  # (n, m)  U B; linearisation.linearise
    Y: np.ndarray  # (n, n)  U B G1; linearisation.linearise
    Z: np.ndarray  # (n, n)  U B G2; linearisation.linearise
    lam: np.ndarray  # (m,)  multipliers; linearisation.linearise
    r: np.ndarray  # (n,)  Q_A + Q_v - M qdd; linearisation.linearise
    K_body: np.ndarray  # (l, l)  stiffness in body frames, kept over steps and charts; linearisation.linearise
    C_body: np.ndarray  # (l, l)  damping in body frames; linearisation.linearise
    F: np.ndarray  # (l, k)  D in body frames; linearisation.reduce
    X: np.ndarray  # (n, k)  scratch
    X2: np.ndarray  # (n, k)  scratch
    Q_q: np.ndarray  # (n, n)  stiffness of the forces; linearisation.reduce
    Q_qd: np.ndarray  # (n, n)  their damping; linearisation.reduce
    kept: np.ndarray  # derivatives of the forces' laws; forces.jacobian
    K_hat: np.ndarray  # (k, k)  F^T K_body F; linearisation.reduce
    C_hat: np.ndarray  # (k, k)  F^T C_body F; linearisation.reduce
    P: np.ndarray  # (k, k)  LU factors of D^T M D - g C_hat + g^2 K_hat; linearisation.factorise
    b: np.ndarray  # (k,)  scratch
    pivots: np.ndarray  # int64 (k,)  row exchanges of P
    now: np.ndarray  # (3, n)  q, qd, qdd at the last accepted point; the run's own array
    before: np.ndarray  # (3, n)  at the one before; the run's own array
    kernels: StageKernels
    numbers: StageNumbers
    iteration: StageIteration


class Parts(NamedTuple):
    """What kernels without a formulation get, by one address."""

    system: System
    work: Work
    graph: ConstraintGraph
    tangent: TangentWorkspace


class Context(NamedTuple):
    """What a formulation's kernels get, by one address."""

    system: System
    work: Work
    linear: ImplicitWorkspace
    graph: ConstraintGraph
    tangent: TangentWorkspace
    chart: ChartWorkspace
    saddle: SaddleWorkspace


def allocate(n, m, bodies, constraint_tol, size=1.0, joint_rows=None, redundant=0, inertias=0):
    """Lay out the scratch memory of a formulation; size is that of the numbers in the constraints.

    With joint_rows, how many rows are no normalisations, that of the form without a basis: no matrices.
    """
    shapes = {**dict.fromkeys(("q", "qd", "qdd"), (n,)), "u": (m if joint_rows is None else joint_rows,)}
    if joint_rows is not None:
        n = m = bodies = redundant = inertias = 0
    k = n - m + redundant
    shapes |= {
        **dict.fromkeys(("q0", "base", "Q", "h"), (n,)),
        **dict.fromkeys(("Phi", "Phi_t", "gamma", "z"), (m,)),
        **dict.fromkeys(("B", "N", "R"), (m, m)),
        **dict.fromkeys(("U", "householder"), (n, m)),
        **dict.fromkeys(("V", "L", "D"), (n, k)),
        "Phi_q": (m, n),
        **dict.fromkeys(("T", "X"), (m, k)),
        "v": (k,),
        "E": (3 * bodies, k),
        "A": (k, k),
        "inertia": (inertias, WIDTH),
        "inertia_D": (inertias, k),
        "inertia_bias": (inertias,),
    }
    work = Work(**carve(shapes, control=LevelControl, counters=Counters), redundant=np.zeros(redundant + 1, np.int64))
    set_tolerances(work.control, constraint_tol, size, joint_rows is not None)
    return work


def set_tolerances(control, constraint_tol, size, basis_free):
    """Set the tolerances of the constraints; without normalisations in Phi, a small scene is held as closely."""
    control.u_tol = control.b_tol = constraint_tol
    control.size = size
    if basis_free and 0.0 < size < 1.0:
        control.u_tol *= size


def allocate_linear(system, n, m, wanted, kept=0, redundant=0):
    """Lay out the memory of implicit methods, `kept` floats of it for forces; of no size where it is not wanted."""
    k, l = n - m + redundant, sum(6 if length == 7 else 3 for length in system.bodies[:, -1])
    if not wanted:
        n = m = k = l = 0
    shapes = {
        **dict.fromkeys(("K", "C", "Y", "Z", "Q_q", "Q_qd"), (n, n)),
        **dict.fromkeys(("G1", "G2"), (m, n)),
        "UB": (n, m),
        "lam": (m,),
        "r": (n,),
        **dict.fromkeys(("K_body", "C_body"), (l, l)),
        "F": (l, k),
        **dict.fromkeys(("X", "X2"), (n, k)),
        "kept": (kept,),
        **dict.fromkeys(("K_hat", "C_hat", "P"), (k, k)),
        "b": (k,),
    }
    shapes |= {"now": (3, n), "before": (3, n)}
    numbers = carve(shapes, kernels=StageKernels, numbers=StageNumbers, iteration=StageIteration)
    return ImplicitWorkspace(**numbers, pivots=np.zeros(k, np.int64))


def basis_free_parts(graph, n, basis, saddle=None, coupled=0):
    """Graph and workspaces without dense matrices of a Context; saddle: a `SaddleGraph`, of implicit methods.

    coupled: how many stages they solve at once.
    """
    return graph, allocate_tangent(graph, n, basis=basis), allocate_chart(graph), allocate_saddle(saddle, coupled)


@cache
def plain_context():
    """A context of the right types, for these alone."""
    system = no_system()
    return Context(
        system, allocate(2, 1, 1, 1.0), allocate_linear(system, 2, 1, False), *basis_free_parts(no_graph(), 2, False)
    )


load = loader(plain_context())


def plain_work(n):
    """A `Work` for n coordinates that has no matrices."""
    others = ("control", "counters", "redundant")
    shapes = {name: (0,) * array.ndim for name, array in plain_context().work._asdict().items() if name not in others}
    shapes |= {"q": (n,), "qd": (n,), "qdd": (n,)}
    return Work(**carve(shapes, control=LevelControl, counters=Counters), redundant=np.zeros(1, np.int64))


def parts(system, graph, n):
    """`Parts` for n coordinates, without matrices."""
    return Parts(system, plain_work(n), graph, allocate_tangent(graph, n))


def no_parts():
    """Those of nothing, for their type."""
    return parts(plain_context().system, no_graph(), 0)


load_parts = loader(no_parts())
