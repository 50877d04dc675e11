"""What an MJCF file names and makes, judged before MuJoCo's compiler reads it; what is carried over, or listed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from .. import validation
from ..errors import StorageError
from ..validation import LONG
from .tolerances import CELLS, FOLDERS, OBJECTS, PARTS, TEXT
from .xml_file import LARGEST, Node, OutsideFiles, read

# Elements and attributes of MJCF that are carried over, or listed by name; all others are listed by their lines.

# what places and sizes things, and what the compiler alone reads
COMPILED = ("compiler", "default", "size", "include", "worldbody", "asset", "frame", "replicate", "attach", "model",
            "mesh", "inertial", "composite", "equality", "tendon", "actuator", "contact", "keyframe",
            "custom", "deformable", "pulley", "freejoint")  # fmt: skip
# listed by name, with all that they contain
LISTED = ("camera", "light", "texture", "skin", "pair", "exclude", "key", "numeric", "text", "tuple", "flexcomp",
          "flex", "plugin", "hfield", "sensor")  # fmt: skip
COMMON = "name class group "
PLACE = "pos quat axisangle xyaxes zaxis euler "
SPRING = "springdamper springref stiffness damping frictionloss armature limited range "
SOFT = "solref solimp "  # of equality constraints, which are held exactly: noted
CONTACT = ("type contype conaffinity condim priority friction solmix solref solimp margin gap mesh fitscale fromto "
           "size mass density shellinertia material rgba hfield ")  # fmt: skip
DRIVE = ("joint jointinparent gear ctrllimited ctrlrange forcelimited forcerange gaintype biastype gainprm biasprm kp "
         "kv dampratio inheritrange armature damping")  # fmt: skip
READ = {
    "mujoco": "model",
    "body": "name childclass mocap gravcomp " + PLACE,
    "joint": COMMON + SPRING + "type pos axis ref joint1 joint2 joint coef polycoef active " + SOFT,
    "geom": COMMON + PLACE + CONTACT + "geom sidesite",
    "site": COMMON + PLACE + "type fromto size material rgba site",
    "connect": "name class active body1 body2 anchor site1 site2 " + SOFT,
    "weld": "name class active body1 body2 anchor relpose site1 site2 torquescale " + SOFT,
    "option": "gravity density viscosity",
    "flag": "gravity equality spring damper actuation clampctrl contact limit frictionloss",
    "material": "name class rgba",
    "spatial": COMMON + SPRING + "springlength width material rgba",
    "fixed": COMMON + SPRING + "springlength",
    **dict.fromkeys(("general", "motor", "position", "velocity", "damper"), COMMON + DRIVE),
}
NUMERICS = ("timestep", "integrator", "solver", "iterations", "tolerance", "ls_iterations", "ls_tolerance", "jacobian",
            "noslip_iterations", "noslip_tolerance", "ccd_iterations", "ccd_tolerance", "sdf_iterations",
            "sdf_initpoints", "apirate", "cone", "impratio")  # fmt: skip


def leave_unread(sources, report):
    """List what nobody has read, and note settings of MuJoCo's integrator."""
    for root, path in sources.trees:
        _read(root, report)
        report.leave_unread(root, "" if path == sources.path else f"{path.name}, ")


def _read(root: Node, report):
    """Mark as read what the rest of the import reads, or lists."""
    known = (*COMPILED, *LISTED, *READ)
    for node in root.walk():
        if node.tag in LISTED:
            node.skip()
            continue
        node.all(*known)
        names = READ.get(node.tag, "").split() if node.tag not in COMPILED else node.element.keys()
        if node.tag == "option":
            given = [name for name in NUMERICS if node.get(name) is not None]
            if given:
                report.note(f"settings of MuJoCo's own solver, which tsdyn has no use for: {', '.join(given)}")
        for name in names:
            node.get(name)


# What an MJCF file names and makes, judged before MuJoCo's compiler reads it.
#
# objects of an element = (1 + characters / TEXT + objects of its children) x copies

NEEDED = ("mesh", "hfield", "flexcomp")  # elements whose files the compiler reads; textures and skins are dropped
ROOM = ("actdim", "nsample", "num")  # numbers that an object has room for
COUNTED = ("composite", "flexcomp")  # that make as many bodies as `count` says


