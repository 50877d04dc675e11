"""Readers of dense output: states between the steps of a run, in a workspace of the reader's own."""

from dataclasses import dataclass, field

import numpy as np

from ..errors import Status
from ..jit.kernels import resident
from ..workspaces.carving import arrays_of
from .interrupted import call
from .tolerances import KEPT_FLOATS, LONG_STEPS


@dataclass(frozen=True, eq=False)
class Reading:
    """How the steps of runs are read: what a `Reader` is made of, in the process of the run."""

    read: object  # the kernel; arguments as of dense_output.read
    workspace: object  # a function without arguments: (context, run), the reader's own
    system: object  # the `System` as it was run
    shift: int  # from a step to the block that ends with the angles at its start
    degree: int  # power of two, of a polynomial that can be expected to follow a function of the states in a step
    idle: list = field(default_factory=list)  # a `Reader` that is not in use

    def reader(self):
        """A `Reader`, as if it were new."""
        try:
            found = self.idle.pop()
        except IndexError:
            return Reader(self)
        found.enter(self.system)
        return found

    def give(self, reader):
        """Take back one that is no longer in use, unless it is large."""
        if reader.is_small and not self.idle:
            self.idle.append(reader)


class Reader:
    """Reads states between steps; one thread at a time."""

    def __init__(self, reading):
        context, run = reading.workspace()
        self._read, self.degree, self.n = reading.read, reading.degree, run.now.shape[1]
        (self._context, *kept), (self._run, *more) = resident(context), resident(run)
        self._kept, self._kernels, self._reals = (kept, more), run.kernels, context.system.reals
        own = [part for name, part in context._asdict().items() if name not in ("system", "graph")]
        arrays = [array for array in arrays_of((*own, run)) if array.size]
        self.is_small = sum(array.size for array in arrays) < KEPT_FLOATS
        self._images = [(array, array.copy()) for array in arrays] if self.is_small else []

    def enter(self, system):
        """As if it were new, for the numbers of a system."""
        for array, image in self._images:
            array[...] = image
        self._reals[...] = system.reals

    def __call__(self, t, rows, blocks, charts, points):
        """States (k, 3, n) at times t (k,), in the steps blocks[rows]; and the Status."""
        out = np.zeros((t.size, 3, self.n))
        arguments = self._context, self._run, t, rows, blocks, charts, points, out
        long = self.n >= LONG_STEPS
        return out, Status(call(self._read, arguments, (self._kernels,)) if long else self._read(*arguments))
