"""`solution.view` and `scene.view`: one HTML page, in a notebook, in the browser, or in a file; or a GIF."""

from __future__ import annotations

import base64
import html
import io
import json
import os
import sys
import tempfile
import webbrowser
from functools import cache
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..drawing import GREY, demand_matplotlib
from ..elements.bodies import rotation_matrix
from ..errors import InvalidArgument
from .run_data import FULL
from .symbols import VIOLATED

if TYPE_CHECKING:
    from ..hints import Floats, Iterator, Sequence


SCRIPTS = ("poses.js", "instances.js", "stage.js", "names.js", "player.js")
PAGES, GIF = (".html", ".htm"), ".gif"
HEIGHT = 520  # of the frame in a notebook, pixels


class View:
    """A page that notebooks show inline.

    Attributes
    ----------
    html : str
        The whole page.
    """

    def __init__(self, page: str) -> None:
        self.html = page

    def save(self, path: str | Path) -> Path:
        """Write the page to a file, of suffix .html; return its path."""
        return write(self.html.encode(), page_path(path, PAGES))

    def _repr_html_(self) -> str:
        """Return the page in a frame of its own."""
        style = f"width: 100%; height: {HEIGHT}px; border: 0"
        return f'<iframe srcdoc="{html.escape(self.html)}" style="{style}" allowfullscreen></iframe>'

    def __repr__(self) -> str:
        return f"<View: an HTML page of {len(self.html) / 1e6:.2g} MB; .save(path) writes it>"


def show(data: dict[str, Any], path: str | Path | None) -> Path | View:
    """Write a page or a GIF of `run_data` or `scene_data`, or show it in a notebook or the browser."""
    path = None if path is None else page_path(path)
    if path is not None and path.suffix.lower() == GIF:
        if not path.resolve().parent.is_dir():  # painting takes seconds
            raise InvalidArgument(f"view: {path} can't be written: there is no such folder.")
        return write(animation(data), path)
    page = page_of(data)
    if path is not None:
        return write(page.encode(), path)
    if in_notebook():
        return View(page)
    handle, name = tempfile.mkstemp(prefix="tsdyn-", suffix=".html")
    os.close(handle)
    file = write(page.encode(), Path(name))
    if not (has_display() and webbrowser.open(file.as_uri())):
        print(f"The page is in {file}; open it in a browser.")
    return file


def page_of(data: dict[str, Any]) -> str:
    """The page of the data of a run or a scene."""
    run = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts = {
        "title": html.escape(data["title"]),
        "style": source("page.css"),
        "run": run,
        "three": source("three.js"),
        "scripts": "\n".join(source(name) for name in SCRIPTS),
    }
    before, *rest = source("page.html").split("{{")
    pieces = [piece.partition("}}") for piece in rest]
    return before + "".join(parts[name] + after for name, _, after in pieces)


@cache
def source(name: str) -> str:
    """The text of a file of the page."""
    return (resources.files(__package__) / "page" / name).read_text(encoding="utf-8")


def write(content: bytes, path: Path) -> Path:
    """Write a page or a GIF to a file; return its path; raises InvalidArgument if it can't be written."""
    try:
        path.write_bytes(content)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidArgument(f"view: {path} can't be written: {reason}.") from error
    return path


def page_path(path: str | Path, suffixes: tuple[str, ...] = (*PAGES, GIF)) -> Path:
    """The path of an animation, of suffix .html if it has none; raises InvalidArgument for another one than these."""
    try:
        path = Path(path)
        path = path if path.suffix else path.with_suffix(".html")
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"view: {path} can't be written: {error}.") from error
    if path.suffix.lower() not in suffixes:
        kinds = (
            "an HTML page or a GIF; its path must end in .html or .gif" if GIF in suffixes else "an HTML page (.html)"
        )
        raise InvalidArgument(f"view: this is {kinds}, got {str(path)!r}. solution.plot(path) writes a figure.")
    return path


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


def has_display() -> bool:
    """Whether a window can be opened here; a browser within the terminal would hold the program up."""
    if os.environ.get("BROWSER") or sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


# Pictures by matplotlib: what the page shows, as shaded polygons, painted from back to front; GIFs of them.

SIDES, BANDS, TURNS = 20, 10, 6  # of cylinders and balls; of coils
LIGHT = np.array([0.35, 0.25, 0.9]) / np.linalg.norm([0.35, 0.25, 0.9])  # in the camera's frame
FINE, CELLS = 2000, 12  # triangles of a mesh above which it is painted coarsely, by so many cells along its extent
FLAT_FACE = 1e-9  # of a face's area, seen by the camera: below it is seen from its edge


# Unit shapes, each as groups of polygons of the same number of corners, (faces, corners, 3), counterclockwise outside.


def _box():
    corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return [corners[[(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]]]


def _ring(z, radius=1.0):
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(SIDES, z)], axis=1)


def _walls(low, high):
    return np.stack([low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high], axis=1)


def _cylinder():
    low, high = _ring(-0.5), _ring(0.5)
    return [_walls(low, high), np.stack([high, low[::-1]])]


