"""`scene.evaluate(q, qd, t)`: the paper's quantities at one state, in plain NumPy; redundant rows there."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..calls import fitting
from ..elements.bodies import rotation_matrix, transform_g
from ..elements.loops.constraint_rows import place_bodies
from ..errors import InconsistentState, InvalidArgument, SingularConfiguration
from ..jit.interrupts import CollectionsDeferred
from ..jit.kernels import entry, resident, twin
from ..maths.dense_linalg import dependent, farthest_first, sparse_lu
from ..maths.tolerances import COMPLEX_STEP, PIVOT_ROUNDING, RANK_TOL, ROUNDING, SUM_ROUNDING, TINY
from ..model.equations import WIDTH, added_inertia, as_csr, constraint_arrays, set_time, with_short_rows
from ..model.packed import Derived, coupled_loads
from ..rows.constraint_graph import REDUCED, by_lengths, coordinate_scales, graph_of
from ..rows.interface import allocate_tangent, redundant_of, select_rows
from ..validation import finite_vector, number
from ..workspaces import load_parts, parts
from .diagnostics import marker_states, starts_of
from .generalised_forces import applied_loads, force_loads, velocity_forces
from .tolerances import INDEPENDENT, LARGE, REDUNDANT_SHARES

if TYPE_CHECKING:
    from ..hints import ArrayLike, Floats, Matrix, Scene


# Coupled friction and reactions at one state, in plain NumPy, for `scene.evaluate`.

ITERATIONS = 50
JAMMED = (
    "no reactions are consistent with the friction of the joints: with large coefficients of friction the mechanism "
    "may jam here."
)


def balance(packed, t, q, qd, Phi_q, solve, remembered=None):
    """Return friction forces (n,) and the solution of the equations of motion; solve(load) is affine in the load.

    Newton's method for the normal loads N = N(lam_0 + sum_i lam_i N_i).
    """
    system, n = packed.system, q.size
    frictions = coupled_loads(packed)
    units = [unit_force(system, load, t, q, qd, remembered) for load in frictions]
    first = solve(np.zeros(n))
    parts = np.array([solve(unit) - first for unit in units])
    reactions = [normal_reaction(packed, load, q, qd, Phi_q) for load in frictions]
    N = np.zeros(len(frictions))
    for _ in range(ITERATIONS):
        lam = np.nan_to_num((first + N @ parts)[n:])
        values, changes = zip(*(reaction(lam) for reaction in reactions), strict=True)
        J = np.eye(N.size) - np.array(changes) @ np.nan_to_num(parts[:, n:]).T
        try:
            step = np.linalg.solve(J, np.array(values) - N)
        except np.linalg.LinAlgError as error:
            raise SingularConfiguration(JAMMED) from error
        N = N + step
        if not np.abs(step).max() > ROUNDING * np.abs(N).max():
            return N @ np.array(units), first + N @ parts
    raise SingularConfiguration(JAMMED)


def normal_loads(packed, t, q, qd, Phi_q, lam):
    """Return the normal loads (frictions,) by multipliers (m,), and the friction forces of unit ones (frictions, n)."""
    frictions = coupled_loads(packed)
    loads = np.array([normal_reaction(packed, load, q, qd, Phi_q)(lam)[0] for load in frictions])
    return loads, np.array([unit_force(packed.system, load, t, q, qd) for load in frictions])


def unit_force(system, load, t, q, qd, remembered=None):
    """Return the generalised forces g (n,) of one friction for unit normal load."""
    memory = np.zeros((1, system.memory.size + system.normals.size))
    memory[0, : system.memory.size] = system.reals[system.memory] if remembered is None else remembered
    memory[0, system.memory.size + load.normal] = 1.0
    return force_loads(system._replace(forces=load.alone), np.array([t]), q[None], qd[None], memory)[0]


def normal_reaction(packed, load, q, qd, Phi_q):
    """Return a normal load as a function of multipliers (m,), with its derivative (m,)."""
    force, member = load.force, next(m for m in packed.members if m.constraint is load.force.joint)
    rows = Phi_q[member.rows]
    rows = rows if isinstance(rows, np.ndarray) else rows.toarray()
    at, (jets, _) = starts_of(packed)[force.on], marker_states(packed, load, q[None], qd[None])
    x = [float(np.squeeze(jet.x)) for jet in jets]
    s = np.array(x[:3] if force.on is force.a else x[6:9]) - q[at : at + 3]
    wrench = np.zeros((6, rows.shape[0]))  # for unit multipliers: force, and torque about the point
    wrench[:3] = -rows[:, at : at + 3].T
    if force.on.dimension == 7:
        p = q[at + 3 : at + 7]
        wrench[3:] = -0.5 * rotation_matrix(p) @ transform_g(p) @ rows[:, at + 3 : at + 7].T
    wrench[3:] -= np.cross(s, wrench[:3], axisb=0, axisc=0)
    normal, par = twin(type(force).normal_load), [*load.parameters, 1.0]

    def find(lam):
        f = wrench @ lam[member.rows]
        values = [normal(x, f + COMPLEX_STEP * 1j * e, par) for e in np.eye(6)]
        change = np.zeros(lam.size)
        change[member.rows] = np.imag(values) / COMPLEX_STEP @ wrench
        return np.real(values[0]), change

    return find


NOT_UNIQUE = (
    "multipliers and accelerations are not unique here: Phi_q has dependent rows, or a direction that the constraints "
    "leave free carries no inertia."
)
NO_INERTIA = "a direction that the constraints leave free carries no inertia: give its bodies mass and inertia."
ROUNDS, MOST_AT_ONCE = 8, 64  # of restoring rows dropped wrongly; random loads that identify them


class Evaluation(NamedTuple):
    """Everything in the equations of motion at one state; n coordinates, m rows."""

    Phi: Floats  # (m,) constraints, Eq. 1
    Phi_q: Matrix  # (m, n) their Jacobian
    Phi_t: Floats  # (m,) their explicit time derivative
    gamma: Floats  # (m,) Phi_q qdd + gamma = 0, Eq. 3
    M: Matrix  # (n, n) mass matrix
    Q_A: Floats  # (n,) applied forces
    S: Floats  # (n,) velocity forces, on the right-hand side: S of the paper, Q_v of docs/notation.md
    multipliers: Floats  # (m,) M qdd + Phi_q^T lam = Q_A + Q_v
    qdd: Floats  # (n,) accelerations


@fitting
@CollectionsDeferred()
def evaluate(scene: Scene, q: ArrayLike | None = None, qd: ArrayLike | None = None, t: float = 0.0) -> Evaluation:
    """Evaluate constraints, masses, forces, multipliers and accelerations at one state.

    Parameters
    ----------
    q, qd : array_like (n,), optional
        Positions and velocities; default: the initial values. They need not satisfy the constraints.
    t : float, s

    Returns
    -------
    Evaluation
        Named tuple of arrays: Phi, Phi_q, Phi_t, gamma, M, Q_A, S, multipliers, qdd; Phi_q and M are SciPy sparse
        arrays where n is above 1000. Multipliers are NaN for redundant rows.

    Raises
    ------
    InvalidArgument
        If q or qd is not n finite numbers, or t is not finite.
    InconsistentState
        If a result is not finite.
    SingularConfiguration
        If the accelerations are not unique, or dependent rows are incompatible.

    Notes
    -----
    Haug 2018, Eqs. 1-4. Multipliers and accelerations solve [M, Phi_q^T; Phi_q, 0] (qdd, lam) = (Q_A + Q_v, -gamma).
    Friction of the exact law that sticks at the state adds the rows that hold it, behind those of the constraints.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ball = (scene := ts.Scene()).add_point_mass(mass=2.0, position=(1, 0, 0))
    >>> table = scene.add(ts.constraints.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1)))
    >>> at_start = scene.evaluate()
    >>> print(at_start.Phi_q, at_start.M.diagonal(), at_start.multipliers)
    [[0. 0. 1.]] [2. 2. 2.] [-19.62]
    """
    packed, start = scene.packed, scene.start
    q = finite_vector(start[0] if q is None else q, start[0].size, "q")
    qd = finite_vector(start[1] if qd is None else qd, start[0].size, "qd")
    if not np.isfinite(number(t)):
        raise InvalidArgument(f"t must be a finite time in s, got {t!r}.")
    with np.errstate(over="ignore", invalid="ignore"):
        found = _evaluate(packed, q, qd, float(t), q.size > LARGE)
    _demand_finite(accelerations=found.qdd)
    return found


def _demand_finite(**arrays):
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise InconsistentState(
                f"evaluate: {name} is not finite at this state. Look at the masses, loads and motions of the scene."
            )


def _evaluate(packed, q, qd, t, sparse):
    system, n = with_short_rows(packed) if sparse else packed.system, q.size
    Phi, rows, Phi_t, gamma = constraint_arrays(system, q, qd, t, WIDTH if sparse else None)
    M = (mass_matrix_sparse if sparse else mass_matrix)(system, q)
    Q_v = velocity_forces(system, q[None], qd[None])[0]
    Q_A = applied_loads(system, np.array([t]), q[None], qd[None])[0]
    masses = M.data if sparse else M
    _demand_finite(Phi=Phi, Phi_q=rows, Phi_t=Phi_t, gamma=gamma, M=masses, Q_A=Q_A, Q_v=Q_v)
    Phi_q = as_csr(packed, rows) if sparse else rows
    regular = (_sparse_solver if sparse else _dense_solver)(M, Phi_q)

    def solve(friction):
        load = Q_A + Q_v + friction
        if regular is not None:
            return regular(load, gamma)
        if sparse:
            return _of_independent_short_rows(packed, M, Phi_q, load, gamma, q, t)
        return _of_independent_rows(packed, M, Phi_q, load, gamma)

    joined = packed.system.normals.size > 0
    friction, solution = balance(packed, t, q, qd, Phi_q, solve) if joined else (0.0, solve(0.0))
    return Evaluation(Phi, Phi_q, Phi_t, gamma, M, Q_A + friction, Q_v, solution[n:], solution[:n])


def _of_independent_rows(packed, M, Phi_q, load, gamma):
    """Return (qdd, lam) with NaN for redundant rows, which hold all the same."""
    redundant = dependent(Phi_q * coordinate_scales(packed))
    kept = np.setdiff1d(np.arange(len(Phi_q)), redundant)
    solve = _dense_solver(M, Phi_q[kept]) if redundant.size else None
    if solve is None:
        raise SingularConfiguration(NOT_UNIQUE)
    return _with_gaps(solve(load, gamma[kept]), kept, Phi_q, gamma)


def _with_gaps(found, kept, Phi_q, gamma):
    """Return (qdd, lam) of all rows, from that of the kept ones; refuse if a dropped row is violated."""
    m, n = Phi_q.shape
    left = Phi_q @ found[:n] + gamma
    if np.abs(left).max(initial=0.0) > RANK_TOL * (1.0 + np.abs(found[:n]).max()):
        raise SingularConfiguration(NOT_UNIQUE)
    lam = np.full(m, np.nan)
    lam[kept] = found[n:]
    return np.concatenate((found[:n], lam))


def _of_independent_short_rows(packed, M, Phi_q, load, gamma, q, t):
    """Do the same as `_of_independent_rows` with sparse arrays."""
    m, found = len(gamma), False
    for share in REDUNDANT_SHARES:
        redundant = dependent_rows(packed, q, t, share)
        if redundant is None or not redundant.size:
            continue
        found = True
        for _ in range(ROUNDS):
            kept = np.setdiff1d(np.arange(m), redundant)
            solve = _sparse_solver(M, Phi_q[kept])
            if solve is None:
                break
            wrong = _independent(Phi_q[redundant], solve, np.zeros(kept.size))
            if not wrong.size:
                return _with_gaps(solve(load, gamma[kept]), kept, Phi_q, gamma)
            redundant = np.delete(redundant, wrong)
    solve = None if found else _sparse_solver(M, Phi_q, 0.0)  # nonsingular, however badly conditioned
    if solve is None:
        raise SingularConfiguration(NOT_UNIQUE)
    return solve(load, gamma)


def _independent(rows, solve, still):
    """Return the dropped rows that are independent of the kept ones, and of one another.

    Random accelerations admitted by the kept rows leave dependent rows unchanged; `still` is their gamma.
    """
    rng, n, count = np.random.default_rng(0), rows.shape[1], 1
    while True:
        moved = np.stack([solve(rng.normal(size=n), still)[:n] for _ in range(count)], axis=1)
        seen = rows @ (moved / np.abs(moved).max(axis=0))
        if np.abs(seen).max() <= RANK_TOL:
            return np.zeros(0, int)
        order, size = farthest_first(seen)
        rank = (size > INDEPENDENT * size.max()).sum()
        if rank < count or count >= MOST_AT_ONCE:
            return order[:rank]
        count *= 4


def _sparse_solver(M, Phi_q, lost=PIVOT_ROUNDING):
    """Return the solver (load, gamma) -> (qdd, lam) by a sparse factorisation; None if it is numerically singular."""
    from scipy.sparse import block_array, diags_array

    kkt = block_array([[M, Phi_q.T], [Phi_q, None]], format="csc")
    scale = 1.0 / np.sqrt(np.maximum(abs(kkt).max(axis=1).toarray().ravel(), TINY))
    weights = diags_array(scale)
    try:
        factors = sparse_lu((weights @ kkt @ weights).tocsc())
    except RuntimeError:
        return None
    pivots = np.abs(factors.U.diagonal())
    if pivots.min() < lost * pivots.max():
        return None
    return lambda load, gamma: scale * factors.solve(scale * np.concatenate((load, -gamma)))


def _dense_solver(M, Phi_q):
    """Return the same solver of a matrix scaled to unit rows."""
    m = len(Phi_q)
    kkt = np.block([[M, Phi_q.T], [Phi_q, np.zeros((m, m))]])
    scale = 1.0 / np.sqrt(np.maximum(np.abs(kkt).max(axis=1), TINY))
    scaled = kkt * scale[:, None] * scale
    if kkt.size and np.linalg.cond(scaled) > 1.0 / SUM_ROUNDING:
        return None
    return lambda load, gamma: np.linalg.solve(scaled, np.concatenate((load, -gamma)) * scale) * scale


def mass_matrix(system, q):
    """M: m I on r, 4 G^T J' G on p, and h^T h of inertia rows."""
    M = np.zeros((q.size, q.size))
    for (at, length), mass, J in zip(system.bodies, system.mass, system.inertia, strict=True):
        M[at : at + 3, at : at + 3] = mass * np.eye(3)
        if length == 7:
            G = transform_g(q[at + 3 : at + 7])
            M[at + 3 : at + 7, at + 3 : at + 7] = 4.0 * G.T @ J.reshape(3, 3) @ G
    for columns, h, _ in added_inertia(system, q[None], np.zeros((1, q.size))):
        M[np.ix_(columns, columns)] += h.T @ h
    return M


