"""The formulations of the equations of motion and the addresses of their kernels."""

from dataclasses import dataclass, replace
from types import ModuleType

from ..rows.constraint_graph import BIAS, DRIFT, REDUCED
from ..rows.graph_builder import graph_of, redundant_rows
from ..rows.interface import redundancy
from ..validation import unknown_name
from . import accelerations, implicit_tangent, linearisation, maggi_kane, null_space, tangent
from .locked_orientations import moving_graph


@dataclass(frozen=True)
class Formulation:
    """A module of kernels: place, accelerate, complete, check, start_chart; for some stage_place, stage_accelerate."""

    name: str
    kernels: ModuleType
    first_order: bool = False
    basis_free: bool = False

    def serving(self, method):
        """The form that a method runs a scene in."""
        return replace(self, kernels=implicit_tangent) if self.basis_free and method.implicit else self

    @property
    def keeps_still(self):
        """Whether rotations of bodies with locked orientation are left out."""
        return self.basis_free and self.kernels is not implicit_tangent

    def graph(self, packed):
        """The scene's graph with the loops that the kernels call; all but explicit basis-free forms have every row."""
        if self.basis_free:
            graph = (moving_graph if self.keeps_still else graph_of)(packed, *self.kernels.COLUMNS)
        else:  # redundant rows are judged by sparse rows at every level
            graph = graph_of(packed, REDUCED, *((BIAS, DRIFT) if len(redundant_rows(packed)) else ()))
        if graph.frictions.size and graph.friction_solver[0] == 0:
            graph.friction_solver[0] = (accelerations if self.basis_free else null_space).solve_friction.address
        return graph

    def sizes(self, n, m, graph):
        """Lengths of x and y of a graph, with n coordinates and m constraint rows."""
        if self.basis_free:
            return 8 * len(graph.bodies), 8 * len(graph.bodies)
        k = n - m + redundancy(graph)
        return n if self.first_order else k, k

    @property
    def frees_stages(self):
        """Whether stages of explicit methods may stay where their sums put them, off the manifold."""
        return hasattr(self.kernels, "stage_place")

    def stage_kernels(self, free):
        """The kernels place and accelerate of an explicit method's stages."""
        k = self.kernels
        return (k.stage_place, k.stage_accelerate) if free else (k.place, k.accelerate)

    def addresses(self):
        """Addresses of the kernels that a driver calls, by their names in `RunKernels`; loads or compiles them."""
        k = self.kernels
        complete = (k if self.basis_free else null_space).complete  # qdd = D vdd - U B gamma in the others
        kernels = {"place": k.place, "accelerate": k.accelerate, "complete": complete}
        kernels |= {"check": k.check, "start_chart": k.start_chart}
        return {name: kernel.address for name, kernel in kernels.items()}

    def implicit(self, coupled=False):
        """Addresses that implicit methods need, by their names in `StageKernels`."""
        return {kernel_name: kernel.address for kernel_name, kernel in self.stages(coupled).items()}

    def stages(self, coupled=False):
        """The kernels that implicit methods need, by their names in `StageKernels`; coupled: all stages at once."""
        module = self.kernels if self.basis_free else linearisation
        if coupled:
            own = {name: getattr(implicit_tangent, name) for name in implicit_tangent.KERNELS}
            shared = ("linearise", "reduce", "soften", "recall", "residual", "distance")
            return own | {name: getattr(module, name) for name in shared} | {"error_norm": self.kernels.error_norm}
        names = ("linearise", "reduce", "factorise", "solve", "soften", "recall")
        names += ("residual", "correct", "distance") if self.basis_free else ()
        return {name: getattr(module, name) for name in names} | {"error_norm": self.kernels.error_norm}


FORMULATIONS = {
    f.name: f
    for f in (
        Formulation("tangent", tangent, basis_free=True),
        Formulation("null-space", null_space),
        Formulation("maggi-kane", maggi_kane, first_order=True),
    )
}


def formulation(name):
    """Return the formulation of this name."""
    if not isinstance(name, str) or name not in FORMULATIONS:
        raise unknown_name("formulation", name, FORMULATIONS)
    return FORMULATIONS[name]
