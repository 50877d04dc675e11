"""`scene.assemble`: nearest consistent positions in the assembly mode of the sketch, then velocities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..calls import fitting
from ..elements.bodies import named
from ..elements.force import Force
from ..errors import InconsistentState, InvalidArgument, InvalidBody
from ..jit.interrupts import CollectionsDeferred
from ..maths.dense_linalg import row_lengths
from ..maths.tolerances import LAST_PLACE, NEGLIGIBLE, TYPED
from ..model.handles import handles_of
from ..validation import floats, number, one_of, positive, sequence
from . import continuation
from .joint_space import Loops, coordinate_from
from .mobility import proved, refuse
from .motor_starts import approach, are_aligned, demand_aligned, demand_finite, has_motors, refuse_vanished
from .tolerances import CLEAR_FOLD, FLAT_FOLD, INITIAL_TOL, SHOWN, STAGES, STIFFER

if TYPE_CHECKING:
    from ..hints import ArrayLike, ItemLike, PointMass, Scene, Sequence


# Assembly modes of closed loops: the folds of the links in a sketch, which an assembly has to keep.
#
# At each joint j with an axis n in a loop of constraints, the links to its two neighbours enclose the signed angle
#
#     theta = arcsin( n.(u x v) / |u| |v| )      u, v: from j to the joints before and after
#
# measured from the dead centre. Mirrored assemblies differ in at least one sign. At a spherical joint, n is the axis of
# a neighbouring joint; a slide is a joint at infinity, across its direction. A sign of the sketch counts only where the
# directions of its links and the positions of its joints agree on it clearly.


class Fold(NamedTuple):
    """Two links of a loop that meet at a joint."""

    title: str
    bodies: tuple  # numbers of the bodies of u and v, the ground's is the last
    u: np.ndarray  # (3,), frame of its body
    v: np.ndarray
    axis: tuple  # body number, direction (3,)
    places: tuple  # the joints before, at and after: (body, point) of both sides; None for a slide
    rows: tuple  # of Phi, of the joints of its loop


class Folds:
    """The folds of a packed scene; made once."""

    def __init__(self, packed):
        self.folds = list(_folds(packed))

    def drawn(self, metric, q):
        """The signs (k,) that a sketch says: 1, -1, or 0 where it isn't clear."""
        if not self.folds:
            return np.zeros(0)
        links, places = self._angles(metric, q, False), self._angles(metric, q, True)
        clear = (np.abs(links) >= CLEAR_FOLD) & (np.abs(places) >= CLEAR_FOLD) & (links * places > 0.0)
        return np.where(clear, np.sign(links), 0.0)

    def shown(self, metric, q):
        """The signs (k,) that the links' directions say by themselves, 0 where they are nearly in line."""
        links = self._angles(metric, q, False)
        return np.where(np.abs(links) >= SHOWN, np.sign(links), 0.0)

    def turned(self, metric, q, drawn):
        """Numbers of the folds that a configuration has to the other side."""
        if not drawn.any():
            return np.zeros(0, int)
        return np.flatnonzero(self._angles(metric, q, False) * drawn < 0.0)

    def closed(self, metric, q, which):
        """Whether a loop of some folds is closed."""
        Phi, most = np.abs(metric.arrays(q)[0]), INITIAL_TOL * (1.0 + np.abs(q).max())
        return any(Phi[list(self.folds[k].rows)].max() <= most for k in which)

    def angle(self, metric, q, k):
        """Of one fold, rad."""
        return float(self._angles(metric, q, False)[k])

    def _angles(self, metric, q, by_places):
        R = metric.rotations(q)
        r = np.vstack((q[metric.r], np.zeros(3)))
        return np.array([_angle(fold, R, r, by_places) for fold in self.folds])