def mass_matrix_sparse(system, q):
    """The same as a SciPy sparse array."""
    from scipy.sparse import csr_array

    r, rigid = system.bodies[:, :1] + np.arange(3), system.bodies[:, 1] == 7
    p, J = system.bodies[rigid, :1] + np.arange(3, 7), system.inertia[rigid].reshape(-1, 3, 3)
    G = transform_g(q[p])
    blocks = 4.0 * G.swapaxes(1, 2) @ J @ G
    i, j = np.broadcast_to(p[:, :, None], blocks.shape), np.broadcast_to(p[:, None], blocks.shape)
    values = np.concatenate((np.repeat(system.mass, 3), blocks.ravel()))
    places = [np.concatenate((r.ravel(), k.ravel())) for k in (i, j)]
    M = csr_array((values, places), (q.size, q.size))
    for columns, h, _ in added_inertia(system, q[None], np.zeros((1, q.size))):
        i, j = np.meshgrid(columns, columns, indexing="ij")
        M += csr_array(((h.T @ h).ravel(), (i.ravel(), j.ravel())), M.shape)
    return M


# Redundant rows of Phi_q at one configuration of a large scene, by sparse factorisation in O(N).


@entry("pvdd")
def _choose(context, q, t, share):
    """Select redundant rows at q, those with pivots below a share; return their number, or -1."""
    c = load_parts(context)
    graph, f = c.graph, c.tangent
    set_time(c.system, t)
    place_bodies(graph.bodies, q, f.poses)
    return select_rows(graph, c.system, f, t, share)


def dependent_rows(packed, q, t, share):
    """Rows of Phi that are left less than a share of their diagonal entries of H W H^T by elimination, int64 (k,).

    None where no choice among them is independent. Normalisations are not included. See row_selection.py: of many
    rows the choice is made within blocks, and may have one too many or too few.
    """
    own, known = packed, packed.derived
    if known.redundant is None:
        if known.examined is None:
            known.examined = packed._replace(derived=Derived(redundant=np.zeros(0, np.int64)))
        own = known.examined
    graph = by_lengths(packed, graph_of(own, REDUCED))
    whole = parts(packed.system._replace(reals=packed.system.reals.copy()), graph, q.size)
    tangent = allocate_tangent(graph, q.size, redundant=True)
    context, *_keep = resident(whole._replace(tangent=tangent))
    count = _choose(context, q, t, share)
    return None if count < 0 else np.sort(graph.row[redundant_of(tangent)])
