"""Pictures of runs by matplotlib: what the viewer shows, as shaded polygons, painted from back to front.

Parts, links and poses are those of `solution.view()`, so that a picture needs no browser.
"""

from itertools import pairwise

import numpy as np

from tsdyn.drawing import BLUE, GREEN, VERMILION
from tsdyn.elements.bodies import rotation_matrix
from tsdyn.viewer.run_data import resample, run_data
from tsdyn.viewer.symbols import attached

FRAMES = 200
SIDES, BANDS, TURNS = 20, 10, 6  # of cylinders and balls; of coils
LIGHT = np.array([0.35, 0.25, 0.9]) / np.linalg.norm([0.35, 0.25, 0.9])  # in the camera's frame


def paint(axes, solution, shapes=None, at=(1.0,), trails=None, layers=("bodies", "joints")):
    """Paint a solution at fractions `at` of its time, the earlier ones paler, with the trails of its bodies."""
    data = run_data(solution, shapes, trails)
    frames = resample(solution, FRAMES)
    camera = _camera(data)
    for trail in data["trails"]:
        turned = [rotation_matrix(p) @ trail["point"] for p in frames.orientation[:, trail["body"]]]
        flat = (frames.position[:, trail["body"]] + turned) @ camera.T
        axes.plot(*flat[:, :2].T, color=BLUE, linewidth=0.8, alpha=0.6, zorder=1)
    for i, fraction in enumerate(at):
        k = round(fraction * (len(frames.times) - 1))
        faces = [*_parts(data, frames, k, layers), *_links(data, frames, k, layers)]
        _polygons(axes, faces, camera, 0.25 + 0.75 * (i + 1) / len(at), 2 + i)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.axis("off")


def markers(axes, solution, item):
    """Draw the points and directions of a constraint or force at the end of a run, with their names; return these."""
    data, frames = run_data(solution), resample(solution, FRAMES)
    camera, item = _camera(data), getattr(item, "owner", None) or item
    found = next((each for many in attached(solution.packed) for each in many if each.item is item), None)
    length = 1.3 * max(data["bulk"])
    named = {}
    for marker in item.markers if found else ():
        place = found.places.get(marker.argument)
        if place is None or len(place) != 3:
            continue
        r, A = _pose(frames, -1, found.a if marker.body == "a" else found.b)
        ends = [r + A @ found.point(marker.body)]
        if not marker.argument.startswith("point"):
            if not np.any(place):
                continue
            ends.append(ends[0] + length * (A @ place) / np.linalg.norm(place))
        named[marker.argument] = _pointer(axes, (np.array(ends) @ camera.T)[:, :2], marker)
    axes.autoscale_view()
    return list(named)


def _pointer(axes, ends, marker):
    """A dot at a point, an arrow along a direction, and its name."""
    colour = VERMILION if marker.body == "a" else GREEN
    axes.plot(*ends[:1].T, "o", color=colour, markersize=4, zorder=20)
    if len(ends) == 2:
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", ends[1], ends[0], arrowprops=style, zorder=20)
        axes.update_datalim([ends[1]])
    shift = (4, 4) if marker.body == "a" else (4, -10)
    axes.annotate(marker.argument, ends[-1], shift, textcoords="offset points", color=colour, fontsize=8, zorder=21)


def _camera(data):
    """Rows: to the right, up, towards the viewer."""
    towards = np.array(data["view"]) / np.linalg.norm(data["view"])
    right = np.cross(data["up"], towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def _pose(frames, k, body):
    if body < 0:
        return np.zeros(3), np.eye(3)
    return frames.position[k, body], rotation_matrix(frames.orientation[k, body])


def _parts(data, frames, k, layers):
    """(vertices (n, 3) in the ground frame, colour) of each face of each part."""
    for part in data["parts"]:
        if part["layer"] in layers and part["kind"] in UNIT_FACES:
            columns, shift = np.reshape(part["matrix"][:9], (3, 3)), np.array(part["matrix"][9:])
            r, A = _pose(frames, k, part["body"])
            for face in UNIT_FACES[part["kind"]]:
                yield r + (face @ columns + shift) @ A.T, part["colour"]


def _links(data, frames, k, layers):
    for link in data["links"]:
        if link["layer"] in layers:
            ends = []
            for letter in "ab":
                r, A = _pose(frames, k, link[letter])
                ends.append(r + A @ link[f"point_{letter}"])
            along = ends[1] - ends[0]
            length = np.linalg.norm(along)
            if length > 0.0:
                f = np.cross(np.eye(3)[np.argmin(np.abs(along))], along)
                f *= link["radius"] / np.linalg.norm(f)
                columns = np.stack([f, np.cross(along / length, f), along])
                for face in UNIT_FACES[link["kind"]]:
                    yield ends[0] + along / 2 + face @ columns, link["colour"]


def _polygons(axes, faces, camera, alpha, order):
    """Paint those that face the viewer, the farthest first."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb

    shown = []
    for vertices, colour in faces:
        flat = vertices @ camera.T
        normal = np.cross(flat[1] - flat[0], flat[2] - flat[0])
        size = np.linalg.norm(normal)
        if size > 0.0 and normal[2] > 1e-9 * size:
            shade = 0.55 + 0.45 * max(0.0, float(normal @ LIGHT) / size)
            tone = alpha * shade * np.array(to_rgb(colour)) + (1.0 - alpha)
            shown.append((flat[:, 2].mean(), flat[:, :2], tone))
    shown.sort(key=lambda one: one[0])
    if shown:
        _, flats, tones = zip(*shown, strict=True)
        axes.add_collection(PolyCollection(flats, facecolors=tones, edgecolors=tones, linewidths=0.2, zorder=order))


def _box():
    corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return [
        corners[list(i)] for i in ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    ]


def _ring(sides, z, radius=1.0):
    angle = 2.0 * np.pi * np.arange(sides) / sides
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides, z)], axis=1)


def _walls(low, high):
    n = len(low)
    return [np.array([low[i], low[(i + 1) % n], high[(i + 1) % n], high[i]]) for i in range(n)]


def _cylinder():
    low, high = _ring(SIDES, -0.5), _ring(SIDES, 0.5)
    return [*_walls(low, high), high, low[::-1]]


def _sphere():
    polar = np.pi * np.arange(BANDS + 1) / BANDS
    rings = [_ring(SIDES, -np.cos(p), max(np.sin(p), 1e-6)) for p in polar]
    return [wall for low, high in pairwise(rings) for wall in _walls(low, high)]


def _coil():
    """A ribbon in turns about z."""
    angle = np.linspace(0.0, 2.0 * np.pi * TURNS, 12 * TURNS + 1)
    line = np.stack([np.cos(angle), np.sin(angle), angle / angle[-1] - 0.5], axis=1)
    band = np.array([0.0, 0.0, 0.3 / TURNS])
    walls = [np.array([p, q, q + band, p + band]) for p, q in pairwise(line)]
    return [*walls, *(wall[::-1] for wall in walls)]


UNIT_FACES = {"box": _box(), "cylinder": _cylinder(), "sphere": _sphere(), "coil": _coil()}