def _angle(fold, R, r, by_places):
    """From straight, rad, -pi/2 to pi/2."""
    a, b = fold.bodies
    n = R[fold.axis[0]] @ fold.axis[1]
    u, v = R[a] @ fold.u, R[b] @ fold.v
    if by_places:
        before, at, after = (None if sides is None else _joint_position(sides, R, r) for sides in fold.places)
        u, v = (u if before is None else before - at), (v if after is None else after - at)
    size = np.linalg.norm(u) * np.linalg.norm(v)
    return float(np.arcsin(np.clip(n @ np.cross(u, v) / size, -1.0, 1.0))) if size > 0.0 else 0.0


def _joint_position(sides, R, r):
    """Where a joint is: midway between its two sides."""
    return sum(r[body] + R[body] @ point for body, point in sides) / len(sides)


class _Edge(NamedTuple):
    """A constraint that holds a point of one body to a point, or a line, of another."""

    title: str
    ends: tuple  # body numbers
    points: dict  # body number -> point (3,)
    axis: dict  # body number -> the direction about which it turns, for a joint with one
    slide: dict  # body number -> the direction of a slide
    meets: bool  # whether its points coincide
    rows: slice


def _edges(packed):
    number = {id(body): i for i, body in enumerate(packed.bodies)}
    ground = len(packed.bodies)
    for member in packed.members:
        constraint = member.constraint
        if constraint.b is None:
            continue
        ends = tuple(number.get(id(body), ground) for body in (constraint.a, constraint.b))
        letters, points = dict(zip("ab", ends, strict=True)), {}
        for marker, place in zip(constraint.markers, member.coordinates, strict=True):
            if marker.prefix == "point_":
                points.setdefault(letters[marker.body], place)
        kinds = [type(part).__name__ for part in constraint.parts]
        held = "Spherical" in kinds
        if len(points) < 2 or not (held or "Distance" in kinds or kinds.count("Dot2") >= 2):
            continue
        pairs = getattr(constraint, "opposed", ())
        directions = [{number.get(id(body), ground): u for body, u in pair} for pair in pairs]
        axis = directions[0] if len(directions) == 1 else {}
        slide = directions[0] if len(directions) > 1 and not held else {}
        yield _Edge(constraint.title, ends, points, axis, slide, "Distance" not in kinds, member.rows)


def _loops(edges, count):
    """Loops of the graph of bodies, each a list of edges: one for each edge off a tree from the ground."""
    near = [[] for _ in range(count)]
    for i, edge in enumerate(edges):
        for k in (0, 1):
            near[edge.ends[k]].append((i, edge.ends[1 - k]))
    above, tree = {}, set()
    for root in (count - 1, *range(count - 1)):
        if root in above:
            continue
        above[root], queue = None, [root]
        for body in queue:
            for i, other in near[body]:
                if other not in above:
                    above[other] = (i, body)
                    tree.add(i)
                    queue.append(other)
    for i, edge in enumerate(edges):
        if i not in tree:
            yield from _loop(i, edge, above)


def _loop(i, edge, above):
    """The loop that an edge closes; none where it is beside another edge of the same two bodies."""
    paths = []
    for end in edge.ends:
        path, body = [], end
        while above[body] is not None:
            path.append((above[body][0], body))
            body = above[body][1]
        paths.append(path)
    while paths[0] and paths[1] and paths[0][-1] == paths[1][-1]:
        paths[0].pop(), paths[1].pop()
    if len(paths[0]) + len(paths[1]) < 2:
        return
    # from the first end up to where both paths meet, down to the second end, and back over the edge
    yield [j for j, _ in paths[0]] + [j for j, _ in reversed(paths[1])] + [i]


def _folds(packed):
    edges = list(_edges(packed))
    seen = set()
    for joints in _loops(edges, len(packed.bodies) + 1):
        ring = [edges[j] for j in joints]
        rows = tuple(i for edge in ring for i in range(edge.rows.start, edge.rows.stop))
        for k, edge in enumerate(ring):
            before, after = ring[k - 1], ring[(k + 1) % len(ring)]
            a, b = _shared(before, edge), _shared(edge, after)
            if not edge.meets or edge.slide or None in (a, b) or a == b:
                continue
            for axis in _axes(edge, before, after, a, b):
                u, v = _link(edge, before, a, axis), _link(edge, after, b, axis)
                key = (joints[k], *sorted((joints[k - 1], joints[(k + 1) % len(ring)])), axis[0])
                if u is None or v is None or key in seen:
                    continue
                seen.add(key)
                places = tuple(_sides(e, body) for e, body in ((before, a), (edge, None), (after, b)))
                yield Fold(edge.title, (a, b), u, v, axis, places, rows)


