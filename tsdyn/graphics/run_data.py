"""The data of a page: poses, parts, contacts and loads of a run, or of a scene, as JSON with arrays in base64."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .._version import __version__
from ..constraints import SphereContact
from ..elements.bodies import rotation_matrix
from ..errors import InvalidArgument, StepFailure
from ..maths.tolerances import TINY
from ..model.handles import handles_of
from ..model.packed import has_friction
from ..observables.diagnostics import constraint_rows
from ..observables.reactions import touching
from ..observables.tolerances import JUMP, OTHERWISE, SMALL_RANGE
from ..shapes import Mesh
from ..validation import floats, sequence, vector3
from .symbols import (
    SURFACES,
    SYMBOL,
    UNIT,
    Attached,
    Connector,
    Part,
    attached,
    by_body,
    contact_mark,
    derived,
    drawn_solid,
    given,
    joint_points,
    reaches,
    rods,
    rounded,
    symbols,
    violation,
)

if TYPE_CHECKING:
    from ..hints import Floats, Scene, Sequence, Solution

# Frames of an animation: a run resampled at equal intervals of time.
#
# Between two outputs the coordinates are the quintic with the values, rates and accelerations of both; where a run kept
# its dense output, they are read from that. Euler parameters are scaled to unit length.

OUTPUTS = 8000  # of a stored run, that are read at most


class AnimationFrames(NamedTuple):
    """The run at times (k,), equally spaced; poses of b bodies. `run`: outputs beside these times; None of a scene."""

    times: Floats
    position: Floats  # (k, b, 3), m
    orientation: Floats  # (k, b, 4), Euler parameters; (1, 0, 0, 0) for a point mass
    run: Any
    q: Floats  # coordinates (k, n)

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
    position, orientation = _poses(solution.packed, q)
    if not all(np.isfinite(array).all() for array in (position, orientation, run.qd, run.qdd)):
        raise InvalidArgument(
            "the outputs have numbers that aren't finite, which can't be drawn: view others, solution[a:b].view()."
        )
    return AnimationFrames(times, position, orientation, run, q)


def _poses(packed, q):
    """Positions (k, b, 3) and Euler parameters (k, b, 4) of coordinates (k, n)."""
    bodies = packed.system.bodies.tolist()
    position = np.stack([q[:, at : at + 3] for at, _ in bodies], axis=1)
    orientation = np.zeros((len(q), len(bodies), 4))
    orientation[:, :, 0] = 1.0
    for i, (at, dimension) in enumerate(bodies):
        if dimension == 7:
            p = q[:, at + 3 : at + 7]
            orientation[:, i] = p / np.linalg.norm(p, axis=1, keepdims=True)
    return position, orientation


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


# Contact points of rolling surfaces: to the page they are bodies without parts of their own, after the others.


def _contact_points(packed, frames, constraints):
    """Constraint -> contact points (k, 3), of those that have one; of an open ball, where it is nearest."""
    balls = {id(each.item): _nearest(frames, each) for each in constraints if isinstance(each.item, SphereContact)}
    found = {member.constraint: touching(packed, member, frames.q) for member in packed.members}
    return {
        item: balls[id(item)] if contact is None else contact[0]
        for item, contact in found.items()
        if contact is not None or id(item) in balls
    }


def _nearest(frames, each):
    """Points (k, 3) of the ball of a SphereContact."""
    centre = _place(frames, each.a, each.point("a"))
    if each.item.radius_b is None:
        towards = -_turned(frames, each.b, each.item.normal_b)
    else:
        towards = _place(frames, each.b, each.point("b")) - centre
        towards = towards / np.maximum(np.linalg.norm(towards, axis=-1, keepdims=True), TINY)
        towards = -towards if each.item.inside else towards
    return centre + each.item.radius_a * towards


# States of contacts. Of one that opens: whether it is closed, sticks by its friction, or has just been hit. Of a plane
# that holds its point on both sides: whether it pushes, or holds back, where one that opens would do so.

OPEN, HOLDS_BACK, PUSHES, HIT, STICKS = range(5)
TONES = "#3f464e", "#d33a2c", "#2f9e44", "#f2b705", "#1c7ed6"
NO_CONTACT = 1e-6  # of the largest force of the contact: below it there is none
FLASH = 0.02  # of the animation, how long a hit is shown
NAMED = 4  # closed contacts that are named


def contact_states(frames: AnimationFrames, constraints: list[Attached]) -> list[Any]:
    """The states (k,) of each contact at the frames."""
    closed, opening = _closed(frames), {id(law.contact) for law in frames.run.packed.laws}
    return [
        _of_phases(frames, item, closed) if id(item) in opening else _of_plane(frames, item)
        for item in (each.item for each in constraints if each.contact is not None)
    ]


def _of_plane(frames, item):
    """From the sign of the multiplier: the force along the normal is -lam; NaN, of a dropped row, is none."""
    lam = np.nan_to_num(frames.interpolated(frames.run.multipliers[:, frames.run.rows(item).start]))
    none = NO_CONTACT * np.abs(lam).max(initial=0.0)
    return np.where(np.abs(lam) <= none, OPEN, np.where(lam < 0.0, PUSHES, HOLDS_BACK))


def _closed(frames):
    """The names of the closed contacts at each frame."""
    phases = frames.run.phases
    number = np.searchsorted([start for start, *_ in phases], frames.times, side="right") - 1
    return [phases[max(i, 0)][2] for i in number]


def _of_phases(frames, item, closed):
    run = frames.run
    (name,) = run.handles.names_of([item])
    states = np.where([name in names for names in closed], PUSHES, OPEN)
    if has_friction(run.packed, item):
        states[run.sticking(item)[np.searchsorted(run.t, frames.times, side="right") - 1]] = STICKS
    hits = np.array([-np.inf, *(t for t, hit, _ in run.impulses if hit == name)])
    last = hits[np.searchsorted(hits, frames.times, side="right") - 1]
    states[frames.times - last <= FLASH * np.ptp(frames.times)] = HIT
    return states


def said_of(names: Sequence[str]) -> str:
    """Closed contacts in words."""
    more = f", {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"closed: {', '.join(names[:NAMED])}{more}" if names else ""


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


def arrows(
    frames: AnimationFrames, constraints: list[Attached], forces: list[Attached], length: float, points: dict[int, int]
) -> list[Arrows]:
    """All loads that are not zero throughout, at the times of the frames; NaN, of singular configurations, is zero.

    length: of a usual body, m; points: the index of a contact point by the id of its constraint.
    """
    found, redundant = [], bool(np.isnan(frames.run.multipliers).any())
    for layer, items in (("reactions", constraints), ("forces", forces)):
        for each in items:
            on_a = each.item.on is each.item.a
            index, point = (each.a, each.point("a")) if on_a else (each.b, each.point("b"))
            if id(each.item) in points:
                index, point = points[id(each.item)], np.zeros(3)
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
FAST = 1.5  # rotation between frames, rad, from which it is said that the animation leaves some out
TRAILS = 8  # bodies at most whose trails are shown at first


def run_data(solution: Any, **choices: Any) -> dict[str, Any]:
    """All that a page shows of a solution; `choices` are the arguments of `Solution.view`."""
    if not solution.t.size:
        raise InvalidArgument("view: the solution has no outputs, so there is nothing to show.")
    packed = solution.packed
    constraints, forces = attached(packed)
    per_frame = 20 * len(packed.bodies) + 6 * 2 * (len(constraints) + len(forces))
    frames = resample(solution, int(np.clip(ROOM // per_frame, FEWEST, FRAMES)))
    data = _contents(solution.scene, packed, (constraints, forces), frames, {}, **choices)
    data["method"] = f"{solution.method}, formulation {solution.formulation}"
    data["note"] = _note(frames, solution)
    data["contacts"] = [encoded(states, "<u1") for states in contact_states(frames, constraints)]
    words = [said_of(names) for names in _closed(frames)]
    known = {word: i for i, word in enumerate(dict.fromkeys(words))}
    data["said"] = {"words": list(known), "of": encoded([known[word] for word in words], "<u2")}
    if not getattr(solution, "_lacks", ""):
        points = _contact_points(packed, frames, constraints)
        points = {id(item): len(packed.bodies) + i for i, item in enumerate(points)}
        data |= _loads(arrows(frames, constraints, forces, float(np.median(data["reach"])), points))
    return data


def scene_data(scene: Scene, held: Any, t: float, notes: Sequence[str] = (), **choices: Any) -> dict[str, Any]:
    """All that a page shows of a scene at its start, with the rows that are violated at time t; notes: said, too.

    held: `Packed` with what holds there; open contacts and inactive parts are missing.
    """
    packed, (q, qd) = scene.packed, scene.start
    violated: dict[Any, list[str]] = {}
    for constraint, said in _violated(held, t, q, qd):
        violated.setdefault(constraint, []).append(said)
    frames = AnimationFrames(np.array([t]), *_poses(packed, q[None]), None, q[None])
    data = _contents(scene, packed, attached(packed), frames, violated, trails=(), **choices)
    count = sum(map(len, violated.values()))
    rows = f"{count} constraint row{'s are' if count > 1 else ' is'} violated"
    note = f"{rows}, named in red; scene.assemble() moves the bodies to where all rows hold." if count else ""
    return data | {"method": f"start, t = {t:g} s", "note": "\n".join(filter(None, [note, *notes]))}


def encoded(values: Any, kind: str) -> str:
    """An array in base64, little-endian; "<f4", "<i2", "<u4"."""
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode("ascii")


def _contents(scene, packed, attachments, frames, violated, *, shapes=None, trails=None, camera=None, follow=None):
    """What a page shows of bodies, constraints and forces at the frames; violated: constraint -> what is said of it."""
    constraints, forces = attachments
    handles = handles_of(packed)
    user = by_body({} if shapes is None else shapes, handles, scene.ground)
    named = {body.name: body for body in scene.bodies}  # of a scene with other parameters they aren't those of `packed`
    bodies = [named.get(body.name, body) for body in packed.bodies]
    own = {i: body.shape for i, body in enumerate(bodies) if body._shape is not None}
    own[-1] = scene.ground.shape or ()
    hidden = {i for i, pieces in (own | user).items() if i >= 0 and not pieces}
    points = joint_points([*constraints, *forces], len(packed.bodies))
    reach = reaches(packed, points, frames.position, hidden)
    meshes: list[Mesh] = []
    parts: list[Any] = [part for i, pieces in (own | user).items() for part in given(i, pieces, meshes)]
    solids = [_solid(packed, i, points[i], reach[i]) for i in range(len(packed.bodies))]
    made: list[list[Part]] = [[] for _ in range(len(packed.bodies) + 1)]  # by body, that of the ground last
    for part in parts:
        made[part.body].append(part)
    surfaces = {each.a for each in constraints if type(each.item).__name__ in SURFACES}  # which its symbol draws
    for i, body in enumerate(bodies):
        if i not in own and i not in user and i in surfaces:
            parts += rods(i, points[i], reach[i])
        elif i not in own and i not in user:
            parts += derived(i, solids[i], points[i], reach[i])
        elif i not in user and not callable(body._shape) and i not in hidden:  # in files arms have shapes of their own
            parts += rods(i, [x for x in points[i] if not any(part.holds(x) for part in made[i])], reach[i])
    bulk = _bulk(parts, meshes, reach)
    girth = np.array([0.0 if solid is None else solid.girth for solid in solids])
    labels = [_label(body.name, "bodies", i, np.zeros(3)) for i, body in enumerate(packed.bodies) if i not in hidden]
    for each in (*constraints, *forces):
        apart = _apart(frames, each)
        drawn = symbols(each, reach, girth, apart)
        wrong = "\n".join(violated.get(each.item, ()))
        if wrong:
            drawn = violation(each, drawn, float(np.median(reach)), apart)
        if drawn or wrong:
            letter = "a" if each.a >= 0 else "b"
            index = each.a if each.a >= 0 else each.b
            labels.append(_label(each.item.name, "joints", index, each.point(letter), wrong))
        parts += drawn
    contacts, count = _contact_points(packed, frames, constraints), len(packed.bodies)
    sizes, number = (
        [SYMBOL * float(np.median(reach))] * len(contacts),
        {id(each.item): each.contact for each in constraints},
    )
    marked = list(enumerate(zip(contacts, sizes, strict=True), count))
    parts += [contact_mark(i, 0.5 * size, number[id(item)]) for i, (item, size) in marked]
    rolling = [i for i, (item, _) in marked if number[id(item)] is None] if trails is None else []
    paths = [{"body": i, "point": [0.0, 0.0, 0.0]} for i in rolling]
    poses = np.stack([*np.moveaxis(frames.position, 1, 0), *contacts.values()], axis=1)
    turns = np.zeros((len(frames.times), count + len(contacts), 4))
    turns[:, :, 0], turns[:, :count] = 1.0, frames.orientation
    links = [link for link in parts if isinstance(link, Connector)]
    origin = frames.position[0].mean(axis=0)
    follow = None if follow is None else handles.bodies.index(handles.body(follow))
    seen = _camera(packed, frames, camera)
    return {
        "version": __version__,
        "title": repr(scene).strip("<>"),
        "time": [float(frames.times[0]), float(frames.times[-1])],
        "frames": len(frames.times),
        "bodies": [
            {"name": body.name, "rigid": body.dimension == 7, "hidden": i in hidden}
            for i, body in enumerate(packed.bodies)
        ]
        + [{"name": f"contact of {item.name}", "rigid": False, "hidden": True} for item in contacts],
        "reach": rounded([*reach, *sizes]),
        "bulk": rounded([*bulk, *sizes]),
        "labels": labels,
        "trails": _trails(trails, handles, hidden) + paths,
        "origin": origin.tolist(),
        "positions": encoded(poses - origin, "<f4"),
        "rotations": encoded(np.rint(FULL * np.roll(turns, -1, axis=2)), "<i2"),
        "parts": [part.data() for part in parts if isinstance(part, Part)],
        "links": [link.data() for link in links],
        "meshes": [{"vertices": encoded(m.vertices, "<f4"), "faces": encoded(m.faces, "<u4")} for m in meshes],
        "contacts": [],
        "tones": TONES,
        "said": None,
        **_loads([]),
        **seen,
        **_fit(packed, frames, bulk, links, origin, seen["up"], seen["eye"] is not None, follow),
    }


def _label(text, layer, body, point, violated=""):
    return {"text": violated or text, "layer": layer, "body": body, "point": rounded(point), "violated": bool(violated)}


def _trails(trails, handles, hidden):
    """Points whose trails are shown at first: those that are asked for, or centroids of some bodies along the list."""
    if trails is None:
        shown = [body for i, body in enumerate(handles.bodies) if i not in hidden] or handles.bodies
        some = np.linspace(len(shown) - 1, 0, TRAILS).astype(int)
        trails = [shown[i] for i in sorted({*some.tolist()})]
    found = []
    for each in sequence(
        trails, "view: trails must be a sequence of bodies, or of pairs (body, point)", InvalidArgument
    ):
        body, point = each if isinstance(each, tuple) and len(each) == 2 else (each, np.zeros(3))
        body = handles.body(body)
        point = vector3(point, f"view: trail of {body.name!r}: point (m)", InvalidArgument)
        found.append({"body": handles.bodies.index(body), "point": rounded(point)})
    return found


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
    return float(np.linalg.norm(a[0] - b[0]))


def _place(frames, index, point):
    """Where a point of a body is at the frames, (k, 3)."""
    return _turned(frames, index, point) + (0.0 if index < 0 else frames.position[:, index])


def _turned(frames, index, vector):
    """A vector of a body in the ground frame, (k, 3)."""
    vector = np.asarray(vector, float)
    return vector[None] if index < 0 else rotation_matrix(frames.orientation[:, index]) @ vector


def _loads(found):
    """Arrows, and the load, N or N m, that is their full scale."""
    scales = {unit: max((size(one) for one in found if one.unit == unit), default=0.0) for unit in UNITS}
    values = [np.rint(one.values * (FULL / scales[one.unit])) for one in found]
    listed = [one._asdict() | {"values": None, "point": rounded(one.point)} for one in found]
    return {"arrows": listed, "loads": encoded(np.array(values), "<i2"), "scales": scales}


# Rows of constraints that the start of a scene violates.

ALLOWED = 1e-9  # of residuals, relative to 1 + max |q| or max |qd|: the default `initial_tol` of simulate


def _violated(packed, t, q, qd):
    """(constraint, row with its value) for each row that is violated."""
    memory = packed.system.reals[packed.system.memory]
    rows = constraint_rows(packed, np.array([t]), q[None], qd[None], np.zeros((1, q.size)), memory=memory[None])
    (Phi,), (rate,), _ = rows
    for constraint, _, _, where in packed.members:
        for i, label in zip(range(where.start, where.stop), constraint.row_labels, strict=True):
            for what, value, x in (("Phi", Phi[i], q), ("dPhi/dt", rate[i], qd)):
                if not abs(value) <= ALLOWED * (1.0 + np.abs(x).max()):
                    yield constraint, f"{constraint.title}{label}: {what} = {value:.3g}"
                    break


# Camera: upwards is against gravity, along the nearest axis; a flat motion is seen from across it. It is fitted to all
# places of what moves, or, where that is much larger than the mechanism, to the mechanism, and goes with its centre of
# mass.

FLAT = 0.05  # a motion within a layer is looked at from across it: thickness per extent
MARGIN = 1.1  # of the picture, per radius of what is drawn: controls cover some of it
TRAVELS = 3.0  # extent of the motion per extent of the mechanism, from which the camera goes with it


def _camera(packed, frames, camera):
    """Directions upwards and to the camera; its place and what it looks at, where these are given."""
    gravity = packed.system.gravity
    up = np.eye(3)[2]
    if gravity.any():
        i = int(np.abs(gravity).argmax())
        up = -np.sign(gravity[i]) * np.eye(3)[i]
    found = {"up": up.tolist(), "view": _across(up, frames), "eye": None}
    if camera is None:
        return found
    given = floats(camera)
    ends = given if given.shape == (2, 3) else np.array([given, np.zeros(3)]) if given.shape == (3,) else None
    if ends is None or not np.isfinite(ends).all() or (ends[0] == ends[1]).all():
        raise InvalidArgument(
            "view: camera must be a direction (3,) from the mechanism to the camera, such as (1, -1, 0.5), or two "
            f"different points, of the camera and of what it looks at, (2, 3), m; got {camera!r}."
        )
    found["view"] = (ends[0] - ends[1]).tolist()
    return found | {"eye": ends.tolist() if given.shape == (2, 3) else None}


def _across(up, frames):
    """The direction to the camera by default."""
    level = [i for i in range(3) if not up[i]]
    extent = np.ptp(frames.position.reshape(-1, 3), axis=0)
    thin = [i for i in level if extent[i] < FLAT * extent.max()]
    first = thin[0] if len(thin) == 1 else level[-1]
    right = np.eye(3)[sum(level) - first]
    raised, aside = (
        (0.25, 0.35) if len(thin) == 1 else (1.5, 0.3) if extent @ np.abs(up) < FLAT * extent.max() else (0.5, 0.7)
    )
    return (np.cross(right, up) + aside * right + raised * up).tolist()


def _fit(packed, frames, bulk, links, origin, up, placed, follow):
    """Where the camera looks at each frame, or at all, and how far it sees, m; radius of the motion; a grid below.

    Places are from the origin. placed: whether the camera's place is given, so that it stays there.
    """
    ends = [np.array(point) for link in links for index, point in link.ends if index < 0]  # of rods and coils
    place = frames.position
    low, high = ((place + sign * bulk[:, None]).reshape(-1, 3) for sign in (-1.0, 1.0))
    low, high = np.min([low.min(axis=0), *ends], axis=0), np.max([high.max(axis=0), *ends], axis=0)
    mass = np.einsum("b,kbi->ki", packed.system.mass / packed.system.mass.sum(), place)

    def about(centre):
        reach = (np.linalg.norm(place - centre[:, None], axis=2) + bulk).max()
        return float(max([reach, *(np.linalg.norm(end - centre, axis=1).max() for end in ends)]))

    centre = 0.5 * (low + high)[None]
    if about(centre) > TRAVELS * about(mass) and any(body.dimension == 7 for body in packed.bodies):
        centre = mass
    radius = MARGIN * about(centre)
    lowest = min(np.dot(up, low), np.dot(up, high))
    level = 0.0 if 0.0 <= lowest < 2.0 * radius else lowest  # through the ground's origin, if that isn't far below
    return {
        "grid": {"step": _round_step(radius / 4.0), "level": float(level - np.dot(up, origin))},
        "centres": encoded(centre - origin, "<f4"),
        "radius": radius,
        "whole": 0.5 * float(np.linalg.norm(high - low)),
        "follow": follow if follow is not None else -2 if len(centre) > 1 and not placed else -1,
    }


def _round_step(length):
    """The largest of 1, 2 or 5 times a power of ten that is no longer."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(k for k in (1.0, 2.0, 5.0) if k == 1.0 or k * power <= length))


