"""The formulations of the equations of motion and the addresses of their kernels."""

from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from ..model.handles import of_rates
from ..rows.constraint_graph import BIAS, DRIFT, REDUCED, graph_of, redundant_rows
from ..rows.interface import redundancy
from ..validation import unknown_name
from . import (
    accelerations,
    collocation_stages,
    implicit_tangent,
    linearisation,
    maggi_kane,
    null_space,
    null_space_rates,
    tangent,
)
from .locked_orientations import moving_graph


@dataclass(frozen=True)
class Formulation:
    """A module of kernels: place, accelerate, complete, check, start_chart, error_norm.

    Some have others for steps whose stages aren't placed: stage_place, stage_accelerate, stage_error_norm.
    """

    name: str
    kernels: ModuleType
    first_order: bool = False
    basis_free: bool = False

    def serving(self, method, rates=False):
        """The form that a method runs a scene in; rates: whether the scene has rows on velocities."""
        if self.basis_free and method.implicit:
            return replace(self, kernels=implicit_tangent)
        return replace(self, kernels=null_space_rates, first_order=True) if self.is_mixed(rates) else self

    def is_mixed(self, rates):
        """Whether velocities have fewer coordinates than positions, in a scene with rows on velocities."""
        return rates and not (self.basis_free or self.first_order)

    @property
    def mixed(self):
        """Whether the form has a `MixedContext`."""
        return self.kernels is null_space_rates

    def context(self, packed, context, redundant):
        """What the kernels get, made of a `Context`; redundant: how many rows are."""
        return null_space_rates.mixed_context(context, of_rates(packed), redundant) if self.mixed else context

    @property
    def friction_solver(self):
        """What solves for friction that depends on reactions."""
        return (accelerations if self.basis_free else self.kernels).solve_friction

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
        if graph.frictions.size:  # another one than that of a form which shares the graph
            graph = graph._replace(friction_solver=np.array([self.friction_solver.address]))
        return graph

    def sizes(self, packed, graph):
        """Lengths of x and y of a scene and its graph."""
        if self.basis_free:
            return 8 * len(graph.bodies), 8 * len(graph.bodies)
        n, m = int(packed.system.bodies[:, 1].sum()), len(packed.system.segments)
        k = n - m + redundancy(graph)
        return (n - m + self.redundancy(packed, graph) if self.mixed else n if self.first_order else k), k

    def redundancy(self, packed, graph):
        """Rows that positions don't obey: redundant ones and, in a mixed form, those on velocities."""
        if not self.mixed:
            return redundancy(graph)
        unheld = of_rates(packed)
        unheld[redundant_rows(packed)] = True
        return int(unheld.sum())

    @property
    def has_normals(self):
        """Whether positions have normal coordinates u that dense output starts from."""
        return hasattr(self.kernels, "normal")

    @property
    def frees_stages(self):
        """Whether stages of explicit methods may stay where their sums put them, off the manifold."""
        return hasattr(self.kernels, "stage_place")

    def stage_kernels(self, free):
        """The kernels place and accelerate of an explicit method's stages, and the error norm of its steps."""
        k = self.kernels
        if free:
            return k.stage_place, k.stage_accelerate, k.stage_error_norm
        return k.place, k.accelerate, k.error_norm

    def addresses(self):
        """Addresses of the kernels that a driver calls, by their names in `RunKernels`; loads or compiles them."""
        k = self.kernels
        kernels = {"place": k.place, "accelerate": k.accelerate, "complete": k.complete}
        kernels |= {"check": k.check, "start_chart": k.start_chart}
        return {name: kernel.address for name, kernel in kernels.items()}

    def implicit(self, coupled=False):
        """Addresses that implicit methods need, by their names in `StageKernels`."""
        return {kernel_name: kernel.address for kernel_name, kernel in self.stages(coupled).items()}

    def stages(self, coupled=False):
        """The kernels that implicit methods need, by their names in `StageKernels`; coupled: all stages at once."""
        module = self.kernels if self.basis_free or self.mixed else linearisation
        if coupled:
            own = {name: getattr(collocation_stages, name) for name in collocation_stages.KERNELS}
            shared = ("linearise", "reduce", "soften", "recall", "residual", "distance")
            return own | {name: getattr(module, name) for name in shared} | {"error_norm": self.kernels.error_norm}
        names = ("linearise", "reduce", "factorise", "soften", "recall")
        names += ("residual", "correct", "distance") if self.basis_free else ("solve",)
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
