"""Integrators, one file each; a new file in this folder is registered automatically."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._discovery import export_all

if TYPE_CHECKING:
    from ..hints import Integrator

__all__ = export_all(__name__, __path__, globals(), "Integrator")
__all__.append("registered")


def registered() -> tuple[type[Integrator], ...]:
    """Return every integrator class known, built in or plugged in.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.integrators.Taylor in ts.integrators.registered()
    True
    """
    from ..methods.integrator import registered as known

    return tuple(known().values())


def __dir__() -> list[str]:
    """What users use, for completion."""
    return sorted(__all__)
