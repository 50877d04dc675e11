"""Forces, one file each; a new file in this folder is found by itself."""

from .._discovery import export_all

__all__ = export_all(__name__, __path__, globals(), "Force")
__all__.append("registered")


def registered():
    """Return every force class known, built in or plugged in."""
    from ..elements.force import registered as known

    return tuple(known().values())


def __dir__():
    """What users use, for completion."""
    return sorted(__all__)