def _sphere():
    polar = np.pi * np.arange(BANDS + 1) / BANDS
    rings = [_ring(-np.cos(p), max(np.sin(p), 1e-6)) for p in polar]
    return [np.concatenate([_walls(low, high) for low, high in pairwise(rings)])]


def _coil():
    """A ribbon in turns about z."""
    angle = np.linspace(0.0, 2.0 * np.pi * TURNS, 12 * TURNS + 1)
    line = np.stack([np.cos(angle), np.sin(angle), angle / angle[-1] - 0.5], axis=1)
    band = np.array([0.0, 0.0, 0.3 / TURNS])
    walls = np.stack([line[:-1], line[1:], line[1:] + band, line[:-1] + band], axis=1)
    return [np.concatenate([walls, walls[:, ::-1]])]


def _mesh(data):
    """The triangles of a mesh, from both sides as on the page; of a fine one, vertices within a cell become one."""
    vertices, faces = _array(data["vertices"], "<f4").reshape(-1, 3), _array(data["faces"], "<u4").reshape(-1, 3)
    if len(faces) > FINE:
        cells = np.rint(CELLS / np.ptp(vertices, axis=0).max() * vertices)
        _, first, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        vertices, faces = vertices[first], np.unique(cell[faces], axis=0)
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    return [vertices[faces], vertices[faces][:, ::-1]]


def _array(text, kind):
    return np.frombuffer(base64.b64decode(text), kind).astype(int if "u" in kind else float)


UNIT_FACES = {"box": _box(), "cylinder": _cylinder(), "sphere": _sphere(), "coil": _coil()}


class Painter:
    """Paints frames of what `run_data` or `scene_data` returns; parallel projection.

    Attributes
    ----------
    camera : ndarray (3, 3)
        Rows: to the right, up, towards the viewer.
    """

    def __init__(self, data: dict[str, Any]) -> None:
        self.data, shape = data, (data["frames"], len(data["bodies"]))
        self.position = _array(data["positions"], "<f4").reshape(*shape, 3) + np.array(data["origin"])
        p = np.roll(_array(data["rotations"], "<i2").reshape(*shape, 4) / FULL, 1, axis=2)
        self.rotation = rotation_matrix(p / np.linalg.norm(p, axis=2, keepdims=True))
        self.states = [_array(states, "<u1") for states in data["contacts"]]
        self.faces = UNIT_FACES | {f"mesh{i}": _mesh(mesh) for i, mesh in enumerate(data["meshes"])}
        towards = np.array(data["view"]) / np.linalg.norm(data["view"])
        right = np.cross(data["up"], towards)
        if np.linalg.norm(right) < FLAT_FACE:  # from above or below
            right = np.cross(np.roll(data["up"], 1), towards)
        right /= np.linalg.norm(right)
        self.camera = np.stack([right, np.cross(towards, right), towards])

    def pose(self, k: int, body: int) -> tuple[Floats, Floats]:
        """Position (3,) and rotation (3, 3) of a body at a frame; -1 is the ground."""
        return (np.zeros(3), np.eye(3)) if body < 0 else (self.position[k, body], self.rotation[k, body])

    def place(self, k: int, body: int, point: Any) -> Floats:
        """Where a point of a body is at a frame, (3,)."""
        r, A = self.pose(k, body)
        return r + A @ np.asarray(point)

    def way(self, trail: dict[str, Any]) -> Floats:
        """A trail on the picture, (frames, 2)."""
        return self.flat(self.position[:, trail["body"]] + self.rotation[:, trail["body"]] @ trail["point"])

    def flat(self, points: Any) -> Floats:
        """Points (..., 3) on the picture, (..., 2)."""
        return (points @ self.camera.T)[..., :2]

    def polygons(self, k: int, layers: Sequence[str], alpha: float = 1.0) -> tuple[list[Floats], Floats]:
        """Polygons on the picture that face the viewer, the farthest first, and their colours; alpha: how pale."""
        from matplotlib.colors import to_rgb

        found = []
        for corners, colour in self._solid(k, layers):
            flat = corners @ self.camera.T
            normal = np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0])
            size = np.linalg.norm(normal, axis=1)
            front = normal[:, 2] > FLAT_FACE * size
            light = np.maximum(0.0, normal[front] @ LIGHT / size[front])
            tones = alpha * (0.55 + 0.45 * light)[:, None] * np.array(to_rgb(colour)) + (1.0 - alpha)
            found += zip(flat[front, :, 2].mean(axis=1), flat[front, :, :2], tones, strict=True)
        found.sort(key=lambda one: one[0])
        return [corners for _, corners, _ in found], np.array([tone for *_, tone in found]).reshape(-1, 3)

    def _solid(self, k, layers) -> Iterator[tuple[Floats, str]]:
        """(corners (faces, n, 3) in the ground frame, colour) of parts and links."""
        for part in self.data["parts"]:
            if part["layer"] in layers:
                columns, shift = np.reshape(part["matrix"][:9], (3, 3)), np.array(part["matrix"][9:])
                (r, A), colour = self.pose(k, part["body"]), part["colour"]
                if self.states and "contact" in part:
                    colour = self.data["tones"][self.states[part["contact"]][k]]
                for faces in self.faces[part["kind"]]:
                    yield r + (faces @ columns + shift) @ A.T, colour
        for link in self.data["links"]:
            a, b = (self.place(k, link[letter], link[f"point_{letter}"]) for letter in "ab")
            length = np.linalg.norm(b - a)
            if link["layer"] in layers and length > 0.0:
                f = np.cross(np.eye(3)[np.argmin(np.abs(b - a))], b - a)
                f *= link["radius"] / np.linalg.norm(f)
                columns = np.stack([f, np.cross((b - a) / length, f), b - a])
                for faces in self.faces[link["kind"]]:
                    yield (a + b) / 2 + faces @ columns, link["colour"]