def _shared(one, other):
    """The body that two edges next to each other have in common."""
    common = set(one.ends) & set(other.ends)
    return common.pop() if len(common) == 1 else None


def _axes(edge, before, after, a, b):
    """About which axes links fold there: (body, direction)."""
    if edge.axis:
        return [(a, edge.axis[a])]
    return [(body, near.axis[body]) for near, body in ((before, a), (after, b)) if near.axis]


def _link(edge, near, body, axis):
    """From a joint to the one next to it, in the frame of the body between; None where there is none."""
    if near.slide:
        n = edge.axis.get(body)
        across = None if n is None else np.cross(n, near.slide[body])
        return across if across is not None and np.linalg.norm(across) > FLAT_FOLD else None
    link = near.points[body] - edge.points[body]
    return link if np.linalg.norm(link) > TYPED else None


def _sides(edge, body):
    """Where a joint is, by its two sides; a rod's end, by the body that it is on; None for a slide."""
    if edge.slide:
        return None
    if edge.meets:
        return tuple(edge.points.items())
    return ((body, edge.points[body]),)


# `scene.assemble`: nearest consistent positions, then nearest consistent velocities.


@dataclass(frozen=True)
class AssemblyReport:
    """Result of `scene.assemble`.

    Attributes
    ----------
    moved : float
        Largest change of a coordinate: m for positions, 1 for Euler parameters.
    residual : float
        Largest |Phi| left.
    velocity_changed : float
        Largest change of a velocity coordinate.
    velocity_residual : float
        Largest |Phi_q qd + Phi_t| left.
    iterations : int
    folded : tuple of str
        Joints of closed loops whose links are folded to the other side than in the sketch, by 0.1 rad or more: the
        sketch was ambiguous (see `folds` of `assemble`) or far from it, or `folds="free"` was given.
    released : tuple of str
        Joints that have other values than `joints` gave: their loops don't close with these.
    """

    moved: float
    residual: float
    velocity_changed: float
    velocity_residual: float
    iterations: int
    folded: tuple = ()
    released: tuple = ()


