"""Constraint primitives, one file each; a new file in this folder is found by itself."""

from .._discovery import export_all

__all__ = export_all(__name__, __path__, globals(), "Primitive")
__all__.append("registered")


def registered():
    """Return every primitive class known, built in or plugged in."""
    from ..primitive import registered as known

    return tuple(known().values())
