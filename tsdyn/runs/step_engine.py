"""The engine of methods with a step kernel, and its run workspace; see driver.py."""

import numpy as np

from ..formulations.registry import formulation
from ..formulations.tolerances import LOADS_LEFT, TURN_FREE, TURN_LIMIT
from ..maths.tolerances import LAST_PLACE
from ..methods.diagonally_implicit import prepare_implicit
from ..methods.explicit import called_for
from ..methods.interpolants import cubic_rate
from ..model.handles import has_rates
from ..model.laws import calls_laws
from ..model.packed import System
from ..rows.interface import redundancy
from ..rows.saddle_matrix import saddle_of
from ..workspaces import B_DATA, MIXED, Context, allocate, allocate_linear, basis_free_parts, divided, lay_out, words
from .dense_output import TrajectoryReading, read, warm_size
from .run_memory import Memory
from .step_control import watch
from .stepper import advance

# Run workspace of the step driver.

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
    form : Formulation
    implicit : bool
    sizes : tuple
        Of x and y.
    lengths : dict
        Floats of the method's tableau, memory and block, for `lay_out`.
    """

    driver = advance

    def __init__(self, prepared, graph, saddle, coupled, form, implicit, sizes, lengths):
        n, m, packed = prepared.n, prepared.m, prepared.packed
        self.implicit, self.basis_free = implicit, (basis_free := form.basis_free)
        self.source, kept = prepared.system(implicit, basis_free)
        system, redundant = System(*(array.copy() for array in self.source)), redundancy(graph)
        rows = len(graph.row) if basis_free else None
        unheld, inertias = form.redundancy(packed, graph), len(packed.inertias)
        work = allocate(n, m, len(packed.bodies), 0.0, joint_rows=rows, redundant=unheld, inertias=inertias)
        angles, slots = prepared.handles.count, system.memory.size
        parts = basis_free_parts(graph, n, not basis_free, saddle, coupled)
        run = lay_out(n, *sizes, angles, slots, warm=warm_size(work, *parts[1:]), **lengths)
        linear = allocate_linear(system, n, m, implicit and not basis_free, kept, redundant)
        if implicit:
            linear = linear._replace(now=run.now, before=run.before)
        context = form.context(packed, Context(system, work, linear, *parts), redundant)
        super().__init__(prepared, graph, context, run)
        self.weight = n if basis_free else n + n**3 // MATRICES
        self._laid_out.append(words(context.chart.state))
        head, rest = divided(linear.K.base, linear.kernels, linear.numbers)
        self._laid_out.append(head)
        self._scratch += [self._run_scratch, *((rest, linear.pivots) if implicit else ())]
        if saddle is not None:
            self._scratch.append(context.saddle.K.base)
        if form.mixed:
            self._scratch += [context.rates.D.base, context.mixed.P.base]
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


NOTHING = np.empty((2, 0), np.int64)


class StepEngine:
    """A run by a method with a step kernel, in a formulation."""

    layouts, readings = 0, (None, (None, None))

    def __init__(self, prepared, method, form, within):
        n, packed = prepared.n, prepared.packed
        self.method, self.form, self.within = method, (form := form.serving(method, has_rates(packed))), within
        self.graph = form.graph(packed)
        self.sizes = form.sizes(packed, self.graph)
        self.step, self.tableau, scratch = method.kernel(form.first_order)
        self.interpolant = method.interpolant(form.first_order)
        self.watched, self.loaded = prepared.watched if method.step is None else NOTHING
        path = 9 * int(packed.system.bodies[self.loaded, 1].sum()) + 3 * n if self.watched.size else 0
        normal = prepared.m if form.has_normals else 0
        lengths = self.tableau.size, scratch(*self.sizes), self.interpolant.size(n, *self.sizes), normal, path
        lengths += self.watched.size, self.loaded.size
        names = "tableau", "memory", "block", "normal", "path", "watched", "loaded"
        self.lengths = dict(zip(names, lengths, strict=True))
        self.slips = prepared.slips
        self.system, kept = prepared.system(method.implicit, form.basis_free)
        self.saddle = saddle_of(packed, self.graph, self.system) if method.implicit and form.basis_free else None
        rows = len(self.graph.row) if form.basis_free else None
        self.kind = form.name, form.mixed, rows, method.implicit, method.coupled, kept, *self.sizes, *lengths
        still = prepared.still if form.keeps_still else 0
        self.skipped = (prepared.spheres, still, 0) if form.basis_free else (0, 0, 0)

    def memory(self, prepared):
        """A new `StepMemory`."""
        given = self.method.coupled, self.form, self.method.implicit, self.sizes, self.lengths
        return StepMemory(prepared, self.graph, self.saddle, *given)

    def serves(self, memory):
        """Whether the memory is not that of the scene before it was changed."""
        return memory.graph is self.graph

    def lay_out(self, memory, interval):
        """Enter the system, and the numbers and kernels of the method; interval: of forced charts, 0 for none."""
        method, form, run, nx = self.method, self.form, memory.run, self.sizes[0]
        memory.take_system(self.system)
        run.tableau[:] = self.tableau
        run.watched[:], run.loaded[:] = self.watched, self.loaded
        if self.watched.size:
            run.kernels.watch = watch.address
        given = method, form, self.step, self.interpolant
        _set(run.kernels, kernels_of(*given, adaptive=method.step is None, within=self.within))
        run.numbers.normal_at = normal_at(form, self.interpolant, run.now.shape[1], self.sizes) if self.within else 0
        run.numbers.free_stages = free = form.frees_stages and interval == 0
        # Rates of chart coordinates keep what a step leaves of them along rows on velocities, and positions follow it:
        # where it isn't taken off, a chart lasts for one step
        drifts = form.basis_free and not free and self.graph.rates.size > 0
        run.numbers.chart_interval = interval or int(drifts)
        memory.context.chart.state.turn_limit = TURN_FREE if free else TURN_LIMIT
        share = LOADS_LEFT * method.step_tolerances()[0] if method.step is None else 0.0
        memory.context.chart.state.loads_left = max(share, LAST_PLACE)
        place, accelerate, norm = form.stage_kernels(free)
        run.kernels.stage_place, run.kernels.stage_accelerate = place.address, accelerate.address
        run.numbers.first_order = MIXED if form.mixed else form.first_order
        if method.step is None:
            run.kernels.error_norm = norm.address
            run.clock.turn_share = run.clock.error_before = 1.0
            run.clock.exponent = 1.0 / (method.embedded_order + 1)
            if method.stability_limit and (form.mixed or not form.first_order):
                run.clock.stability_limit = method.stability_limit
                run.numbers.last_stage = len(method.tableau.c) * sum(self.sizes)
        if method.implicit:
            addresses = form.implicit(method.coupled > 0)
            prepare_implicit(memory.context.linear, method, addresses, form.basis_free, self.slips)
            run.numbers.stage_at = len(method.tableau.c) * sum(self.sizes) + nx

    def reading(self, memory, prepared, constraint_tol):
        """A `Reading` of the steps; a function and its arguments that make it in another process."""
        given, again = (self.form, self.interpolant, constraint_tol), (self.method, self.form.name, constraint_tol)
        reading = _reading(prepared.packed, *given, memory.run.kernels.as_dict())
        return reading, (read_again, prepared.packed, *again)


def read_again(packed, method, name, constraint_tol):
    """A `Reading` in another process than the run's."""
    form = formulation(name).serving(method, has_rates(packed))
    step, interpolant = method.kernel(form.first_order)[0], method.interpolant(form.first_order)
    kernels = kernels_of(method, form, step, interpolant, adaptive=False, within=True)
    return _reading(packed, form, interpolant, constraint_tol, kernels)