def _note(frames, solution):
    """What a viewer should know of the animation."""
    p = frames.orientation
    turned = np.abs(np.einsum("kbi,kbi->kb", p[1:], p[:-1])).min(initial=1.0)
    notes = [] if solution.success else [solution.message]
    notes += [solution._lacks] if getattr(solution, "_lacks", "") else []
    if 2.0 * np.arccos(min(1.0, turned)) > FAST:
        notes.append("Bodies turn far between frames; solution[a:b].view() shows a part of the run.")
    return " ".join(notes)


# States between outputs: the quintic with positions, velocities and accelerations of both.
#
# Where the acceleration jumps at the later output, which has that behind the jump, the quartic without it.


def quintic(t: Floats, levels: tuple[Floats, Floats, Floats], times: Floats) -> tuple[Floats, Floats, Floats]:
    """Positions, velocities and accelerations (k, n) at times (k,), from those (outputs, n) at outputs t."""
    q, qd, qdd = levels
    i, s, h = intervals(t, times)
    j, s, h = np.minimum(i + 1, t.size - 1), s[:, None], h[:, None]
    size = np.maximum(h * h * ranges(qdd), TINY)
    d, v, w, a, b = q[j] - q[i], h * qd[i], h * qd[j], h * h * qdd[i], h * h * qdd[j]
    quartic, cubic = 6.0 * (v + w) - 12.0 * d + a, 6.0 * d - 4.0 * v - 2.0 * w  # accelerations at j, and at i
    off, bend = ((np.abs(x) / size).max(axis=1, initial=0.0) for x in (b - quartic, a - cubic))
    b = np.where((off > JUMP + OTHERWISE * bend)[:, None], quartic, b)
    c3 = 10.0 * d - 6.0 * v - 4.0 * w - 1.5 * a + 0.5 * b
    c4 = -15.0 * d + 8.0 * v + 7.0 * w + 1.5 * a - b
    c5 = 6.0 * d - 3.0 * (v + w) - 0.5 * (a - b)
    rate = v + s * (a + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    second = a + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    with np.errstate(invalid="ignore", divide="ignore"):
        return (
            q[i] + s * (v + s * (0.5 * a + s * (c3 + s * (c4 + s * c5)))),
            np.where(h > 0.0, rate / h, qd[i]),
            np.where(h > 0.0, second / (h * h), qdd[i]),
        )


def intervals(t: Floats, times: Floats) -> tuple[Floats, Floats, Floats]:
    """For each time the output before it, and where it is in the interval from there, 0 to 1, of length h, s."""
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, max(t.size - 2, 0))
    h = t[np.minimum(i + 1, t.size - 1)] - t[i]
    s = np.divide(times - t[i], h, out=np.zeros_like(times), where=h > 0.0)
    return i, np.clip(s, 0.0, 1.0), h


def ranges(values: Floats) -> Floats:
    """The range (n,) of each column of values (outputs, n); of those that hardly change, a share of the largest."""
    found = np.ptp(values, axis=0)
    return np.maximum(found, SMALL_RANGE * found.max(initial=0.0))
