"""What became of a file: what was left out, what was carried over in another way, and where its frames are."""

from __future__ import annotations

import html
import warnings
from typing import Any, NamedTuple

from ..calls import line_of_user
from ..errors import ImportLosses
from ..validation import counted

SHOWN = 8  # names of a group in a text
UNBOUNDED = 1e3  # rad or m: a range from which on limits say nothing on where a loop closes


class LeftOut(NamedTuple):
    """A thing that the scene lacks: what it is, its name in the file, and its numbers or the reason."""

    what: str
    where: str
    detail: str = ""


class FrameOn(NamedTuple):
    """A frame of the file on a body of the scene: in the frame of the body, which is at its centroid."""

    body: str
    position: Any  # (3,), m
    rotation: Any  # (3, 3), from this frame to that of the body


class ImportReport:
    """What a file of another program became.

    Attributes
    ----------
    source, format : str
        The file, and "URDF", "MJCF" or "SDF".
    left_out : tuple of (what, where, detail)
        What the scene lacks.
    notes : tuple of str
        What was carried over in another way.
    frames : dict
        Name of a link, site or frame of the file -> (body, position, rotation) in the scene; so links that were merged
        into another one are found again.
    limits : dict
        Name of a joint with limits in the file -> (lower, upper), rad or m; hints of `scene.assemble`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.Scene().imported is None
    True
    """

    def __init__(self, source: str, format: str) -> None:
        self.source, self.format = source, format
        self._left: dict[LeftOut, None] = {}  # once each, in order
        self._notes: dict[str, None] = {}
        self.frames: dict[str, FrameOn] = {}
        self.limits: dict[str, tuple[float, float]] = {}

    @property
    def left_out(self) -> tuple[LeftOut, ...]:
        """What the scene lacks."""
        return tuple(self._left)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was carried over in another way."""
        return tuple(self._notes)

    def leave(self, what: str, where: str, detail: str = "") -> None:
        """Note what is left out, once."""
        self._left[LeftOut(what, where, detail)] = None

    def leave_limits(self, joint: str, lower: float, upper: float, shown: str = "") -> None:
        """Note the limits of a joint, hints of an assembly."""
        if 0.0 < upper - lower < UNBOUNDED:
            self.limits[joint] = lower, upper
        self.leave("limits of a joint", joint, shown or f"[{lower:g}, {upper:g}]")

    def note(self, text: str) -> None:
        """Note what is carried over in another way, once."""
        self._notes[text] = None

    def leave_unread(self, root: Any, file: str = "") -> None:
        """Note what nobody has asked a root element for; `file` stands before the line of an included one."""
        for name, line in root.unread():
            self.leave(f"element {name}" if " " not in name else f"attribute {name}", f"{file}line {line}")

    def groups(self) -> dict[str, list[LeftOut]]:
        """What is left out, by what it is."""
        found: dict[str, list[LeftOut]] = {}
        for entry in self._left:
            found.setdefault(entry.what, []).append(entry)
        return found

    def summary(self) -> str:
        """What is left out in one line; empty if nothing is."""
        parts = [f"{len(entries)} x {what}" for what, entries in self.groups().items()]
        return "; ".join(parts)

    def warn(self, open_by: float = 0.0) -> None:
        """Warn where something is left out, or loops stay open, by the largest residual."""
        said = [f"not carried over: {self.summary()}"] if self._left else []
        said += [f"its loops are open by up to {open_by:.2g}, and can't be closed"] if open_by else []
        if said:
            warnings.warn(
                ImportLosses(f"{self.source}: {'; '.join(said)}. print(scene.imported) tells all."),
                stacklevel=line_of_user(),
            )

    def __str__(self) -> str:
        lines = [f"{self.source} ({self.format})"]
        if not self._left:
            lines.append("everything is carried over")
        else:
            lines.append(f"not carried over: {counted(len(self._left), 'entry', 'entries')}")
        for what, entries in self.groups().items():
            lines.append(f"  {what} ({len(entries)}): {_listed(entries)}")
        return "\n".join([*lines, *(f"  note: {text}" for text in self._notes)])

    def __repr__(self) -> str:
        return f"<ImportReport of {self.source}: {self.summary() or 'everything is carried over'}>"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"


def _listed(entries):
    parts = [f"{entry.where} {entry.detail}".strip() for entry in entries[:SHOWN]]
    more = f", and {len(entries) - SHOWN} more" if len(entries) > SHOWN else ""
    return ", ".join(parts) + more
