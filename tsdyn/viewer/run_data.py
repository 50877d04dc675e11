"""The data of a page: poses, parts and loads of a run, as JSON with arrays in base64.

Positions are float32 from an origin near the bodies, Euler parameters (e1, e2, e3, e0) and loads int16 of a full scale.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from .._version import __version__
from ..errors import InvalidArgument
from ..shapes import Mesh
from ..validation import sequence, vector3
from .body_shapes import by_body, derived, drawn_solid, given
from .contacts import contact_states
from .frames import resample
from .loads import UNITS, arrows, size
from .parts import UNIT, Part, rounded
from .sizes import attached, joint_points, reaches
from .symbols import symbols

FRAMES, FEWEST = 1000, 200  # at most; and at least, however many bodies there are
ROOM = 1_600_000  # bytes of arrays at most, if not more frames than FEWEST
FULL = 32767  # of int16
FLAT = 0.05  # a motion within a layer is looked at from across it: thickness per extent
FAST = 1.5  # rotation between frames, rad, from which it is said that the animation leaves some out
TRAILS = 8  # bodies at most whose trails are shown at first


def run_data(solution: Any, shapes: Any = None, trails: Any = None) -> dict[str, Any]:
    """All that a page shows of a solution, with the shapes (body -> shape or list) and trails that a user gives."""
    if not solution.t.size:
        raise InvalidArgument("view: the solution has no outputs, so there is nothing to show.")
    packed = solution.packed
    constraints, forces = attached(packed)
    user = by_body(solution.scene.shapes, solution.handles, solution.scene.ground)
    user |= by_body({} if shapes is None else shapes, solution.handles, solution.scene.ground)
    per_frame = 20 * len(packed.bodies) + 6 * 2 * (len(constraints) + len(forces))
    frames = resample(solution, int(np.clip(ROOM // per_frame, FEWEST, FRAMES)))
    points = joint_points([*constraints, *forces], len(packed.bodies))
    reach = reaches(packed, points, frames.position)
    meshes: list[Mesh] = []
    parts: list[Any] = [part for i, shape in user.items() for part in given(i, shape, meshes, _name(packed, i))]
    solids = [_solid(packed, i, points[i], reach[i]) for i in range(len(packed.bodies))]
    for i, solid in enumerate(solids):
        parts += [] if i in user else derived(i, solid, points[i], reach[i])
    bulk = _bulk(parts, meshes, reach)
    girth = np.array([0.0 if solid is None else solid.girth for solid in solids])
    for each in (*constraints, *forces):
        parts += symbols(each, reach, girth, _apart(frames, each))
    origin = frames.position[0].mean(axis=0)
    return {
        "version": __version__,
        "title": repr(solution.scene).strip("<>"),
        "method": f"{solution.method}, formulation {solution.formulation}",
        "note": _note(frames, solution),
        "time": [float(frames.times[0]), float(frames.times[-1])],
        "frames": len(frames.times),
        "bodies": [{"name": body.name, "rigid": body.dimension == 7} for body in packed.bodies],
        "reach": rounded(reach),
        "bulk": rounded(bulk),
        "trails": _trails(trails, solution.handles),
        "origin": origin.tolist(),
        "positions": encoded(frames.position - origin, "<f4"),
        "rotations": encoded(np.rint(FULL * np.roll(frames.orientation, -1, axis=2)), "<i2"),
        "parts": [part.data() for part in parts if isinstance(part, Part)],
        "links": [link.data() for link in parts if not isinstance(link, Part)],
        "meshes": [{"vertices": encoded(m.vertices, "<f4"), "faces": encoded(m.faces, "<u4")} for m in meshes],
        "contacts": [encoded(states, "<u1") for states in contact_states(frames, constraints)],  # of such parts in turn
        **_loads(frames, constraints, forces, float(np.median(reach))),
        **_camera(packed, frames),
    }


def encoded(values: Any, kind: str) -> str:
    """An array in base64, little-endian; "<f4", "<i2", "<u4"."""
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode("ascii")


def _trails(trails, handles):
    """Points whose trails are shown at first: those that are asked for, or centroids of some bodies along the list."""
    if trails is None:
        some = np.linspace(len(handles.bodies) - 1, 0, TRAILS).astype(int)
        trails = [handles.bodies[i] for i in sorted({*some.tolist()})]
    found = []
    for each in sequence(
        trails, "view: trails must be a sequence of bodies, or of pairs (body, point)", InvalidArgument
    ):
        body, point = each if isinstance(each, tuple) and len(each) == 2 else (each, np.zeros(3))
        body = handles.body(body)
        point = vector3(point, f"view: trail of {body.name!r}: point (m)", InvalidArgument)
        found.append({"body": handles.bodies.index(body), "point": rounded(point)})
    return found


def _name(packed, index):
    return "ground" if index < 0 else packed.bodies[index].name


def _solid(packed, index, points, reach):
    if packed.bodies[index].dimension == 3:
        return None
    return drawn_solid(packed.system.mass[index], packed.system.inertia[index].reshape(3, 3), points, reach)


def _bulk(parts, meshes, reach):
    """How far what is drawn of each body extends from its centroid, m."""
    bulk = reach.copy()
    for part in parts:
        if part.kind in UNIT:
            extent = part.reach
        else:
            vertices = meshes[int(part.kind.removeprefix("mesh"))].vertices
            extent = float(np.linalg.norm(part.position) + np.linalg.norm(vertices, axis=1).max())
        if part.body >= 0:
            bulk[part.body] = max(bulk[part.body], extent)
    return bulk


def _apart(frames, each):
    """Distance of the first points of an element on its two bodies, at the start, m."""
    a, b = (_place(frames, index, each.point(letter)) for index, letter in ((each.a, "a"), (each.b, "b")))
    return float(np.linalg.norm(a - b))


def _place(frames, index, point):
    if index < 0:
        return point
    e0, e = frames.orientation[0, index, 0], frames.orientation[0, index, 1:]
    return frames.position[0, index] + point + 2.0 * np.cross(e, np.cross(e, point) + e0 * point)


def _loads(frames, constraints, forces, reach):
    """Arrows, and the load, N or N m, that is their full scale."""
    found = [] if getattr(frames.run, "_lacks", "") else arrows(frames, constraints, forces, reach)
    scales = {unit: max((size(one) for one in found if one.unit == unit), default=0.0) for unit in UNITS}
    values = [np.rint(one.values * (FULL / scales[one.unit])) for one in found]
    listed = [one._asdict() | {"values": None, "point": rounded(one.point)} for one in found]
    return {"arrows": listed, "loads": encoded(np.array(values), "<i2"), "scales": scales}


def _camera(packed, frames):
    """Upwards is against gravity, along the nearest axis; the view is across a flat motion."""
    gravity = packed.system.gravity
    up = np.eye(3)[2]
    if gravity.any():
        i = int(np.abs(gravity).argmax())
        up = -np.sign(gravity[i]) * np.eye(3)[i]
    level = [i for i in range(3) if not up[i]]
    extent = np.ptp(frames.position.reshape(-1, 3), axis=0)
    thin = [i for i in level if extent[i] < FLAT * extent.max()]
    first = thin[0] if len(thin) == 1 else level[-1]
    right = np.eye(3)[sum(level) - first]
    raised, aside = (
        (0.25, 0.35) if len(thin) == 1 else (1.5, 0.3) if extent @ np.abs(up) < FLAT * extent.max() else (0.5, 0.7)
    )
    view = np.cross(right, up) + aside * right + raised * up
    return {"up": up.tolist(), "view": view.tolist()}


def _note(frames, solution):
    """What a viewer should know of the animation."""
    p = frames.orientation
    turned = np.abs(np.einsum("kbi,kbi->kb", p[1:], p[:-1])).min(initial=1.0)
    notes = [] if solution.success else [solution.message]
    notes += [solution._lacks] if getattr(solution, "_lacks", "") else []
    if 2.0 * np.arccos(min(1.0, turned)) > FAST:
        notes.append("Bodies turn far between frames; solution[a:b].view() shows a part of the run.")
    return " ".join(notes)
