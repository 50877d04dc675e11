"""The workspace of a run: all arrays are laid out once, before the first step."""

from functools import cache
from typing import NamedTuple

import numpy as np

from ..jit.kernels import Record, loader
from ..model.packed import System, no_system
from ..rows.interface import TangentWorkspace, allocate_tangent
from ..sparse.constraint_graph import ConstraintGraph, no_graph
from .carving import carve
from .chart_workspace import ChartWorkspace, allocate_chart
from .saddle_workspace import SaddleWorkspace, allocate_saddle
from .stage_records import StageIteration, StageKernels, StageNumbers


class Control(Record):
    """Tolerances, and criteria of the present chart."""

    u_tol: float  # |Phi| of the position solve, Eq. 29
    b_tol: float  # ||Phi_q U B - I||, Eq. 28
    size: float  # of the numbers that enter Phi, m
    floor: float  # |Phi| that rounding leaves
    rate: float  # of Newton's method for positions: of residuals, in the tangent form over the residual
    contraction: float  # of the chart, dimensionless; chart_validity.py
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
    """n coordinates, m constraints, k = n - m + d degrees of freedom, d redundant rows, b bodies.

    "computed by" names the kernel. What belongs to a redundant row is zero, on the diagonal of N and B one.
    """

    q: np.ndarray  # (n,)    positions; computed by newton_iterations.solve_positions
    qd: np.ndarray  # (n,)   velocities; computed by null_space.velocities
    qdd: np.ndarray  # (n,)  accelerations; computed by null_space.complete
    Phi: np.ndarray  # (m,)  constraints at q; newton_iterations.solve_positions, and scratch of null_space.complete
    Phi_t: np.ndarray  # (m,)  their time derivative; null_space.velocities
    gamma: np.ndarray  # (m,)  acceleration bias; null_space.reduced_acceleration
    z: np.ndarray  # (m,)    B f, f being Phi, Phi_t, gamma, ...; newton_iterations, null_space; scratch elsewhere
    Phi_q: np.ndarray  # (m, n)  Jacobian at q; null_space_chart.tangent_map, new_chart
    q0: np.ndarray  # (n,)   base point of the chart; null_space_chart.new_chart
    U: np.ndarray  # (n, m)  spans W0 Phi_q(q0)^T, in place of Eq. 5; null_space_chart.new_chart
    V: np.ndarray  # (n, k)  orthonormal basis of ker Phi_q(q0); null_space_chart.new_chart
    L: np.ndarray  # (n, k)  transposed: V^T P0, P0 the projection along U; null_space_chart.new_chart
    B: np.ndarray  # (m, m)  (Phi_q U)^-1, Eqs. 7, 28, warm-started; newton_iterations.update_b
    u: np.ndarray  # (m,)    normal coordinates, Eqs. 19-21, warm-started; newton_iterations, tangent.place
    T: np.ndarray  # (m, k)  B Phi_q V = du/dv; null_space_chart.tangent_map
    v: np.ndarray  # (k,)    tangent coordinates of the latest u; newton_iterations.solve_positions
    base: np.ndarray  # (n,)   q0 + V v; newton_iterations.solve_positions
    N: np.ndarray  # (m, m)  Phi_q U; null_space_chart.tangent_map
    R: np.ndarray  # (m, m)  residual of Eq. 28, and scratch of factorisations; newton_iterations.update_b
    X: np.ndarray  # (m, k)  Phi_q V, or U^T V; null_space_chart.tangent_map, new_chart
    D: np.ndarray  # (n, k)  (I - U B Phi_q) V, Eq. 9; null_space_chart.tangent_map
    E: np.ndarray  # (3 b, k)  body angular velocity per tangent velocity, omega' = E vd; null_space.reduced_mass
    A: np.ndarray  # (k, k)  D^T M D, then its Cholesky factor; null_space.reduced_mass
    Q: np.ndarray  # (n,)    applied forces without gravity; null_space.reduced_acceleration
    h: np.ndarray  # (n,)    -U B gamma; null_space.reduced_acceleration
    householder: np.ndarray  # (n, m)  R of U / scale = Q R, above the reflectors of Q; dense_linalg.null_space
    control: Control
    counters: Counters
    redundant: np.ndarray  # int64 (d + 1,)  number of redundant rows of Phi, and which; dense_rows.take_selection


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


def allocate(n, m, bodies, constraint_tol, size=1.0, joint_rows=None, redundant=0):
    """Lay out the scratch memory of a formulation; size is that of the numbers in the constraints.

    With joint_rows, how many rows are no normalisations, that of the form without a basis: no matrices.
    """
    shapes = {**dict.fromkeys(("q", "qd", "qdd"), (n,)), "u": (m if joint_rows is None else joint_rows,)}
    if joint_rows is not None:
        n = m = bodies = redundant = 0
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
    }
    work = Work(**carve(shapes, control=Control, counters=Counters), redundant=np.zeros(redundant + 1, np.int64))
    hold(work.control, constraint_tol, size, joint_rows is not None)
    return work


def hold(control, constraint_tol, size, basis_free):
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
    return Work(**carve(shapes, control=Control, counters=Counters), redundant=np.zeros(1, np.int64))


def parts(system, graph, n):
    """`Parts` for n coordinates, without matrices."""
    return Parts(system, plain_work(n), graph, allocate_tangent(graph, n))


def no_parts():
    """Those of nothing, for their type."""
    return parts(plain_context().system, no_graph(), 0)


load_parts = loader(no_parts())