def normal_at(form, interpolant, n, sizes):
    """Where in a block u and ud of both ends begin; 0 for a form without them."""
    return B_DATA + interpolant.size(n, *sizes) if form.has_normals else 0


def _reading(packed, form, interpolant, constraint_tol, kernels):
    n, m, system = int(packed.system.bodies[:, 1].sum()), len(packed.system.segments), packed.system
    graph = form.graph(packed)
    sizes = form.sizes(packed, graph)
    rows, unheld = len(graph.row) if form.basis_free else None, form.redundancy(packed, graph)

    def workspace():
        own = system._replace(reals=system.reals.copy())  # the motions' places are written to
        work = allocate(n, m, len(packed.bodies), constraint_tol, packed.size, rows, unheld, len(packed.inertias))
        parts = basis_free_parts(graph, n, not form.basis_free)
        run = lay_out(n, *sizes, 0, 0, warm=warm_size(work, *parts[1:]))
        _set(run.kernels, kernels)
        run.numbers.normal_at = normal_at(form, interpolant, n, sizes)
        context = Context(own, work, allocate_linear(own, n, m, False), *parts)
        return form.context(packed, context, redundancy(graph)), run

    return TrajectoryReading(read, workspace, system, shift=1, degree=8, calls_laws=calls_laws(packed))


def second_derivative(method, form):
    """The kernel of accelerations between the ends of steps; None where they follow from the equations."""
    if not method.implicit:
        return None
    return cubic_rate if form.first_order else method.second


def kernels_of(method, form, step, interpolant, adaptive, within):
    """Addresses that the driver and the reader call, by their names in `RunKernels`.

    within: whether anything is asked for between the ends of steps.
    """
    called, plug_in = called_for(step)
    kernels = {"step": called, "plug_in": plug_in}
    if adaptive:
        kernels |= dict(zip(("error", "second_error"), method.errors, strict=False))
    if within:
        kernels |= {"fill": interpolant.fill, "value": interpolant.value}
        kernels["normal"] = form.kernels.normal if form.has_normals else None
        kernels["second"] = second_derivative(method, form)
    return form.addresses() | {name: kernel.address for name, kernel in kernels.items() if kernel is not None}


def _set(record, numbers):
    for name, number in numbers.items():
        setattr(record, name, number)
