"""`Scene.shapes`: what an imported file draws its bodies as."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..hints import Scene


@property
def drawn_shapes(scene: Scene) -> dict[str, list[Any]]:
    """Name of a body, or "ground" -> list of shapes, in the frame of the body; files of meshes are read now."""
    return {
        name: [shape.make().moved(-centroid) for shape in shapes]
        for name, (shapes, centroid) in vars(scene).get("_drawn", {}).items()
    }
