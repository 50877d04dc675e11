"""`Scene.imported` and `Scene.shapes`: what a file of another program leaves behind."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..hints import ImportReport


class OfFile:
    """Mixed into `Scene`.

    Attributes
    ----------
    imported : ImportReport or None
        What was left out of an imported file, and where its frames are.
    shapes : dict
        Name of a body, or "ground" -> list of shapes that `solution.view` draws for it; from an imported file.
    """

    imported: ImportReport | None = None

    @property
    def shapes(self) -> dict[str, list[Any]]:
        """Name of a body, or "ground" -> list of shapes, in the frame of the body; files of meshes are read now."""
        return {
            name: [shape.make().moved(-centroid) for shape in shapes]
            for name, (shapes, centroid) in vars(self).get("_drawn", {}).items()
        }
