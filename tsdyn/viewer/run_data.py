"""The data of a page: poses, parts, contacts and loads of a run, as JSON with arrays in base64."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .._version import __version__
from ..constraints import PlaneContact
from ..errors import InvalidArgument, StepFailure
from ..observables.quintic import intervals, quintic
from ..shapes import Mesh
from ..validation import sequence, vector3
from .symbols import (
    UNIT,
    Attached,
    Part,
    attached,
    by_body,
    derived,
    drawn_solid,
    given,
    joint_points,
    reaches,
    rounded,
    symbols,
)

if TYPE_CHECKING:
    from ..hints import Floats, Solution


# Frames of an animation: a run resampled at equal intervals of time.
#
# Between two outputs the coordinates are the quintic with the values, rates and accelerations of both; where a run kept
# its dense output, they are read from that. Euler parameters are scaled to unit length.

OUTPUTS = 8000  # of a stored run, that are read at most


class AnimationFrames(NamedTuple):
    """The run at times (k,), equally spaced; poses of b bodies. `run`: outputs beside these times."""

    times: Floats
    position: Floats  # (k, b, 3), m
    orientation: Floats  # (k, b, 4), Euler parameters; (1, 0, 0, 0) for a point mass
    run: Any

    def interpolated(self, values: Floats) -> Floats:
        """Values (outputs of `run`, ...) at the times of the frames, linear between outputs."""
        i, s, _ = intervals(self.run.t, self.times)
        s = s.reshape(-1, *[1] * (values.ndim - 1))
        return values[i] + s * (values[np.minimum(i + 1, len(values) - 1)] - values[i])


def resample(solution: Solution, count: int) -> AnimationFrames:
    """The `AnimationFrames` of a solution, at most `count`; InvalidArgument where numbers aren't finite."""
    times = np.linspace(solution.t[0], solution.t[-1], count if solution.t[-1] > solution.t[0] else 1)
    run = _beside(solution, times)
    q = _dense(solution, times)
    if q is None:
        q = quintic(run.t, (run.q, run.qd, run.qdd), times)[0]
    bodies = [solution.handles.where(body) for body in solution.handles.bodies]
    position = np.stack([q[:, at : at + 3] for at, _ in bodies], axis=1)
    orientation = np.zeros((times.size, len(bodies), 4))
    orientation[:, :, 0] = 1.0
    for i, (at, dimension) in enumerate(bodies):
        if dimension == 7:
            p = q[:, at + 3 : at + 7]
            orientation[:, i] = p / np.linalg.norm(p, axis=1, keepdims=True)
    if not all(np.isfinite(array).all() for array in (position, orientation, run.qd, run.qdd)):
        raise InvalidArgument(
            "the outputs have numbers that aren't finite, which can't be drawn: view others, solution[a:b].view()."
        )
    return AnimationFrames(times, position, orientation, run)


def _dense(solution, times):
    """Coordinates (k, n) from dense output, None where there is none, or it fails."""
    try:
        return None if solution._trajectory is None else solution.at(times).q
    except (InvalidArgument, StepFailure):  # of a run that ended early, close to its end
        return None


def _beside(solution, times):
    """The outputs on both sides of each time."""
    if solution._stored is not None:
        return solution[:: max(1, solution.t.size // OUTPUTS)]
    after = np.clip(np.searchsorted(solution.t, times, side="right"), 1, solution.t.size - 1)
    return solution._picked(np.union1d(after - 1, after) if solution.t.size > 1 else np.arange(1))


# States of contacts: whether a plane pushes on its point, or holds it back, where a one-sided contact would open.

OPEN, HOLDS_BACK, PUSHES = 0, 1, 2  # as the page colours them
NO_CONTACT = 1e-6  # of the largest force of the contact: below it there is none


def contact_states(frames: AnimationFrames, constraints: list[Attached]) -> list[Any]:
    """The states (k,) of each PlaneContact at the frames."""
    return [_states(frames, each.item) for each in constraints if isinstance(each.item, PlaneContact)]


def _states(frames, item):
    """From the sign of the multiplier: the force along the normal is -lam; NaN, of a dropped row, is none."""
    lam = np.nan_to_num(frames.interpolated(frames.run.multipliers[:, frames.run.rows(item).start]))
    none = NO_CONTACT * np.abs(lam).max(initial=0.0)
    return np.where(np.abs(lam) <= none, OPEN, np.where(lam < 0.0, PUSHES, HOLDS_BACK))


# Arrows: reactions of constraints and applied forces, with their torques, at the points where they act.

NO_ARROW = 1e-9  # of the largest load: below it an arrow is left out; torques are compared with forces by a length
UNITS = {"force": "N", "torque": "N m"}


class Arrows(NamedTuple):
    """Loads of one element on one body: values (k, 3) in the ground frame."""

    layer: str  # "reactions" or "forces"
    unit: str  # "force" or "torque"
    name: str
    body: int
    point: Any  # (3,), body frame
    values: Any
    unique: bool  # False where redundant constraints may share the load in many ways


def arrows(frames: AnimationFrames, constraints: list[Attached], forces: list[Attached], length: float) -> list[Arrows]:
    """All loads that are not zero throughout, at the times of the frames; NaN, of singular configurations, is zero.

    length: of a usual body, m.
    """
    found, redundant = [], bool(np.isnan(frames.run.multipliers).any())
    for layer, items in (("reactions", constraints), ("forces", forces)):
        for each in items:
            on_a = each.item.on is each.item.a
            index, point = (each.a, each.point("a")) if on_a else (each.b, each.point("b"))
            unique = not redundant or bool(frames.run.reaction_unique(each.item).all())
            for unit, values in zip(UNITS, frames.run.reaction(each.item), strict=True):
                values = np.nan_to_num(frames.interpolated(values))
                found.append(Arrows(layer, unit, each.item.name, index, point, values, unique))
    arms = {"force": 1.0, "torque": length}
    largest = max((size(one) / arms[one.unit] for one in found), default=0.0)
    return [one for one in found if size(one) / arms[one.unit] > NO_ARROW * largest]


def size(one: Arrows) -> float:
    """The largest component."""
    return float(np.abs(one.values).max(initial=0.0))


# The data of a page: poses, parts and loads of a run, as JSON with arrays in base64.
#
# Positions are float32 from an origin near the bodies, Euler parameters (e1, e2, e3, e0) and loads int16 of a full
# scale.

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
