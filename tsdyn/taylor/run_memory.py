"""Run workspace of the Taylor driver, and what all Taylor runs of a scene share."""

from ..errors import InvalidArgument, Status
from ..formulations.locked_orientations import moving_parts
from ..model.packed import System
from ..rows.interface import allocate_tangent
from ..runs.run_memory import Memory
from ..sparse.constraint_graph import BIAS, DRIFT, REDUCED, VALUES
from ..sparse.constraint_graphs import with_loops
from ..sparse.length_metric import are_unequal
from ..workspaces.carving import words
from ..workspaces.run_state import lay_out
from ..workspaces.workspace import plain_work
from .layout import allocate_expansion, masks
from .step_parts import check_laws, pass_singular
from .stepper import advance_series
from .tolerances import MANY
from .workspace import SeriesContext, Trial

PASSAGE = Status.PASSAGE


class Series:
    """What the Taylor runs of a packed scene share: its graph, with the loops that they need.

    Parameters
    ----------
    packed : Packed
    found : str
        Its `layout.refusal`.

    Raises
    ------
    InvalidArgument
        If a part of the scene has no series, or an inertia has no inverse; names them.
    """

    def __init__(self, packed, found):
        if found:
            raise InvalidArgument(found)
        graph, self.kinds = moving_parts(packed)
        self.constant_columns = _masks_once(graph, packed)
        self.graph = with_loops(graph, self.kinds, REDUCED, VALUES, BIAS, DRIFT)
        self.refined = int(len(graph.bodies) > MANY or are_unequal(packed.system))


def _masks_once(graph, packed):
    """As `layout.masks`, which scenes of a family with the same parameters of constraints share."""
    shared = packed.derived.shared
    if shared is None:
        return masks(graph, packed)
    key = masks, graph.row.tobytes(), graph.bodies.tobytes()
    given, table, constant = shared.get(key, (None, None, 0))
    if given == packed.parameters:
        graph.table[...] = table
        return constant
    constant = masks(graph, packed)
    shared[key] = packed.parameters, graph.table.copy(), constant
    return constant


class SeriesMemory(Memory):
    """The memory of a run by series.

    Parameters
    ----------
    prepared : Prepared
    highest : int
        The highest order that there is room for.
    """

    advance_kernel = staticmethod(advance_series)

    def __init__(self, prepared, highest):
        self.series, packed, n = prepared.series, prepared.packed, prepared.n
        graph, system = self.series.graph, System(*(array.copy() for array in packed.system))
        expansion = allocate_expansion(graph, self.series.kinds, packed, highest)
        tangent, trial = allocate_tangent(graph, n), Trial()
        trial.left = 1.0
        if expansion.forces["check"].any():
            trial.check, trial.sharp = check_laws.address, int(expansion.forces["sharp"].any())
        block = 1 + n + expansion.bodies.size
        run = lay_out(n, 0, 0, prepared.handles.count, system.memory.size, block=block)
        context = SeriesContext(system, plain_work(n), graph, tangent, expansion, trial)
        super().__init__(prepared, graph, context, run)
        self.reals = packed.system.reals
        self._laid_out.append(words(expansion.order))
        self.nbytes = 8 * (expansion.bodies.size + expansion.constraints.size + tangent.rows.S.size + run.block.size)

    def advance(self, log, most):
        """As of `Memory`."""
        status = super().advance(log, most)
        if status is PASSAGE:  # the run ends next to a singular configuration
            self.run.kernels.pass_singular = pass_singular.address
            status = super().advance(log, most)
        return status
