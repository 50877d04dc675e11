"""Readers of dense output: states between the steps of a run, in a workspace of the reader's own."""

from typing import NamedTuple

import numpy as np

from ..errors import Status
from ..jit.kernels import resident
from .interrupted import call
from .tolerances import LONG_STEPS


class Reading(NamedTuple):
    """How the steps of a run are read: what a `Reader` is made of, in the process of the run."""

    read: object  # the kernel; arguments as of dense_output.read
    workspace: object  # a function without arguments: (context, run), the reader's own
    system: object  # the `System` as it was run
    shift: int  # from a step to the block that ends with the angles at its start
    degree: int  # power of two, of a polynomial that can be expected to follow a function of the states in a step


class Reader:
    """Reads states between steps; one thread at a time."""

    def __init__(self, reading):
        context, run = reading.workspace()
        self._read, self.degree, self.n = reading.read, reading.degree, run.now.shape[1]
        (self._context, *kept), (self._run, *more) = resident(context), resident(run)
        self._kept, self._kernels = (kept, more), run.kernels

    def __call__(self, t, rows, blocks, charts, points):
        """States (k, 3, n) at times t (k,), in the steps blocks[rows]; and the Status."""
        out = np.zeros((t.size, 3, self.n))
        arguments = self._context, self._run, t, rows, blocks, charts, points, out
        long = self.n >= LONG_STEPS
        return out, Status(call(self._read, arguments, (self._kernels,)) if long else self._read(*arguments))
