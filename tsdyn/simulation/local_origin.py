"""Scenes far from the origin: runs use a local origin among the bodies; the smallest attainable tolerances."""

import copy
from types import SimpleNamespace

import numpy as np

from ..elements.bodies import Ground
from ..elements.laws import LawKernels
from ..elements.loads import FunctionKernels
from ..elements.markers import POINT
from ..jit.code_hash import is_ours
from ..maths.tolerances import ROUNDING
from ..model.handles import classes
from ..model.packed import Derived, size_of
from ..observables.state import EventInstant
from ..rows.inertia_rows import levers
from ..runs.run_log import RunEnd
from .scene_cache import Prepared
from .tolerances import FAR_LEVER, FAR_ORIGIN

# Scenes far from the origin: runs use a local origin among the bodies; results are in the scene's coordinates.
#
# Constraints and forces depend on differences of positions, and a position of 1e6 m has no digits below 1e-10 m. If the
# jointed bodies and their ground points lie close together but far from the origin, positions are taken relative to a
# local origin. Its coordinates are multiples of a power of two, so the shift is exact.


def origin_of(packed, q):
    """Return the local origin (3,) for a run from positions q (n,); None for the origin of the scene."""
    of, origin = packed.derived.origin
    if of is not q:
        origin = _origin(packed, q)
        packed.derived.origin = q, origin
    return origin


def are_near(packed, q):
    """Which of many positions (k, n) are such that the scene's origin serves: `origin_of` is None."""
    grounded, longest = _grounded(packed)
    return are_within(packed, q, [corner[None] for corner in grounded], longest)


def are_within(packed, q, grounded, longest):
    """The same with other ground points, (k, 3) or (1, 3) each, and other longest levers (k,)."""
    near = np.abs(q).max(axis=1) <= FAR_ORIGIN * longest
    if near.all():
        return near
    low, high = _box(packed, q, ())
    for points in grounded:
        low, high = np.minimum(low, points), np.maximum(high, points)
    size = np.maximum((high - low).max(axis=-1), longest)
    return near | ~((size > 0.0) & (np.abs(0.5 * (low + high)).max(axis=-1) > FAR_ORIGIN * size))


def _grounded(packed):
    if packed.derived.grounded is None:
        packed.derived.grounded = _points(packed)
    return packed.derived.grounded


def _box(packed, q, grounded):
    """The corners of boxes around all bodies at q (..., n), and ground points."""
    places = q[..., packed.system.bodies[:, :1] + np.arange(3)]
    low, high = places.min(axis=-2), places.max(axis=-2)
    if len(grounded):
        low, high = np.minimum(low, grounded[0]), np.maximum(high, grounded[1])
    return low, high


def _origin(packed, q):
    grounded, longest = _grounded(packed)
    if np.maximum.reduce(np.abs(q)) <= FAR_ORIGIN * longest:
        return None
    low, high = _box(packed, q, grounded)
    size, centre = max(float((high - low).max()), longest), 0.5 * (low + high)
    if not (size > 0.0 and np.abs(centre).max() > FAR_ORIGIN * size and _sees_differences(packed)):
        return None
    step = 2.0 ** np.floor(np.log2(size))
    return np.round(centre / step) * step


def _points(packed):
    """Return the corners (2, 3) of a box around all ground points of items, and the longest lever on a body."""
    grounded, levers = [], [np.zeros(3)]
    pairs = [*zip(packed.constraints, packed.coordinates, strict=True)]
    pairs += [(load.force, load.coordinates) for load in packed.loads]
    for item, coordinates in pairs:
        for marker, s in zip(item.markers, coordinates, strict=True):
            if marker.code == POINT and isinstance(item.body_of(marker), Ground):
                grounded.append(s)
            elif marker.code == POINT:
                levers.append(s)
    grounded, longest = np.array(grounded).reshape(-1, 3), float(np.abs(levers).max())
    return np.array([grounded.min(axis=0), grounded.max(axis=0)]) if len(grounded) else grounded, longest


def _sees_differences(packed):
    """Return True if there are constraints or forces, and none that may depend on absolute positions."""
    items = [*packed.constraints, *(load.force for load in packed.loads)]
    joined = packed.loads or not all(constraint.normalises for constraint in packed.constraints)
    own = joined and not packed.inertias and all(is_ours(type(item).__module__) for item in items)
    return own and not any(isinstance(load.force.kernels, (FunctionKernels, LawKernels)) for load in packed.loads)


def run_near(driver, task, scene, origin, tol):
    """Return the `Outcome` of a task run relative to a local origin; tol as for `Prepared.start`."""
    packed = task.prepared.packed
    local = _local(task.prepared, scene, origin, task.remembered[len(task.angles) :])
    shift = np.zeros(task.q.size)
    shift[packed.system.bodies[:, :1] + np.arange(3)] = origin
    q = task.q - shift
    tol *= (1.0 + np.abs(task.q).max()) / (1.0 + np.abs(q).max())
    stand_in = SimpleNamespace(
        packed=local.packed, system=local.packed.system, bodies=scene.bodies, constraints=scene.constraints,
        row_names=scene.row_names,
    )  # fmt: skip
    q, qd = local.start(stand_in, (q, task.qd), task.span[0], tol, task.remembered, True)
    if task.archive is not None:
        task.archive.shift = shift
    watched = task.events and [each._replace(function=_away(each.function, packed, shift)) for each in task.events]
    outcome = driver(task._replace(prepared=local, q=q, qd=qd, events=watched, resume=None))
    rows, end, events = outcome.rows, outcome.end, outcome.events
    last = end.last.copy()
    if task.archive is None:
        rows = rows.copy()
        rows[:, 1 : 1 + shift.size] += shift
    last[0] += shift
    if events is not None:
        times, positions, *rest = events
        events = times, [each + shift for each in positions], *rest
    trajectory = outcome.trajectory and _Moved(outcome.trajectory, shift)
    end = RunEnd(end.reached, last, end.remembered, end.counts, end.steps, end.charts)
    return outcome._replace(rows=rows, end=end, events=events, trajectory=trajectory)


