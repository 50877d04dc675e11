"""Constraints, one file each: primitives, and joints composed of them; a new file here is registered automatically."""

from ..calls import export_all, listing, refusing
from ..elements import joint as _joint
from ..elements import primitive as _primitive

__all__ = [*export_all(__name__, __path__, globals(), "Primitive", "Joint"), "registered", "registered_joints"]

registered = listing(_primitive.registered, "Primitive", "ts.constraints.Distance in ts.constraints.registered()")
registered_joints = listing(_joint.registered, "Joint", "ts.constraints.Revolute in ts.constraints.registered_joints()")
__getattr__ = refusing("ts.constraints", __all__)


def __dir__() -> list[str]:
    """What users use, for completion."""
    return sorted(__all__)
