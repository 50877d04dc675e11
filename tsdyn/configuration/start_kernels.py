"""Kernels of initial conditions: residuals, projection, selection of independent rows, motion to a place near by."""

from ..elements.loops.body_poses import move_bodies, place_bodies, write_positions, write_velocities
from ..formulations.projection import factorise, find_drift, gather_speeds, land, land_velocities, move_by
from ..jit.kernels import entry, kernel
from ..model.equations import set_time
from ..rows.axis_rows import is_axis
from ..rows.evaluation import factor_rows, run_loops
from ..rows.independent_rows import drop_rows, select
from ..rows.schur_complement import gather, scatter
from ..sparse.constraint_graph import REDUCED
from ..sparse.factorisation import solve
from ..workspaces.workspace import SIZE, load_parts
from .tolerances import IMMOBILE, LEAST_SIZE


@entry("pvvdv")
def evaluate_start(context, q, qd, t, velocity):
    """f.b = Phi, velocity = Phi_q qd + Phi_t, H of the network's rows; the first row that depends on others, or -1."""
    c = load_parts(context)
    network, system, f = c.network, c.system, c.free
    set_time(system, t)
    place_bodies(network.bodies, q, f.poses)
    move_bodies(network.bodies, q, qd, f.poses)
    run_loops(network, system.reals, REDUCED, f, t, f.b, f.H)
    gather_speeds(network, f)
    find_drift(network, system, f, t)
    gather(network, f.H, f.Z, velocity)
    for e in range(velocity.size):
        velocity[e] += f.gamma[e]
    return factor_rows(network, f, f.H, f.Y, f.S, 0)


@entry("pd")
def land_start(context, t):
    """Project w.q and w.qd onto the constraint manifold. Status."""
    c = load_parts(context)
    network, system, w, f = c.network, c.system, c.work, c.free
    set_time(system, t)
    place_bodies(network.bodies, w.q, f.poses)
    move_bodies(network.bodies, w.q, w.qd, f.poses)
    status = land(network, system, w, f, t)
    if status != 0:
        return status
    write_positions(network.bodies, f.poses, w.q)
    find_drift(network, system, f, t)
    land_velocities(network, f, True)
    write_velocities(network.bodies, f.poses, w.qd)
    return 0


@entry("pd")
def choose_rows(context, share):
    """Select the rows to drop, those whose pivots are below a share of their diagonal entries; return their number."""
    c = load_parts(context)
    f = c.free
    select(c.network, f, f.H, f.Y, f.S, -1, share)
    drop_rows(f.dropped, f.H)
    return f.dropped[0] if factor_rows(c.network, f, f.H, f.Y, f.S, 0) < 0 else -1


@entry("pvd")
def free_axis(context, q, t):
    """Return the row of a massless axis about which the kept rows leave rotation free at q, or -1."""
    c = load_parts(context)
    network, f = c.network, c.free
    set_time(c.system, t)
    place_bodies(network.bodies, q, f.poses)
    run_loops(network, c.system.reals, REDUCED, f, t, f.b, f.H)
    failed = factor_rows(network, f, f.H, f.Y, f.S, 1)
    return failed if is_axis(network, f.S, failed) else -1


@entry("pdvd")
def go_near_by(context, t, way, far):
    """Move along the manifold, at most by `far` (rad, or share of the scene's size), and project. Status.

    way (bodies, 8) is any direction; its tangent part is taken.
    """
    c = load_parts(context)
    network, f = c.network, c.free
    status = factorise(network, c.system, c.work, f, t)
    if status != 0:
        return status
    for i in range(f.Z.size):
        f.Z[i] = way[i]
    wanted = _farthest(c)
    for _ in range(2):
        gather(network, f.H, f.Z, f.b)
        solve(network.pattern, f.S, f.b)
        scatter(network, f.Y, f.b, f.Z)
    found = _farthest(c)
    scale = far / found if found > IMMOBILE * wanted else 0.0
    for i in range(f.Z.size):
        f.Z[i] *= scale
    move_by(network, f)
    return land(network, c.system, c.work, f, t)


@kernel
def _farthest(c):
    """Return the largest entry of Z: rotations, and displacements as shares of the scene's size."""
    Z, part, found = c.free.Z, 1.0 / max(c.work.control[SIZE], LEAST_SIZE), 0.0
    for b in range(c.network.bodies.shape[0]):
        for i in range(3):
            found = max(found, max(abs(Z[8 * b + i]) * part, abs(Z[8 * b + 4 + i])))
    return found