@fitting
@CollectionsDeferred()
def assemble(
    scene: Scene,
    tol: float = NEGLIGIBLE,
    fixed: Sequence[PointMass | str] = (),
    t: float = 0.0,
    folds: Folds = "keep",
    free: Sequence[PointMass | str] | None = None,
    joints: Mapping[ItemLike, ArrayLike] = MappingProxyType({}),
    loops: Sequence[ItemLike] = (),
) -> AssemblyReport:
    """Move the bodies to the nearest consistent positions, then to the nearest consistent velocities.

    Parameters
    ----------
    tol : float
        Largest |Phi| accepted at the end, relative to 1 + max |q|.
    fixed : sequence of Body, or names
        Bodies whose pose (not velocity) must stay as it is.
    t : float, s
        Time at which rheonomic constraints are satisfied.
    folds : "keep" or "free"
        "keep": links of closed loops fold as in the sketch wherever the sketch is unambiguous, that is by 0.2 rad or
        more, by the directions of the links and by the positions of their joints. "free": the nearest configuration
        on any branch. The report lists links that fold over.
    free : sequence of Body, or names; optional
        The bodies that may move, in place of `fixed`: the pose of all others stays as it is.
    joints : dict of joints, or names; optional
        Values of joints, rad and m: of the angles of each, then of its displacements. They are kept where the loops
        close with them. Where they don't, the joints start there, and the report lists those that move on.
    loops : sequence of joints, or names; optional
        Joints that close loops: in joint coordinates the scene is cut there. By default the joints that don't hold in
        the sketch, those with fewest rows first.

    Returns
    -------
    AssemblyReport
        `.moved`, `.residual` and more; the bodies hold the new values.

    Raises
    ------
    InconsistentState
        If no configuration is found; the error says whether a conflict is proved, and names the smallest set that it
        is proved of, or else the constraints that were left open, `.constraints`. Or if one is found only with a
        mirrored joint or on another branch than the sketch's. The bodies are unchanged.
    SingularConfiguration
        If a row of Phi_q vanishes at the configuration found.

    Notes
    -----
    A joint that stands far from the angle that its motor prescribes is taken there first: in a tree, the bodies beyond
    it move as one rigid body; in a loop it is driven in small steps, on the present branch.

    Springs hold the bodies at their poses in the sketch, in the metric of kinetic energy; the constraints are springs
    whose stiffness increases until they hold. Gauss-Newton steps follow. Redundant rows are allowed. For the positions
    a mass counts as 1e-8 of the largest at least, a moment of inertia also as 1e-6 of the body's mean. The velocity
    correction has the least kinetic energy, with masses as they are; above 200 coordinates with those of the positions.

    Where this leads nowhere, or to mirrored joints, the loops are closed in the coordinates of the joints of a spanning
    tree, by Levenberg and Marquardt: from the sketch, then from displacements of the joints in loops, the same ones in
    each call. Limits of joints in an imported file are hints of where. Folds of so distant a sketch are not kept, but
    reported.

    Examples
    --------
    A ball is moved to the end of its rod:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_point_mass(mass=1.0, position=(1.2, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(ball, scene.ground, length=1.0))
    >>> print(f"moved by {scene.assemble().moved:.2f} m to {ball.position.round(6) + 0.0}")
    moved by 0.20 m to [1. 0. 0.]
    """
    tol = positive(tol, "tol")
    if not np.isfinite(number(t)):
        raise InvalidArgument(f"t must be a finite time in s, got {t!r}.")
    one_of(folds, ("keep", "free"), "folds")
    numbers, t, driven = _fixed(scene, fixed, free), float(t), has_motors(scene)
    values, cut, sketch = _joint_values(scene, joints), _cut(scene, loops), scene.start

    def assembled(far=False):
        return assembled_nearby(scene, numbers, t, tol, folds, cut, far)

    try:
        if values:
            _set_out(scene, numbers, t, tol, values, cut)
        if driven:
            approach(scene, t, numbers, assembled)
        report = assembled(far=True)
    except BaseException:
        if not np.array_equal(scene.start[0], sketch[0]):
            scene.place(*sketch)
        raise
    released = _released(scene, values)
    return replace(report, moved=float(np.abs(scene.start[0] - sketch[0]).max()), released=released)


def _joint_values(scene, joints):
    """Values of joints, (count,) each, by joint."""
    if not isinstance(joints, Mapping):
        raise InvalidArgument(f"assemble: joints must be values by joint, such as {{'hip': 0.3}}, got {joints!r}.")
    found = {}
    for key, given in joints.items():
        handles = handles_of(scene.packed)
        joint, numbers = handles.item(key), np.atleast_1d(floats(given))
        row = next((row for row in handles.rows if row.item is joint), None)
        most = 0 if row is None else len(row.angles) + len(row.displacements)
        if not most or joint.drives or isinstance(joint, Force):
            raise InvalidArgument(f"assemble: {joint!r} has no joint coordinate to be given in joints.")
        if numbers.ndim != 1 or not 0 < numbers.size <= most or not np.isfinite(numbers).all():
            many = "a finite number" if most == 1 else f"up to {most} finite numbers, angles first"
            raise InvalidArgument(f"assemble: the value of {joint.name!r} in joints must be {many}, got {given!r}.")
        found[joint] = numbers
    return found


