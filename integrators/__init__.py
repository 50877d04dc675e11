"""Integrators, one file each; a new file in this folder is registered automatically."""

from ..calls import export_all, listing, refusing
from ..methods.integrator import registered as _known

__all__ = [*export_all(__name__, __path__, globals(), "Integrator"), "registered"]

registered = listing(_known, "Integrator", "ts.integrators.Taylor in ts.integrators.registered()")
__getattr__ = refusing("ts.integrators", __all__)


def __dir__() -> list[str]:
    """What users use, for completion."""
    return sorted(__all__)
