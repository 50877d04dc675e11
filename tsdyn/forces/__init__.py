"""Forces, one file each; a new file in this folder is registered automatically."""

from ..calls import export_all, listing, refusing
from ..elements.force import registered as _known

__all__ = [*export_all(__name__, __path__, globals(), "Force"), "registered"]

registered = listing(_known, "Force", "ts.forces.Spring in ts.forces.registered()")
__getattr__ = refusing("ts.forces", __all__)


def __dir__() -> list[str]:
    """What users use, for completion."""
    return sorted(__all__)
