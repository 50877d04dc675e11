"""Mass and inertia of shapes, and shapes to draw: scene.add_body(**ts.shapes.box((1, 2, 3), density=7850)).

`box`, `sphere`, `cylinder`, `rod` and `from_mesh` have mass and inertia; +, moved and rotated make one body of several.
`Box`, `Sphere`, `Cylinder` and `Mesh` are geometry alone, for the viewer. Imports `maths`. Begin with `solids`.
"""

from .geometry import Box, Cylinder, Mesh, Sphere
from .solids import Shape, box, cylinder, from_mesh, rod, sphere

__all__ = ["Box", "Cylinder", "Mesh", "Shape", "Sphere", "box", "cylinder", "from_mesh", "rod", "sphere"]


def __dir__():
    """What users use, for completion."""
    return sorted(__all__)