def _local(prepared, scene, origin, slots):
    """Return the `Prepared` of the scene relative to that origin; kept for the next run. slots: as of `_moved`."""
    packed = prepared.packed
    kept = packed.derived.local
    if kept is None or (kept[0] != origin).any() or (kept[1] != slots[kept[2]]).any():
        moved, held = _moved(packed, origin, slots)
        kept = packed.derived.local = origin, slots[held], held, Prepared(scene, moved)
    return kept[-1]


def _moved(packed, origin, slots):
    """The packed scene with the points of the ground relative to an origin; which of the slots were among these points.

    slots: what is remembered, in the scene's own coordinates, as it is in the moved scene, too: of numbers of points
    the run remembers copies that nothing reads.
    """
    reals, known, places = packed.system.reals.copy(), packed.derived, []

    def move(item, coordinates, begin):
        found = []
        for j, (marker, s) in enumerate(zip(item.markers, coordinates, strict=True)):
            if marker.code == POINT and isinstance(item.body_of(marker), Ground):
                s = s - origin
                place = slice(begin + 3 * j, begin + 3 * j + 3)
                reals[place] = s
                places.append(place)
            found.append(s)
        return tuple(found)

    coordinates, kinds = {}, zip(classes(packed), packed.system.kinds, strict=True)
    for kind, row in kinds:
        members = [i for i, constraint in enumerate(packed.constraints) if type(constraint) is kind]
        for at, i in enumerate(members):
            begin = row.reals + at * row.stride
            coordinates[i] = move(packed.constraints[i], packed.coordinates[i], begin)
    coordinates = tuple(coordinates[i] for i in range(len(packed.constraints)))
    loads = tuple(
        load._replace(coordinates=move(load.force, load.coordinates, load.alone[0].reals)) for load in packed.loads
    )
    memory, by = packed.system.memory.copy(), np.zeros(reals.size)
    for place in places:
        by[place] = origin
    held = np.flatnonzero(by[memory])
    reals[memory[held]] = slots[held] - by[memory[held]]
    memory[held] = reals.size + np.arange(held.size)
    moved = packed._replace(
        system=packed.system._replace(reals=np.append(reals, slots[held]), memory=memory),
        coordinates=coordinates,
        size=size_of(packed.constraints, coordinates),
        loads=loads,
        derived=Derived() if known.switched is None else Derived(known.redundant, known.switched),
    )
    return moved, held


def _away(function, packed, shift):
    """Return an event function that receives positions in the scene's coordinates."""

    def moved(t, instant):
        begin, state, angles = instant._beside
        states = [np.array(state), np.array([instant.q, instant.qd, instant.qdd])]
        for each in states:
            each[0] += shift
        return function(t, EventInstant(packed, instant.memory, (begin, states[0], angles), t, states[1]))

    return moved


class _Moved:
    """A `dense_output.Trajectory` in the scene's coordinates."""

    def __init__(self, trajectory, shift):
        self.trajectory, self.shift = trajectory, shift

    def __getattr__(self, name):
        return getattr(self.trajectory, name)

    def __call__(self, t):
        """Evaluate as a `Trajectory` does."""
        states, memory, status = self.trajectory(t)
        states[:, 0] += self.shift
        return states, memory, status


# The smallest attainable tolerances: cancellation in positions far from the origin bounds the error estimate.

NOISE = 4.0 * ROUNDING  # direction error of a placement: rounding of a position over the lever


def within_rounding(method, packed, q):
    """Return the method with attainable tolerances, and a sentence if they were raised.

    The Taylor method accounts for the rounding of its projection itself.
    """
    if method.step is not None or method.driver != "steps":
        return method, ""
    if packed.derived.near is q:
        return method, ""
    arms = levers(packed)
    if np.abs(q).max() < FAR_LEVER * arms.min(where=arms > 0.0, initial=np.inf):
        packed.derived.near = q
        return method, ""
    far = np.abs(q[packed.system.bodies[:, :1] + np.arange(3)]).max(axis=1)
    # Rounding of positions turns a body of mass m, moment of inertia J and lever s by m s / (m s^2 + J): 1 / s or less
    least = np.linalg.eigvalsh(packed.system.inertia.reshape(-1, 3, 3))[:, 0].clip(0.0)
    arms = np.where(arms > 0.0, np.maximum(arms, np.sqrt(least / packed.system.mass)), 0.0)
    ratios = np.where(arms > 0.0, far / np.where(arms > 0.0, arms, 1.0), 0.0)
    worst = int(np.argmax(ratios))
    noise = NOISE * ratios[worst]
    if ratios[worst] < FAR_LEVER or min(method.step_tolerances()) >= noise:
        return method, ""
    other = copy.copy(method)
    for i, name in enumerate(("rtol", "atol")):
        while other.step_tolerances()[i] < noise:
            setattr(other, name, 2.0 * getattr(other, name))
    body = packed.bodies[worst].name
    return other, (
        f"The tolerances were raised to rtol={other.rtol:.1e} and atol={other.atol:.1e}: {body} is "
        f"{far[worst]:.3g} m from the origin, where on a lever of {arms[worst]:.3g} m no more digits are left."
    )
