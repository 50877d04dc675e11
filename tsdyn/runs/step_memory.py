"""Run workspace of the step driver."""

from ..model.packed import System
from ..rows.interface import redundancy
from ..workspaces.carving import divided, words
from ..workspaces.run_state import lay_out
from ..workspaces.workspace import Context, allocate, allocate_linear, basis_free_parts
from .dense_output import warm_size
from .run_memory import Memory
from .stepper import advance

MATRICES = 500  # matrices of n coordinates cost as much a step as O(N) kernels do with n^3 / MATRICES more of them


class StepMemory(Memory):
    """The memory of a run by a method with a step kernel.

    Parameters
    ----------
    prepared : Prepared
    graph : ConstraintGraph
        Of the scene, as the form needs it.
    saddle : SaddleGraph
        Of an implicit method in a form without a basis; None for others.
    coupled : int
        Stages that the method solves at once.
    basis_free, implicit : bool
    sizes : tuple
        Of x and y.
    lengths : dict
        Floats of the method's tableau, memory and block, for `lay_out`.
    """

    advance_kernel = staticmethod(advance)

    def __init__(self, prepared, graph, saddle, coupled, basis_free, implicit, sizes, lengths):
        n, m, packed = prepared.n, prepared.m, prepared.packed
        self.implicit, self.basis_free = implicit, basis_free
        self.source, kept = prepared.system(implicit)
        system, redundant = System(*(array.copy() for array in self.source)), redundancy(graph)
        rows = len(graph.row) if basis_free else None
        work = allocate(n, m, len(packed.bodies), 0.0, joint_rows=rows, redundant=redundant)
        angles, slots = prepared.handles.count, system.memory.size
        parts = basis_free_parts(graph, n, not basis_free, saddle, coupled)
        run = lay_out(n, *sizes, angles, slots, warm=warm_size(work, *parts[1:]), **lengths)
        linear = allocate_linear(system, n, m, implicit and not basis_free, kept, redundant)
        if implicit:
            linear = linear._replace(now=run.now, before=run.before)
        context = Context(system, work, linear, *parts)
        super().__init__(prepared, graph, context, run)
        self.weight = n if basis_free else n + n**3 // MATRICES
        self._laid_out.append(words(context.chart.state))
        head, rest = divided(linear.K.base, linear.kernels, linear.numbers)
        self._laid_out.append(head)
        self._scratch += [self._run_scratch, *((rest, linear.pivots) if implicit else ())]
        if saddle is not None:
            self._scratch.append(context.saddle.K.base)
        rest = *self._laid_out, context.tangent.rows.S, context.tangent.poses
        self.nbytes = sum(array.nbytes for array in (*self._scratch, *rest))

    @property
    def called(self):
        """As of `Memory`."""
        return self.run.kernels, self.context.linear.kernels

    def take_system(self, system):
        """Take the numbers of a system, which may be another one of the same shape."""
        self.reals = system.reals
        if self.source is not system:
            self.source = system
            for own, new in zip(self.context.system, system, strict=True):
                own[:] = new
