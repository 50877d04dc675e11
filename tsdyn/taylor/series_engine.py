"""The engine of runs by Taylor series; see runs/run.py."""

from ..errors import InvalidArgument
from ..runs.reader import Reading
from .dense_output import read_series, reading_workspace
from .joint_friction import accelerate_with_friction_here, expand_friction_series
from .layout import is_far, refusal, room
from .run_memory import Series, SeriesMemory
from .step_parts import accelerate_here, expand_far_series, expand_series, pass_singular, reach


class SeriesEngine:
    """A run by Taylor series, in the tangent form."""

    layouts, readings = 0, (None, (None, None))

    def __init__(self, prepared, method, form, within):
        if form.name != "tangent":
            raise InvalidArgument(
                "Taylor series are of the motion itself and need no other form than 'tangent'; formulation="
                f"{form.name!r} is served by 'dop853', 'rk45' and 'nystrom4'."
            )
        self.method, self.form, self.within = method, form, within
        self.series, self.orders = prepared.series, method.orders()
        self.highest = self.orders[2]
        self.kind = "taylor", self.highest
        self.skipped = prepared.spheres, prepared.still, self.series.constant_columns

    def memory(self, prepared):
        """A new `SeriesMemory`."""
        return SeriesMemory(prepared, self.highest)

    def serves(self, memory):
        """Whether the memory is not that of the scene before it was changed."""
        return memory.series is self.series

    def lay_out(self, memory):
        """Enter the orders of the method and the kernels."""
        method, graph = self.method, self.series.graph
        order = memory.context.expansion.order
        order.room, (order.top, order.lowest, order.highest) = room(self.highest), self.orders
        order.next = order.top
        order.refined = max(method.refined, self.series.refined)
        if method.step is not None:  # the order follows from tolerances even so
            memory.run.clock.rtol, memory.run.clock.atol = method.step_tolerances()
        _set_kernels(memory.run, graph, self.highest, self.within)

    def reading(self, memory, prepared, constraint_tol):
        """A `Reading` of the steps; a function and its arguments that make it in another process."""
        packed, graph = prepared.packed, self.series.graph
        return _reading(packed, graph, self.highest), (read_again, packed, self.highest)


def read_again(packed, highest):
    """A `Reading` in another process than the run's."""
    return _reading(packed, Series(packed, refusal(packed)).graph, highest)


def _reading(packed, graph, highest):
    def workspace():
        context, run = reading_workspace(system, graph, room(highest), packed.size)
        _set_kernels(run, graph, highest, True)
        return context, run

    system = packed.system
    return Reading(read_series, workspace, system, shift=0, degree=16)


def expanding(rough, far):
    """What expands the series; rough: of a scene with joint friction, far: of many bodies."""
    return expand_friction_series if rough else expand_far_series if far else expand_series


def accelerating(rough):
    """What gives accelerations between the steps."""
    return accelerate_with_friction_here if rough else accelerate_here


def _set_kernels(run, graph, highest, within):
    """Addresses that the driver and readers call; within: whether anything is asked for between the steps."""
    kernels, rough = run.kernels, len(graph.frictions) > 0
    kernels.expand, kernels.reach = expanding(rough, is_far(graph, highest)).address, reach.address
    if within:
        kernels.accelerate_here, kernels.pass_singular = accelerating(rough).address, pass_singular.address
