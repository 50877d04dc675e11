"""Run workspace of the step driver."""

import numpy as np

from ..model.packed import System
from ..rows.interface import redundancy
from ..workspaces.run_state import lay_out
from ..workspaces.workspace import Context, allocate, allocate_linear, basis_free_parts
from .dense_output import warm_size
from .run_memory import Memory, words
from .stepper import advance

MATRICES = 500  # matrices of n coordinates cost as much a step as O(N) kernels do with n^3 / MATRICES more of them


class StepMemory(Memory):
    """The memory of a run by a method with a step kernel.

    Parameters
    ----------
    prepared : Prepared
    graph : ConstraintGraph
        Of the scene, as the form needs it.
    basis_free, implicit : bool
    sizes : tuple
        Of x and y.
    lengths : dict
        Floats of the method's tableau, memory and block, for `lay_out`.
    """

    advance_kernel = staticmethod(advance)

    def __init__(self, prepared, graph, basis_free, implicit, sizes, lengths):
        n, m, packed = prepared.n, prepared.m, prepared.packed
        self.implicit, self.basis_free = implicit, basis_free
        self.source, kept = prepared.system(implicit)
        system, redundant = System(*(array.copy() for array in self.source)), redundancy(graph)
        rows = len(graph.row) if basis_free else None
        work = allocate(n, m, len(packed.bodies), 0.0, joint_rows=rows, redundant=redundant)
        angles, slots = prepared.handles.count, system.memory.size
        parts = basis_free_parts(graph, n, not basis_free)
        run = lay_out(n, *sizes, angles, slots, warm=warm_size(work, parts[1].friction), **lengths)
        linear = allocate_linear(system, n, m, implicit, kept, redundant)
        written = [run.x.base, linear.K.base, linear.pivots]
        written += [np.frombuffer(record, np.int64) for record in (linear.numbers, linear.kernels)]
        if implicit:
            linear = linear._replace(now=run.now, before=run.before)
        context = Context(system, work, linear, *parts)
        super().__init__(prepared, graph, context, run)
        self.weight = n if basis_free else n + n**3 // MATRICES
        self._written += [*written, words(context.chart.state)]
        self.nbytes = sum(array.nbytes for array in (*self._written, context.tangent.rows.S, context.tangent.poses))

    def clear(self, task, system):
        """As of `Memory`; the system may be another one of the same shape."""
        if self.source is not system:
            self.source = system
            for own, new in zip(self.context.system, system, strict=True):
                own[:] = new
        super().clear(task, system)
