"""The formulations of the equations of motion and the addresses of their kernels."""

from dataclasses import dataclass, replace
from types import ModuleType

from ..rows.interface import redundancy
from ..sparse.constraint_graph import BIAS, DRIFT, REDUCED
from ..sparse.constraint_graphs import graph_of, redundant_rows
from ..validation import unknown_name
from . import friction_basis, friction_solve, linearisation, maggi_kane, null_space, tangent
from .locked_orientations import moving_graph


@dataclass(frozen=True)
class Formulation:
    """A module of kernels: place, accelerate, complete, check, start_chart."""

    name: str
    kernels: ModuleType
    first_order: bool = False
    basis_free: bool = False

    def serving(self, method):
        """The form that a method runs a scene in: implicit methods need a basis."""
        if self.basis_free and method.implicit:
            return replace(self, kernels=null_space, basis_free=False)
        return self

    def graph(self, packed):
        """The scene's graph with the loops that the kernels call; that of the forms with a basis has every row."""
        if self.basis_free:
            graph = moving_graph(packed, *self.kernels.COLUMNS)
        else:  # redundant rows are judged by sparse rows at every level
            graph = graph_of(packed, REDUCED, *((BIAS, DRIFT) if len(redundant_rows(packed)) else ()))
        if graph.frictions.size and graph.rub[0] == 0:
            graph.rub[0] = (friction_solve if self.basis_free else friction_basis).rub.address
        return graph

    def sizes(self, n, m, graph):
        """Lengths of x and y of a graph, with n coordinates and m constraint rows."""
        if self.basis_free:
            return 8 * len(graph.bodies), 8 * len(graph.bodies)
        k = n - m + redundancy(graph)
        return n if self.first_order else k, k

    def addresses(self):
        """Addresses of the kernels that a driver calls, by their names in `Kernels`; loads or compiles them."""
        k = self.kernels
        complete = (k if self.basis_free else null_space).complete  # qdd = D vdd - U B gamma in the others
        kernels = {"place": k.place, "accelerate": k.accelerate, "complete": complete}
        kernels |= {"check": k.check, "start_chart": k.start_chart}
        return {name: kernel.address for name, kernel in kernels.items()}

    def implicit(self):
        """Addresses that implicit methods need, by their names in `StageKernels`."""
        names = ("linearise", "reduce", "factorise", "solve", "soften")
        kernels = {name: getattr(linearisation, name) for name in names}
        kernels |= {"complete": null_space.complete, "error_norm": self.kernels.error_norm}
        return {name: kernel.address for name, kernel in kernels.items()}


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
