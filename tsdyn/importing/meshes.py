"""Files of meshes that a description names, and shapes that are read when they are drawn."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import unquote

import numpy as np

from .. import shapes
from .frames import HERE, Frame
from .xml_file import OUTSIDE, exists

if TYPE_CHECKING:
    from .report import ImportReport
    from .xml_file import OutsideFiles

FORMATS = (".stl", ".obj")  # that `shapes.Mesh` reads
FOLDERS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "GZ_SIM_RESOURCE_PATH", "GAZEBO_MODEL_PATH")


class DrawnShape(NamedTuple):
    """A shape to draw, in the frame of its link."""

    kind: str  # Box, Sphere, Cylinder or Mesh
    arguments: tuple
    frame: Frame = HERE
    colour: str = ""

    def within(self, outer: Frame) -> DrawnShape:
        """The shape in the frame in which `outer` is given."""
        return self._replace(frame=outer @ self.frame)

    def make(self) -> Any:
        """The `shapes` object; the file of a mesh is read."""
        placed = {"position": self.frame.p, "rotation": self.frame.R, "colour": self.colour}
        if self.kind != "Mesh":
            return getattr(shapes, self.kind)(*self.arguments, **placed)
        source, scale = self.arguments
        if np.ndim(scale) == 0:
            return shapes.Mesh(source, scale=float(scale), **placed)
        mesh = shapes.Mesh(source)
        faces = mesh.faces if np.prod(scale) > 0.0 else mesh.faces[:, ::-1]  # a mirrored one
        return shapes.Mesh((mesh.vertices * scale, faces), **placed)


def mesh(uri: str, scale: Any, outside: OutsideFiles, report: ImportReport, where: str) -> tuple[str, tuple] | None:
    """Kind and arguments of the mesh of a URI; None, with an entry in the report, where it can't be drawn."""
    there = find(uri, outside.folder)
    path = next((path for path in there if not outside.reason(path)), None)
    if path is None:
        report.leave(f"mesh that {OUTSIDE}" if there else "mesh that is not found", where, uri)
        return None
    if path.suffix.lower() not in FORMATS:
        report.leave("mesh of another format than STL and OBJ", where, uri)
        return None
    scale = np.asarray(scale, float)
    if not scale.all():
        report.leave("mesh of scale zero", where, uri)
        return None
    return "Mesh", (str(path), float(scale[0]) if (scale == scale[0]).all() and scale[0] > 0.0 else scale)


def find(uri: str, folder: Path) -> list[Path]:
    """Files that a URI may mean, best first: package:// and model:// are looked for above the folder of the file."""
    scheme, mark, rest = unquote(uri.strip()).partition("://")
    if not mark:
        tried = [folder / scheme]
    elif scheme == "file":
        tried = [Path(rest), folder / rest]
    elif scheme in ("package", "model"):
        tried = _in_packages(rest, folder)
    else:
        return []
    return [path for path in tried if exists(path)]


def _in_packages(rest, folder):
    """Where package/path may be: above the folder, in a package that it is in, or in a folder of the environment."""
    package, _, inner = rest.partition("/")
    above = [folder.resolve(), *folder.resolve().parents]
    roots = [Path(root) for name in FOLDERS for root in re.split(os.pathsep, os.environ.get(name, "")) if root]
    for root in (*above, *roots):
        yield root / rest
        yield root / "share" / rest
        if root.name == package:
            yield root / inner
    for root in above[:4]:  # a package that was copied under another name
        yield root / inner


def hexadecimal(rgba: Any) -> str:
    """Colour of red, green and blue from 0 to 1."""
    return "#" + "".join(f"{round(255 * min(max(x, 0.0), 1.0)):02x}" for x in rgba[:3])