def _cut(scene, loops):
    """The joints that close loops."""
    given = sequence(loops, "assemble: loops must be a sequence of joints or names, such as (joint,)", InvalidArgument)
    found = [handles_of(scene.packed).item(it) for it in given]
    for joint in found:
        if not any(joint is member.constraint for member in scene.packed.members):
            raise InvalidArgument(f"assemble: {joint!r} in loops is no constraint of this scene.")
    return found


def _set_out(scene, fixed, t, tol, values, cut):
    """Place the scene with values of joints, its loops closed if they close; from these values on, if not with them."""
    (q, qd), limits = scene.start, _limits(scene)
    metric = continuation.Metric(scene.packed, _held(scene.packed, fixed) if fixed else None, t)
    demand_finite(scene, *metric.arrays(q))
    loops = Loops(metric, q, values, limits, cut)
    closed = loops.close(tol)
    if not closed.met:
        q = loops.set_out()
        closed = Loops(metric, q, limits=limits, cut=[*cut, *loops.cut]).close(tol)
    scene.place(closed.q if closed.met else q, qd)


def _released(scene, values):
    """Names of the joints that don't have the values given; of the others, turns are counted from these."""
    q, found = scene.start[0], []
    for joint, given in values.items():
        handles = handles_of(scene.packed)
        row = next(row for row in handles.rows if row.item is joint)
        away = [
            coordinate_from(handles, q, *pair) for pair in zip((*row.angles, *row.displacements), given, strict=False)
        ]
        if np.abs(away).max() > INITIAL_TOL:
            found.append(joint.name)
        elif given.size >= len(row.angles) > 0:
            joint.__dict__["angle_near"] = tuple(given[: len(row.angles)].tolist())
            scene.touch()
    return tuple(found)


def assembled_nearby(scene, fixed, t, tol=NEGLIGIBLE, folds="free", cut=(), far=False):
    """Assemble without a way to the angles of motors, from a near or a far sketch; return the `AssemblyReport`."""
    packed, (sketch, qd) = scene.packed, scene.start
    metric = continuation.Metric(packed, _held(packed, fixed) if fixed else None, t)
    whole = continuation.Metric(packed, None, t, rates=True)
    demand_finite(scene, *metric.arrays(sketch))
    found, near = _search(scene, metric, sketch, tol, fixed, cut, far)
    links = Folds(packed) if _largest_turn(metric, sketch, found.q) > SHOWN / 4.0 else None
    if near and links is not None and folds == "keep":
        found = _unfolded(metric, sketch, found, links, tol, cut if far else None)
    q = found.q
    Phi, Phi_q, Phi_t = whole.arrays(q)
    A = whole.reduced(q, Phi_q[whole.own])
    _demand_regular(scene, whole, A)
    demand_aligned(packed, q, t)
    given, qd = _velocities(whole, q, (sketch, qd), A, Phi_q, Phi_t[whole.own])
    residual = Phi_q @ qd + Phi_t
    _demand_compatible(scene, residual, max(tol, INITIAL_TOL) * (1.0 + np.abs(qd).max()))
    over = () if links is None else links.turned(metric, q, links.shown(metric, sketch))
    scene.place(q, qd)
    return AssemblyReport(
        moved=float(np.abs(q - sketch).max()),
        residual=float(np.abs(Phi).max(initial=0.0)),
        velocity_changed=float(np.abs(qd - given).max()),
        velocity_residual=float(np.abs(residual).max(initial=0.0)),
        iterations=found.iterations,
        folded=tuple(dict.fromkeys(links.folds[k].title for k in over)),
    )


def _fixed(scene, fixed, free):
    """Return the numbers of the bodies that are to be fixed."""
    if free is None:
        return _numbers(scene, fixed, "fixed")
    if len(sequence(fixed, "fixed must be a sequence of bodies", InvalidBody)):
        raise InvalidArgument("fixed and free say the same twice: give the bodies that stay, or those that may move.")
    moving = _numbers(scene, free, "free")
    return [i for i in range(len(scene.packed.bodies)) if i not in moving]