class Sources:
    """The files of a model: itself, and what it includes and attaches.

    Parameters
    ----------
    path : Path
    outside : OutsideFiles

    Attributes
    ----------
    trees : list of (Node, Path)
        The root element of each.
    hidden : set of str
        Files of meshes that may not be read.
    """

    def __init__(self, path: Path, outside: OutsideFiles) -> None:
        self.path, self._outside = path, outside
        self.trees: list[tuple[Node, Path]] = []
        self.hidden: set[str] = set()
        self._objects: dict[Path, float | None] = {}  # of models by file, None while one is read

    def judge(self, root: Node) -> None:
        """Demand that a model makes a bounded number of objects, of files that may be read."""
        self._model(root, self.path)

    def _model(self, root, path):
        """The number of objects that a model makes."""
        self._objects[path.resolve()] = None
        included, attached, ahead = {}, [0.0], [(root, path)]
        seen, first = {path.resolve()}, len(self.trees)
        while ahead:
            tree, file = ahead.pop()
            self.trees.append((tree, file))
            for node in tree.walk():
                if node.tag == "include":
                    inner = self._inner(node, (path, file))
                    if inner.resolve() in seen:
                        self._refuse(node, f"{inner.name!r} is included twice")
                    seen.add(inner.resolve())
                    included[node] = read(inner)[0]
                    ahead.append((included[node], inner))
                elif node.tag == "model" and node.element.get("file"):
                    inner = self._inner(node, (path, file))
                    known = self._objects.get(inner.resolve(), 0.0)
                    if known is None:
                        self._refuse(node, f"the model {inner.name!r} contains itself")
                    attached.append(known or self._model(read(inner)[0], inner))
        self._judge_data(self.trees[first:], path)
        objects = sum(attached) + _objects(root, included, max(attached))
        if objects > OBJECTS:
            made = f"the file makes {objects:.3g} objects, copies included, and may make {OBJECTS} at most"
            self._refuse(root, f"{made}; lower the counts")
        keys = sum(node.tag == "key" for tree, _ in self.trees[first:] for node in tree.walk())
        if keys * objects > CELLS:
            self._refuse(root, f"{keys} keyframes of {objects:.3g} objects are more than are read; remove keyframes")
        self._objects[path.resolve()] = objects
        return objects

    def _inner(self, node, files):
        """The file of an element <include> or <model>."""
        name = node.demand("file")
        node.mistakes.demand_none()
        for folder in dict.fromkeys(file.parent for file in files):
            if self._exists(node, folder / name):
                self._demand_inside(node, folder / name)
                return folder / name
        self._refuse(node, f"there is no file {name!r}")

    def _demand_inside(self, node, path):
        if reason := self._outside.reason(path):
            self._refuse(node, f"{node.element.get('file')!r} {reason}")

    def _judge_data(self, trees, path):
        """Files of meshes, height fields and flexible bodies, wherever the compiler may look for them; their cells."""
        nodes = [(node, file) for tree, file in trees for node in tree.walk()]
        folders = {node.element.get(key, "") for node, _ in nodes if node.tag == "compiler"
                   for key in ("meshdir", "assetdir")} | {""}  # fmt: skip
        if len(folders) > FOLDERS:
            self._refuse(trees[0][0], f"there are more than {FOLDERS} folders of meshes")
        for node, file in nodes:
            name = node.element.get("file") or node.element.get("filename")
            if node.tag in NEEDED and name:
                for top in dict.fromkeys((path.parent, file.parent)):
                    for place in {top / folder / one for folder in folders for one in (name, Path(name).name)}:
                        self._judge_file(node, name, place)
            if node.tag == "hfield" and _number(node, "nrow") * _number(node, "ncol") > CELLS:
                self._refuse(node, f"<hfield> has more than {CELLS} cells")
            sizes = _numbers(node, "params") if node.tag == "mesh" else ()
            if any(size * size > OBJECTS for size in sizes):
                self._refuse(node, f"<mesh params>: the mesh has more than {OBJECTS} vertices")

    def _judge_file(self, node, name, place):
        if not self._exists(node, place):
            return
        if node.tag == "mesh" and self._outside.reason(place):
            self.hidden.add(name)
            return
        self._demand_inside(node, place)
        if place.is_dir():
            return
        try:
            validation.demand_regular(place)
        except StorageError as error:
            self._refuse(node, str(error).rstrip("."))
        if place.stat().st_size > LARGEST:
            self._refuse(node, f"{name!r} has more than {LARGEST} bytes")

    def _exists(self, node, path):
        try:
            return path.exists()
        except (OSError, ValueError) as error:
            self._refuse(node, f"{str(path)[:LONG]!r} is no file: {getattr(error, 'strerror', None) or error}")

    @staticmethod
    def _refuse(node, message):
        node.wrong(f"{message}.")
        node.mistakes.demand_none()


def _objects(node, included, attached):
    """The number of objects that an element makes."""
    inside = sum(_objects(child, included, attached) for child in included.get(node, node).nodes)
    own = 1.0 + sum(map(len, node.element.values())) // TEXT + sum(_number(node, name) for name in ROOM)
    if node.tag == "replicate":
        return own + inside * max(_number(node, "count"), 1.0)
    if node.tag in COUNTED:
        return (own + inside) * PARTS * max(math.prod(_numbers(node, "count")), 1.0)
    return own + inside + (attached if node.tag == "attach" else 0.0)


def _numbers(node, name) -> list[float]:
    """Numbers of an attribute; the compiler refuses those that are none."""
    found = []
    for word in (node.element.get(name) or "").split():
        try:
            value = abs(float(word))
        except ValueError:
            continue
        found.append(value if value < math.inf else math.inf)
    return [value for value in found if not math.isnan(value)]


def _number(node: Any, name: str) -> float:
    return next(iter(_numbers(node, name)), 0.0)
