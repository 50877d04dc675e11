"""Constraints, one file each: primitives, and joints composed of them; a new file here is registered automatically."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._discovery import export_all

if TYPE_CHECKING:
    from ..hints import Joint, Primitive

__all__ = export_all(__name__, __path__, globals(), "Primitive", "Joint")
__all__ += ["registered", "registered_joints"]


def registered() -> tuple[type[Primitive], ...]:
    """Return every primitive class known, built in or plugged in.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.constraints.Distance in ts.constraints.registered()
    True
    """
    from ..elements.primitive import registered as known

    return tuple(known().values())


def registered_joints() -> tuple[type[Joint], ...]:
    """Return every joint class known, built in or plugged in.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.constraints.Revolute in ts.constraints.registered_joints()
    True
    """
    from ..elements.joint import registered as known

    return tuple(known().values())


def __dir__() -> list[str]:
    """What users use, for completion."""
    return sorted(__all__)