def _numbers(scene, given, word):
    """Return the numbers of bodies that are given by handle or name; names of a scene need no handles."""
    given, found = sequence(given, f"{word} must be a sequence of bodies, such as (body,)", InvalidBody), []
    for it in given:
        known = scene.packed.bodies if isinstance(it, str) else scene.bodies
        body = named(known, it, f"body to be {word}", InvalidBody) if isinstance(it, str) else it
        if not any(body is other for other in known):
            raise InvalidBody(f"{word}: {body!r} is not a body of this scene.")
        found.append(body.index)
    return found


def _held(packed, fixed):
    """Return True for each coordinate that is held, (n,)."""
    places = packed.system.bodies
    held = np.zeros(int(places[:, 1].sum()), bool)
    for at, length in places[fixed].tolist():
        held[at : at + length] = True
    return held


def _largest_turn(metric, sketch, q):
    """Return the largest rotation of a body between two configurations, rad."""
    return np.linalg.norm(continuation.rotation_vectors(sketch[metric.p], q[metric.p]), axis=1).max(initial=0.0)


def _unfolded(metric, sketch, found, links, tol, cut):
    """Return the configuration found, or a nearby one whose links fold as in the sketch.

    Where the joints of a tree hold in the sketch, folds of loops that are open there follow from coordinates of joints:
    as many are kept as can be. Others are drawn, and have to be kept.
    """
    drawn = links.drawn(metric, sketch)
    turned = links.turned(metric, found.q, drawn)
    kept, total, first = set(), found.iterations, turned
    for softness in STIFFER:
        if not turned.size:
            return found
        kept |= set(turned.tolist())
        pairs = np.array(list(dict.fromkeys(tuple(sorted(links.folds[k].bodies)) for k in sorted(kept))))
        q, steps = continuation.relax(metric, sketch, sketch, kept=continuation.Kept(pairs, softness), stages=STAGES)
        q, Phi, more = continuation.close(metric, q)
        total += steps + more
        met = bool(np.abs(Phi).max(initial=0.0) <= tol * (1.0 + np.abs(q).max()))
        turned = links.turned(metric, q, drawn)
        if not met:
            turned = first
        elif not turned.size:
            freed, Phi_freed, more = continuation.approach_sketch(metric, sketch, q)
            total += more
            fits = np.abs(Phi_freed).max() <= tol * (1.0 + np.abs(freed).max())
            if fits and not links.turned(metric, freed, drawn).size:
                q, Phi = freed, Phi_freed
            return continuation.ContinuationEnd(q, Phi, total, True)
    loops = None if cut is None else Loops(metric, sketch, cut=cut)
    if loops and loops.tree.holds(sketch) and not links.closed(metric, sketch, first):
        closed = loops.close(tol, lambda q: links.turned(metric, q, drawn).size)
        fewer = closed.met and links.turned(metric, closed.q, drawn).size < first.size
        return continuation.ContinuationEnd(closed.q, closed.Phi, total + closed.steps, True) if fewer else found
    stories = [
        f"  {links.folds[k].title}: {np.degrees(links.angle(metric, sketch, k)):.0f} degrees from straight in the "
        f"sketch, {np.degrees(links.angle(metric, found.q, k)):.0f} when assembled"
        for k in first[:8]
    ]
    raise InconsistentState(
        "the configurations found are on another branch than the sketch: links are folded to the other side:\n"
        + "\n".join(stories)
        + '\nDraw these links further from straight, or on the other side; or pass folds="free" to accept the '
        "nearest configuration on any branch."
    )


def _velocities(metric, q, sketch, A, Phi_q, Phi_t):
    """Return qd of the sketch (q, qd), its angular velocities at the orientations q, and the nearest consistent qd."""
    qd = sketch[1]
    x = metric.speeds(qd[metric.r], metric.spins(*sketch))
    given = qd.copy()
    given[metric.p] = metric.rates(q, x)[metric.p]
    exact = metric.is_bounded and not metric.sparse
    if exact:
        metric = continuation.Metric(metric.packed, None, metric.t, lengths=True, rates=True)
        A, x = metric.reduced(q, Phi_q[metric.own]), metric.speeds(qd[metric.r], metric.spins(*sketch))
    fitted = given
    for _ in range(3):
        residual = A @ x + Phi_t
        if np.abs(residual).max(initial=0.0) <= LAST_PLACE * (1.0 + np.abs(fitted).max()):
            break
        x = continuation.least_energy(metric, q, A, x, Phi_t) if exact else x + continuation.least_step(A, residual)
        fitted = metric.rates(q, x)
    return given, fitted


