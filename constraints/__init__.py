"""Constraints, one file each: primitives and the joints made of them; a new file in this folder is found by itself."""

from .._discovery import export_all

__all__ = export_all(__name__, __path__, globals(), "Primitive", "Joint")
__all__ += ["registered", "registered_joints"]


def registered():
    """Return every primitive class known, built in or plugged in."""
    from ..elements.primitive import registered as known

    return tuple(known().values())


def registered_joints():
    """Return every joint class known, built in or plugged in."""
    from ..elements.joint import registered as known

    return tuple(known().values())


def __dir__():
    """What users use, for completion."""
    return sorted(__all__)
