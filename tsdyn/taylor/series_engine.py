"""The engine of runs by Taylor series; see runs/run.py."""

from ..errors import InvalidArgument
from ..runs.reader import Reading
from .dense_output import read_series, reading_workspace
from .layout import is_far, refusal, room
from .run_memory import Series, SeriesMemory
from .step_parts import accelerate_here, check_laws, expand_far_series, expand_series, pass_singular, reach
from .tolerances import MANY


class SeriesEngine:
    """A run by Taylor series, in the tangent form."""

    def __init__(self, task):
        if task.form.name != "tangent":
            raise InvalidArgument(
                "Taylor series are of the motion itself and need no other form than 'tangent'; formulation="
                f"{task.form.name!r} is served by 'dop853', 'rk45' and 'nystrom4'."
            )
        self.task, self.series, self.orders = task, task.prepared.series, task.method.orders()
        self.highest = self.orders[2]
        self.kind = "taylor", self.highest
        self.skipped = task.prepared.spheres, task.prepared.still, self.series.constant_columns

    def memory(self):
        """A new `SeriesMemory`."""
        return SeriesMemory(self.task.prepared, self.highest)

    def serves(self, memory):
        """Whether the memory is not that of the scene before it was changed."""
        return memory.series is self.series

    def enter(self, memory):
        """Clear the memory, and enter the orders of the method and the kernels."""
        task, method, graph = self.task, self.task.method, self.series.graph
        memory.clear(task, task.prepared.packed.system)
        order = memory.context.expansion.order
        order.top, order.lowest, order.highest = self.orders
        order.next = order.top
        order.refined = max(method.refined, int(len(graph.bodies) > MANY))
        if method.step is not None:  # the order follows from tolerances even so
            memory.run.clock.rtol, memory.run.clock.atol = method.step_tolerances()
        _set_kernels(memory.run, is_far(graph, self.highest), task.within)
        if memory.context.expansion.forces["check"].any():
            memory.context.trial.check = check_laws.address

    def reading(self, memory):
        """A `Reading` of the steps; a function and its arguments that make it in another process."""
        packed, graph = self.task.prepared.packed, self.series.graph
        return _reading(packed, graph, self.highest), (read_again, packed, self.highest)


def read_again(packed, highest):
    """A `Reading` in another process than the run's."""
    return _reading(packed, Series(packed, refusal(packed)).graph, highest)


def _reading(packed, graph, highest):
    def workspace():
        context, run = reading_workspace(system, graph, room(highest), packed.size)
        _set_kernels(run, is_far(graph, highest), True)
        return context, run

    system = packed.system
    return Reading(read_series, workspace, system, shift=0, degree=16)


def _set_kernels(run, far, within):
    """Addresses that the driver and readers call; within: whether anything is asked for between the steps."""
    kernels = run.kernels
    kernels.expand, kernels.reach = (expand_far_series if far else expand_series).address, reach.address
    if within:
        kernels.accelerate_here, kernels.pass_singular = accelerate_here.address, pass_singular.address
