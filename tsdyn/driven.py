"""What a Taylor run of a scene with motions does besides: their series, and velocities that they ask for."""

from ._four import four, put
from ._kernel import kernel
from .block_kernels import solve
from .motion_program import call_smooth
from .network import DRIFT
from .normal import gather, scatter
from .poses import OMEGA, POSE, RD
from .rows import run_loops
from .series_state import ORDERS


@kernel
def expand_motions(system, x):
    """The series of all motions about the time that was set last, for the constraints that they drive."""
    for i in range(x.motions.shape[0]):
        program = system.reals[x.motions[i, 1] :]
        call_smooth(x.motions[i, 0], program, program[0], x.order[ORDERS], x.constraints[x.motions[i, 2] :])


@kernel
def land_driven_velocities(network, system, f, t):
    """As `landing.land_velocities` with H (rd, omega') + Phi_t = 0; H, Y and S are those of the poses, time is set."""
    nb = network.bodies.shape[0]
    for e in range(f.gamma.size):
        f.gamma[e] = 0.0
    run_loops(network, system.reals, DRIFT, f, t, f.gamma, f.H)
    for _ in range(2):
        for b in range(nb):
            put(f.Z, 8 * b, four(f.poses, b * POSE + RD))
            put(f.Z, 8 * b + 4, four(f.poses, b * POSE + OMEGA))
        gather(network, f.H, f.Z, f.b)
        for e in range(f.b.size):
            f.b[e] += f.gamma[e]
        solve(network.pattern, f.S, f.b)
        scatter(network, f.Y, f.b, f.Z)
        for b in range(nb):
            put(f.poses, b * POSE + RD, four(f.Z, 8 * b))
            put(f.poses, b * POSE + OMEGA, four(f.Z, 8 * b + 4))
