"""Forces, one file each; a new file in this folder is registered automatically."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._discovery import export_all

if TYPE_CHECKING:
    from ..hints import Force

__all__ = export_all(__name__, __path__, globals(), "Force")
__all__.append("registered")


def registered() -> tuple[type[Force], ...]:
    """Return every force class known, built in or plugged in.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.forces.Spring in ts.forces.registered()
    True
    """
    from ..elements.force import registered as known

    return tuple(known().values())


def __dir__() -> list[str]:
    """What users use, for completion."""
    return sorted(__all__)
