"""The formulations of the equations of motion, as the addresses of their kernels."""

from dataclasses import dataclass
from types import ModuleType

from . import linearise, maggi_kane, null_space
from .errors import InvalidArgument


@dataclass(frozen=True)
class Formulation:
    """A module of kernels: place, accelerate, complete, check, start_chart."""

    name: str
    kernels: ModuleType
    first_order: bool = False

    def addresses(self):
        """Addresses in the order that the driver expects; loads or compiles them."""
        complete = null_space.complete  # qdd = D vdd - U B gamma in every form
        k = self.kernels
        return [f.address for f in (k.place, k.accelerate, complete, k.check, k.start_chart)]

    def implicit(self):
        """Addresses that implicit methods need, in the order of implicit.LINEARISE ... ERROR_NORM."""
        kernels = (
            linearise.linearise,
            linearise.reduce,
            linearise.factorise,
            linearise.solve,
            linearise.soften,
            null_space.complete,
        )
        return [f.address for f in (*kernels, self.kernels.error_norm)]

    def norm(self):
        """Address of the error norm, for adaptive methods."""
        return self.kernels.error_norm.address


FORMULATIONS = {
    f.name: f
    for f in (
        Formulation("tangent", null_space),
        Formulation("null-space", null_space),
        Formulation("maggi-kane", maggi_kane, first_order=True),
    )
}


def formulation(name):
    """Return the formulation of this name."""
    if not isinstance(name, str) or name not in FORMULATIONS:
        raise InvalidArgument(f"unknown formulation {name!r}; there are {', '.join(map(repr, FORMULATIONS))}.")
    return FORMULATIONS[name]
