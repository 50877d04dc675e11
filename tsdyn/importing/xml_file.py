"""XML as it is read by lxml, without entities and network; elements note what has been read; sources of MJCF."""

from __future__ import annotations

import math
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import validation
from ..errors import InvalidFile, MissingDependency, StorageError
from ..files.types import Mistakes
from ..validation import LONG
from .tolerances import CELLS, FOLDERS, OBJECTS, PARTS, TEXT

if TYPE_CHECKING:
    from collections.abc import Iterator

OUTSIDE = "is outside the folder of the file; ts.load(path, outside=True) reads it"
LARGEST = 1 << 26  # bytes of a file
MOST = 1 << 19  # elements and attributes of a file: half a gigabyte once they are read


class Lines:
    """Places of mistakes: they are (line, column) already."""

    @staticmethod
    def line_and_column(path: Any) -> Any:
        """Line and column."""
        return path


def read(path: Any) -> tuple[Node, Mistakes]:
    """The root element of a file, and the `Mistakes` to be found in it.

    A namespace of the root element is left out of the tags; elements of other ones keep theirs.

    Raises
    ------
    InvalidFile
        If it is no XML, has too many elements, or a document type, which could define entities.
    StorageError
        If it can't be read, is too large or no regular file.
    MissingDependency
        If lxml is not installed.
    """
    try:
        from lxml import etree
    except ImportError as error:
        raise MissingDependency("URDF, MJCF and SDF files need lxml: pip install 'tsdyn[import]'.") from error
    mistakes = Mistakes(str(path), Lines)
    options = {"resolve_entities": False, "no_network": True, "load_dtd": False, "huge_tree": False}
    elements = etree.iterparse(
        BytesIO(validation.read(path, LARGEST)), ("start",), remove_comments=True, remove_pis=True, **options
    )
    try:
        count = 0
        for _, element in elements:
            count += 1 + len(element.attrib)
            if count > MOST:
                mistakes.add((element.sourceline or 1, 1), f"the file has more than {MOST} elements and attributes.")
                mistakes.demand_none()
        root = elements.root
    except InvalidFile:
        raise
    except (etree.XMLSyntaxError, ValueError) as error:
        place = getattr(error, "position", None) or (1, 1)
        mistakes.add((max(place[0], 1), max(place[1], 1)), f"this is no XML: {getattr(error, 'msg', None) or error}.")
        mistakes.demand_none()
    if root.getroottree().docinfo.doctype:
        mistakes.add((1, 1), "the file has a DOCTYPE, which could define entities; remove it.")
        mistakes.demand_none()
    space, brace, _ = root.tag.partition("}")
    for element in root.iter(f"{space}}}*") if brace else ():
        element.tag = element.tag.partition("}")[2]
    return Node(root, mistakes), mistakes


class Node:
    """An element; attributes and children that are asked for count as read."""

    __slots__ = ("_nodes", "_read", "_whole", "element", "line", "mistakes", "tag")

    def __init__(self, element: Any, mistakes: Mistakes) -> None:
        self.element, self.mistakes = element, mistakes
        self.tag = element.tag if isinstance(element.tag, str) else ""
        self.line = element.sourceline or 1
        self._read: set[str] = set()
        self._nodes: list[Node] | None = None
        self._whole = False

    @property
    def nodes(self) -> list[Node]:
        """All children."""
        if self._nodes is None:
            self._nodes = [Node(one, self.mistakes) for one in self.element if isinstance(one.tag, str)]
        return self._nodes

    def walk(self) -> Iterator[Node]:
        """Itself and all elements below it, in the order of the file."""
        ahead = [self]
        while ahead:
            node = ahead.pop()
            yield node
            ahead += reversed(node.nodes)

    def all(self, *tags: str) -> list[Node]:
        """The children of some tags."""
        self._read.update(f"<{tag}>" for tag in tags)
        return [node for node in self.nodes if node.tag in tags]

    def one(self, tag: str) -> Node | None:
        """The child of a tag; the first one, where there are more, which is a mistake."""
        found = self.all(tag)
        if len(found) > 1:
            found[1].wrong(f"<{self.tag}> has more than one <{tag}>; keep one.")
        return found[0] if found else None

    def get(self, name: str, default: str | None = None) -> str | None:
        """An attribute."""
        self._read.add(name)
        value = self.element.get(name)
        return default if value is None else value.strip()

    def demand(self, name: str) -> str:
        """An attribute that must be there."""
        value = self.get(name)
        if not value:
            self.wrong(f"<{self.tag}> lacks {name}.")
        return value or ""

    @property
    def text(self) -> str:
        """The text between its tags."""
        return (self.element.text or "").strip()

    def numbers(self, text: str | None, count: int, default: Any, what: str) -> Any:
        """Numbers of a text, (count,); the default where it is left out or wrong."""
        if text is None:
            return np.array(default, float)
        try:
            found = np.array(text.split(), float)
        except ValueError:
            found = np.zeros(0)
        if found.shape != (count,) or not np.isfinite(found).all():
            self.wrong(f"{what} = {text[:60]!r}: it must be {count} finite number{'s' if count > 1 else ''}.")
            return np.array(default, float)
        return found

    def attribute(self, name: str, count: int, default: Any) -> Any:
        """Numbers of an attribute, (count,)."""
        return self.numbers(self.get(name), count, default, f"<{self.tag}> {name}")

    def number(self, name: str, default: float = 0.0) -> float:
        """The number of an attribute."""
        return float(self.attribute(name, 1, [default])[0])

    def value(self, tag: str, count: int, default: Any) -> Any:
        """Numbers in the text of a child, (count,)."""
        child = self.one(tag)
        return np.array(default, float) if child is None else child.numbers(child.text, count, default, f"<{tag}>")

    def scalar(self, tag: str, default: float = 0.0) -> float:
        """The number in the text of a child."""
        return float(self.value(tag, 1, [default])[0])

    def flag(self, tag: str, default: bool = False) -> bool:
        """Whether the text of a child is true."""
        child = self.one(tag)
        return default if child is None else child.text.lower() in ("1", "true")

    def skip(self) -> None:
        """Take all of it as read: what is left out has been said."""
        self._whole = True

    def wrong(self, message: str) -> None:
        """Add a mistake at this element."""
        self.mistakes.add((self.line, 1), message)

    def unread(self) -> list[tuple[str, int]]:
        """What nobody has asked for: (name, line), attributes as element@attribute."""
        if self._whole:
            return []
        found = [(f"<{self.tag} {name}>", self.line) for name in self.element.keys() if name not in self._read]  # noqa: SIM118
        for node in self.nodes:
            known = f"<{node.tag}>" in self._read
            found += node.unread() if known else [(f"<{node.tag}>", node.line)]
        return found


class OutsideFiles:
    """Which files an imported one may name: those of its folder and of folders in it, links followed; or all.

    Parameters
    ----------
    folder : Path
    admitted : bool
        Whether files outside may be read.
    """

    def __init__(self, folder: Path, admitted: bool) -> None:
        self.folder, self.admitted = folder.resolve(), admitted

    def reason(self, path: Path) -> str:
        """Why a file may not be read; empty if it may."""
        if self.admitted or path.resolve().is_relative_to(self.folder):
            return ""
        return OUTSIDE


def exists(path: Path) -> bool:
    """Whether there is such a file."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


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