# A GIF of a run or a scene: bodies, joints and trails over the grid, from the place of the page's camera.

SIZE = 6.4, 4.8  # inches, at DPI
DPI = 100
RATE = 20  # frames/s
SHORT, LONG = 1.5, 10.0  # s: runs of a duration between them are shown as fast as they are, others within LONG
PALETTE = 128  # of the palette of a frame
LINES = 24  # of the grid, each way
HALF_ANGLE = np.tan(np.radians(17.5))  # of the page's camera, above the line of sight


def animation(data: dict[str, Any]) -> bytes:
    """The GIF of what `run_data` or `scene_data` returns.

    Raises
    ------
    MissingDependency
        If matplotlib, with Pillow, is not installed.
    """
    demand_matplotlib("the GIF")
    from matplotlib import style
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from PIL import Image

    painter, (start, end), count = Painter(data), data["time"], data["frames"]
    seconds = end - start if SHORT <= end - start <= LONG else LONG
    frames = np.rint(np.linspace(0, count - 1, round(seconds * RATE) + 1 if count > 1 else 1)).astype(int)
    images = []
    with style.context("default"):
        figure = Figure(figsize=SIZE, dpi=DPI)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        grid = axes.add_collection(LineCollection([], colors="0.85", linewidths=0.6))
        ways = [painter.way(trail) for trail in data["trails"]]
        lines = [axes.plot([], [], color=GREY, linewidth=0.8)[0] for _ in ways]
        solids = axes.add_collection(PolyCollection([], linewidths=0.2, zorder=2))
        clock = axes.text(0.02, 0.96, "", transform=axes.transAxes, va="top")
        violated = "\n".join(each["text"] for each in data["labels"] if each["violated"])
        behind = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
        axes.text(0.02, 0.02, violated, transform=axes.transAxes, color=VIOLATED, va="bottom", bbox=behind, zorder=3)
        axes.axis("off")
        for k in frames:
            target, radius = _seen(painter, k)
            grid.set_segments(_grid(painter, target))
            for line, way in zip(lines, ways, strict=True):
                line.set_data(*way[: k + 1].T)
            polygons, tones = painter.polygons(k, ("bodies", "joints"))
            solids.set(verts=polygons, facecolors=tones, edgecolors=tones)
            clock.set_text(f"{start + (end - start) * k / max(1, count - 1):.3g} s")
            x, y = painter.flat(target)
            wide = radius * SIZE[0] / SIZE[1]
            axes.set(xlim=(x - wide, x + wide), ylim=(y - radius, y + radius))
            canvas.draw()
            picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
            images.append(picture.quantize(PALETTE, Image.Quantize.FASTOCTREE))
    file = io.BytesIO()
    images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=1000 // RATE, loop=0)
    return file.getvalue()


def _seen(painter, k):
    """What is in the middle of the picture, (3,), and how much is seen around it, m."""
    data, follow = painter.data, painter.data["follow"]
    if data["eye"]:
        eye, target = np.array(data["eye"])
        radius = HALF_ANGLE * np.linalg.norm(eye - target)
        return (target if follow == -1 else target + _followed(painter, k) - _followed(painter, 0)), radius
    return _followed(painter, k), data["radius"]


def _followed(painter, k):
    if painter.data["follow"] >= 0:
        return painter.position[k, painter.data["follow"]]
    centres = _array(painter.data["centres"], "<f4").reshape(-1, 3) + np.array(painter.data["origin"])
    return centres[min(k, len(centres) - 1)]


def _grid(painter, target):
    """The lines of the grid under a point, (lines, 2, 2) on the picture."""
    data, up = painter.data, np.array(painter.data["up"])
    step, level = data["grid"]["step"], data["grid"]["level"] + up @ np.array(data["origin"])
    i, j = (axis for axis in range(3) if not up[axis])
    middle, reach = step * np.rint(target / step), step * LINES / 2
    lines = []
    for along, across in ((i, j), (j, i)):
        for offset in np.linspace(-reach, reach, LINES + 1):
            ends = np.tile(up * level, (2, 1))
            ends[:, across] += middle[across] + offset
            ends[:, along] += middle[along] + np.array([-reach, reach])
            lines.append(painter.flat(ends))
    return lines
