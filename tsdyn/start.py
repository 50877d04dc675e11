"""Initial conditions of scenes of any size: as in initial.py, by the network instead of matrices, at a cost of O(N)."""

import numpy as np

from . import initial
from ._four import four, put
from ._kernel import entry, kernel
from .assembly import set_time
from .block_kernels import factor, solve
from .errors import RedundantConstraints, SingularConfiguration
from .evaluate import constraint_arrays
from .free import allocate_free
from .initial import ROUNDING, demand_finite, demand_small
from .landing import PIVOT_LIMIT, land, run_loops
from .network import BIAS, DRIFT, REDUCED, VALUES, is_regular, network_of
from .normal import gather, multiply_rows, scatter, weigh_rows
from .poses import OMEGA, POSE, RD, move_bodies, place_bodies, write_positions, write_velocities
from .rank import check_rank
from .workspace import FLOOR, allocate

LARGE = 1 << 22  # entries of Phi_q from which on no dense one is made
DEPENDENT = (
    "Phi_q has dependent rows.\nRemove the rows that say nothing new, or use a joint with fewer rows. Rows that are "
    "independent elsewhere make this a singular configuration: start from another one."
)


@entry
def _look(network, system, f, q, qd, t, velocity):
    """f.b = Phi and velocity = Phi_q qd + Phi_t of the network's rows, and H; the row that depends on others, or -1."""
    set_time(system, t)
    place_bodies(network.bodies, q, f.poses)
    move_bodies(network.bodies, q, qd, f.poses)
    run_loops(network, system.reals, REDUCED, f.poses, t, f.b, f.H)
    _rates(network, f)
    for e in range(f.gamma.size):
        f.gamma[e] = 0.0
    run_loops(network, system.reals, DRIFT, f.poses, t, f.gamma, f.H)
    gather(network, f.H, f.Z, velocity)
    for e in range(velocity.size):
        velocity[e] += f.gamma[e]
    weigh_rows(network, f.H, f.Y)
    multiply_rows(network, f.H, f.Y, f.S)
    return factor(network.pattern, f.S, PIVOT_LIMIT)


@entry
def _land(network, system, w, f, t):
    """Put w.q and w.qd onto the manifold. Status."""
    set_time(system, t)
    place_bodies(network.bodies, w.q, f.poses)
    move_bodies(network.bodies, w.q, w.qd, f.poses)
    status = land(network, system, w, f, t)
    if status != 0:
        return status
    write_positions(network.bodies, f.poses, w.q)
    for e in range(f.gamma.size):
        f.gamma[e] = 0.0
    run_loops(network, system.reals, DRIFT, f.poses, t, f.gamma, f.H)
    _rates(network, f)
    for _ in range(2):
        gather(network, f.H, f.Z, f.b)
        for e in range(f.b.size):
            f.b[e] += f.gamma[e]
        solve(network.pattern, f.S, f.b)
        scatter(network, f.Y, f.b, f.Z)
    for b in range(network.bodies.shape[0]):
        put(f.poses, b * POSE + RD, four(f.Z, 8 * b))
        put(f.poses, b * POSE + OMEGA, four(f.Z, 8 * b + 4))
    write_velocities(network.bodies, f.poses, w.qd)
    return 0


@kernel
def _rates(network, f):
    """Z = rd and omega' of the poses."""
    for b in range(network.bodies.shape[0]):
        put(f.Z, 8 * b, four(f.poses, b * POSE + RD))
        put(f.Z, 8 * b + 4, four(f.poses, b * POSE + OMEGA))


def consistent(scene, system, q, qd, t, tol):
    """Check positions and velocities against the constraints, then remove what rounding is left. Returns (q, qd).

    As `initial.consistent`, which serves bodies without inertia and names what depends on what; positions and
    velocities change by the least in the metric of kinetic energy.
    """
    packed = scene.packed
    if not is_regular(packed):
        return initial.consistent(scene, system, q, qd, t, tol)
    network = network_of(packed, REDUCED, VALUES, BIAS, DRIFT)
    system = system._replace(reals=system.reals.copy())
    n, m = q.size, len(system.segments)
    free, rates = allocate_free(network, n), np.zeros(len(network.row))
    at = network.bodies[network.bodies[:, 1] == 7, 0][:, None] + np.arange(3, 7)
    rows, real = network.normals[network.normals >= 0], network.row >= 0

    def look():
        """Phi, Phi_q qd + Phi_t, and the row of H that depends on those before it."""
        dependent = _look(network, system, free, q, qd, t, rates)
        Phi, velocity = np.zeros(m), np.zeros(m)
        Phi[network.row[real]], velocity[network.row[real]] = free.b[real], rates[real]
        p, pd = q[at], qd[at]
        Phi[rows], velocity[rows] = 0.5 * ((p * p).sum(axis=1) - 1.0), (p * pd).sum(axis=1)
        return Phi, velocity, dependent

    Phi, velocity, dependent = look()
    H = np.ones((m, 1))
    H[network.row[real], 0] = free.H.reshape(-1, 16)[real].sum(axis=1)
    demand_finite(scene, Phi, H, velocity)
    demand_small(scene, Phi, tol * (1.0 + np.abs(q).max()), "position", "Phi")
    if dependent >= 0:
        _refuse(scene, network, q, qd, t, free, dependent)
    demand_small(scene, velocity, tol * (1.0 + np.abs(qd).max()), "velocity", "Phi_q qd + Phi_t")
    far = np.abs(Phi).max(initial=0.0) > ROUNDING * (1.0 + np.abs(q).max())
    if far:
        q = q.copy()
        q[at] /= np.linalg.norm(q[at], axis=1)[:, None]
    fast = np.abs(velocity).max(initial=0.0) > ROUNDING * (1.0 + np.abs(qd).max())
    if far or fast:
        work = allocate(n, m, len(network.bodies), tol, packed.size, len(network.row))
        work.q[:], work.qd[:] = q, qd
        work.control[FLOOR] = ROUNDING * (packed.size + np.abs(q).max())
        if _land(network, system, work, free, t) == 0:
            q, qd = work.q.copy(), work.qd.copy()
    return q, qd


def _refuse(scene, network, q, qd, t, free, dependent):
    """Say which rows are dependent; return where a closer look finds none."""
    if q.size * len(scene.system.segments) < LARGE:
        check_rank(scene, constraint_arrays(scene.system, q, qd, t)[1])
        return
    if network.row[dependent] < 0:
        hub = scene.bodies[dict(network.welds.tolist())[dependent]].name
        raise RedundantConstraints(f"the constraints at {hub} depend on one another: {DEPENDENT}")
    name = scene.row_names()[network.row[dependent]]
    if not free.H[16 * dependent : 16 * dependent + 16].any():
        raise SingularConfiguration(
            f"the row of {name} in Phi_q is zero in this configuration: the constraint is singular here. "
            "Start from another configuration, or use a constraint that is regular here."
        )
    raise RedundantConstraints(f"{name} depends on other constraint rows: {DEPENDENT}")