def _search(scene, metric, sketch, tol, fixed, cut, far):
    """Return what is found, and whether by continuation from the sketch; refuse what isn't assembled.

    A sketch outside the limits of its file is no drawing: joint coordinates come first.
    """
    limits, found, loops, closed, conflict = _limits(scene) if far else {}, None, None, None, None
    if limits and np.abs(metric.linear(sketch)[0]).max(initial=0.0) > tol * (1.0 + np.abs(sketch).max()):
        loops = Loops(metric, sketch, limits=limits, cut=cut)
        closed = loops.close(tol) if loops.beyond(sketch).any() else None
    if closed is None or not closed.met:
        found = continuation.nearest(metric, sketch, tol)
        if found.met and (are_aligned(metric.packed, found.q, metric.t) or not far):
            return found, True
        if not found.met:
            _demand_direction(scene, metric, found)
            conflict = proved(metric, sketch)
        if far and not conflict and closed is None:
            loops = loops or Loops(metric, sketch, limits=limits, cut=cut)
            closed = loops.close(tol)
    if closed and closed.met:
        start = continuation.ContinuationEnd(closed.q, closed.Phi, closed.steps, True)
        near = start if found is None else continuation.approached(metric, sketch, start, tol)
        return start if loops.beyond(near.q).any() else near, False
    if found.met:
        return found, True
    if closed and np.linalg.norm(closed.Phi) < np.linalg.norm(found.Phi):
        found = found._replace(q=closed.q, Phi=closed.Phi)
    refuse(scene, metric, found, conflict, closed.starts if closed else 1, [scene.bodies[i] for i in fixed])


def _limits(scene):
    """Limits of joints in the file of a scene, by joint: hints of where a loop closes."""
    named = scene.imported.limits if scene.imported else {}
    joints = (member.constraint for member in scene.packed.members) if named else ()
    return {joint: named[joint.name] for joint in joints if joint.name in named}


def _demand_direction(scene, metric, found):
    """Refuse a violated constraint whose derivative vanishes, so that the correction is undetermined.

    Joint coordinates know it where the constraint aligns directions.
    """
    still = continuation.stuck(metric, found.q, found.Phi)
    aligned = np.zeros(len(metric.packed.system.segments), bool)
    for member in metric.packed.members:
        aligned[member.rows] = bool(getattr(member.constraint, "opposed", ()))
    still = still[~aligned[metric.own[still]]]
    if still.size and metric.columns.size == metric.size:
        name = scene.row_names()[metric.own[still[0]]]
        raise InconsistentState(
            f"{name}: Phi = {found.Phi[still[0]]:.3g} and its derivative vanishes, so the direction of a correction is "
            "undetermined. Displace its bodies slightly towards the intended configuration."
        )


def _demand_regular(scene, metric, A):
    """Refuse zero rows."""
    zero = np.flatnonzero(row_lengths(A) == 0.0)
    if zero.size:
        refuse_vanished(scene.row_names()[metric.own[zero[0]]])


def _demand_compatible(scene, residual, tol):
    """Refuse redundant rows with different rates, by name."""
    bad = np.flatnonzero(~(np.abs(residual) <= tol))
    if bad.size:
        names = scene.row_names()
        rows = ", ".join(f"{names[i]} ({residual[i]:.3g})" for i in sorted(bad, key=lambda i: -abs(residual[i]))[:8])
        raise InconsistentState(
            f"no velocities satisfy all constraints in the configuration found; residuals of Phi_q qd + Phi_t: {rows}. "
            "Redundant driven rows must have equal rates: correct their motions, or remove one."
        )
