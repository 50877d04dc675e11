"""Series of a motion by the compiled program."""

import numpy as np

from tsdyn.jit.kernels import entry
from tsdyn.motions.program import call_smooth, run_program

ORDER = 20


@entry
def _series(address, program, time, out):
    call_smooth(address, program, time, out.size, out)


def series(motion, time, count=ORDER):
    """The coefficients about a time, by the compiled program."""
    out = np.zeros(count)
    _series(run_program.address, np.array(motion.program()), time, out)
    return out
