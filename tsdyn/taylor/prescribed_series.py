"""Taylor series of prescribed motions, for Taylor runs of driven scenes."""

from ..jit.kernels import kernel
from ..motions.program import call_smooth


@kernel
def expand_motions(system, x):
    """The series of all motions about the time that was set last, for the constraints that they drive."""
    for i in range(x.motions.shape[0]):
        motion = x.motions[i]
        program = system.reals[motion.program :]
        call_smooth(motion.run, program, program[0], x.order.room, x.constraints[motion.values :])
