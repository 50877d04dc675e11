"""Taylor series of prescribed motions, for Taylor runs of driven scenes."""

from ..jit.kernels import kernel
from ..motions.program import call_smooth


@kernel
def expand_motions(system, x):
    """The series of all motions about the time that was set last, for the constraints that they drive."""
    for i in range(x.motions.shape[0]):
        program = system.reals[x.motions[i, 1] :]
        call_smooth(x.motions[i, 0], program, program[0], x.order.room, x.constraints[x.motions[i, 2] :])
