"""Laws that hold of every run, whatever its scene: no reference solution is needed."""

from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ..configuration.tolerances import DENSE
from ..constraints import RollingDisc, Rope, Stop
from ..elements.bodies import rotation_matrix, turning
from ..elements.force import Force
from ..elements.markers import POINT
from ..maths.tolerances import EPS, HALF_DIGITS, NEGLIGIBLE, ROUNDING_AT_MOST, SUM_ROUNDING
from ..model.equations import WIDTH, places, with_short_rows
from ..model.handles import index_of
from ..model.packed import member_of
from ..observables.diagnostics import constraint_rows
from ..observables.evaluate import constraint_arrays, mass_matrix
from ..observables.reactions import touching
from ..simulation.load import load, resume
from ..simulation.prepared_run import Run, simulate
from ..simulation.run_options import OF_CALL, OF_RUN, RunOptions
from . import tolerances as limits

# What laws find, and sizes of scenes that they refer to.


class Finding(NamedTuple):
    """What a law found."""

    law: str
    size: float
    limit: float
    where: str = ""

    @property
    def broken(self):
        """True if the size exceeds the limit, or is no number."""
        return not self.size <= self.limit

    def __str__(self):
        where = f" ({self.where})" if self.where else ""
        return f"{self.law}: {self.size:.2e}, at most {self.limit:.2e}{where}"


def some(count, most):
    """Return indices of the first, the last, and some between, `most` at most."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))


def extent(solution):
    """Size of a scene, m: distances of the bodies from their middle at the start, and their radii of gyration."""
    bodies = solution.scene.bodies
    places = np.array([solution.position(body)[0] for body in bodies])
    radii = [radius_of_gyration(body) for body in bodies]
    return float(np.linalg.norm(places - places.mean(axis=0), axis=1).max() + max(radii, default=0.0))


def radius_of_gyration(body):
    """About an axis of mean inertia, times the square root of 3, m; zero of a point mass."""
    return np.sqrt(np.trace(np.asarray(body.inertia)) / body.mass) if body.dimension == 7 else 0.0


# A run that is stopped at a checkpoint and goes on from there; a solution that is saved and loaded.

SELDOM, OFTEN = 1e9, 1e-9  # s between checkpoints: the first, after a slice, is the only one; every slice and phase


class _Stop:
    """Ctrl-C as soon as there is a checkpoint: after the first slice, or a later one where the first ends a segment.

    after: the fraction of the run before which there is none.
    """

    def __init__(self, path, after):
        self.checkpoint, self.after = Path(f"{path}.checkpoint"), after

    def __call__(self, fraction):
        if (fraction or 0.0) >= self.after and self.checkpoint.exists():
            raise KeyboardInterrupt


def resumed_is_same(scene, span, solution, after=0.0, **options):
    """Whether such a run has the bits of `solution`, which was never stopped; None without h5py."""
    if find_spec("h5py") is None:
        return None
    with TemporaryDirectory() as folder:
        path, every = f"{folder}/run.h5", OFTEN if after else SELDOM
        simulate(scene, span, progress=_Stop(path, after), store=path, checkpoint=every, **options)
        return same_bits(solution, resume(path, scene=scene, events=options.get("events")))


def saved_is_same(solution):
    """Whether a solution with dense output has the same bits when it is saved and loaded; None without h5py."""
    if find_spec("h5py") is None:
        return None
    with TemporaryDirectory() as folder:
        solution.save(path := f"{folder}/run.h5")
        loaded, times = load(path), np.linspace(*solution.t[[0, -1]], limits.OUTPUTS)
        return same_bits(solution, loaded) and same_bits(solution.at(times), loaded.at(times))


def prepared_twice(scene, span, **options):
    """As `simulate`, by the second run of a prepared one."""
    prepared = Run(scene, RunOptions(**{name: value for name, value in options.items() if name in OF_RUN}))
    of_call = {name: value for name, value in options.items() if name in OF_CALL}
    prepared(span, **of_call)
    return prepared(span, **of_call)


def same_bits(one, two):
    """Whether two solutions, or states, have the same numbers, phases and impulses to the bit."""
    pairs = [(getattr(one, name), getattr(two, name)) for name in ("t", "q", "qd", "qdd")]
    events = [getattr(each, "phases", None) for each in (one, two)]
    struck = [_numbers(getattr(each, "impulses", ())) for each in (one, two)]
    return all(np.array_equal(*pair) for pair in pairs) and events[0] == events[1] and struck[0] == struck[1]


def _numbers(impulses):
    """Times, names and numbers of impulses, of contacts and of rows that have become active."""
    return [(t, name, np.ravel(p).tolist(), np.ravel(getattr(p, "tangential", ())).tolist()) for t, name, p in impulses]


# The law of motors: joints follow the motions that are prescribed, which rows of sines know modulo turns alone.


def motors(solution):
    """The angle of a motor, and of the joint that it drives, is the one prescribed, turns included."""
    handles, at = solution.handles, some(solution.t.size, limits.OUTPUTS)
    driven = [(one.motor.item, one.joint.item, one.place - one.joint.first) for one in handles.driven]
    driven += [(row.item, row.item, 0) for row in handles.rows]
    for motor, item, i in driven if solution.success else ():
        if motor.drives == "angle":
            angle = solution.angle(item)[at].reshape(len(at), -1)[:, i]
            wanted = np.array([motor.angle.value(t)[0] for t in solution.t[at]])
            size = float((np.abs(angle - wanted) / (1.0 + np.abs(wanted))).max())
            yield Finding("angles of motors", size, limits.ROW_SHARE, item.title)


# Laws that hold of every run, whatever its scene: no reference solution is needed.
#
# Each law takes a `Solution` and yields what it found as `Finding`s: a size, and the limit that it must not exceed.
# LAWS lists those of a single run; judgement.py compares runs.

LEVELS = ("position", "velocity", "acceleration")


def finite(solution):
    """No number of a run is infinite or NaN, but for multipliers of redundant rows."""
    arrays = {name: getattr(solution, name) for name in ("t", "q", "qd", "qdd")}
    if solution.success:
        arrays["energy"] = solution.energy
        lam = solution.multipliers
        arrays["multipliers"] = np.where(np.isnan(lam).all(axis=0), 0.0, lam) if len(lam) else lam
    for name, array in arrays.items():
        bad = ~np.isfinite(array)
        if name == "multipliers":
            bad &= ~np.isnan(array)  # which rows are redundant may change
        if bad.any():
            yield Finding("finite numbers", float(bad.sum()), 0.0, name)


def constraints(solution):
    """Phi and its two time derivatives vanish, relative to the sum of the absolute terms of each row.

    The terms of a row are Phi_q q, Phi_q qd and Phi_q qdd, coordinate by coordinate, and centripetal accelerations; its
    error is recomputed without Phi_q and gamma.
    """
    if not solution.success:  # its message says what broke
        return
    at = some(solution.t.size, limits.OUTPUTS)
    arrays = [array[at] for array in (solution.t, solution.q, solution.qd, solution.qdd, solution._memory)]
    floors, limit = NEGLIGIBLE / limits.ROW_SHARE * _scales(solution), limits.ROW_SHARE + rounding_of_places(solution)
    parts = [(solution.packed, arrays)]
    phases = solution._phases
    if phases is not None:  # the rows that hold
        parts = [(phases.packed[i], x) for i, _, x in phases._gathered(solution._phase_of_rows[at], arrays)]
    for packed, (t, *states, memory) in parts:
        terms = np.array([row_terms(packed, *state, floors) for state in zip(t, *states, strict=True)])
        if not terms.size:
            continue
        errors = constraint_rows(packed, t, *states, memory=memory)
        for level, error, sums in zip(LEVELS, errors, terms.swapaxes(0, 1), strict=True):
            share = np.abs(error) / np.where(sums > 0.0, sums, 1.0)
            worst = np.unravel_index(share.argmax(), share.shape)
            where = f"t = {t[worst[0]]:.9g} s, {_row_name(packed, worst[1])}"
            yield Finding(f"constraints, {level}", float(share[worst]), limit, where)


def _scales(solution):
    """Sizes of positions and of Euler parameters, of their rates and accelerations, in a run: (3, n).

    What is at rest has the rates that gravity would give it within the run: those that remain are rounding of these.
    """
    starts, lengths = solution.system.bodies.T
    r = (starts[:, None] + np.arange(3)).ravel()
    p = (starts[lengths == 7, None] + np.arange(3, 7)).ravel()
    T, size = np.ptp(solution.t), extent(solution) or 1.0
    fall = float(np.linalg.norm(solution.scene.gravity))
    scales = np.zeros((3, solution.q.shape[1]))
    for kind, gain in ((r, fall), (p, fall / size)):
        q, qd, qdd = (np.abs(x[:, kind]).max(initial=0.0) for x in (solution.q, solution.qd, solution.qdd))
        scales[:, kind] = np.array([[q], [qd + (qdd + gain) * T], [qdd + gain]])
    return scales


def row_terms(packed, t, q, qd, qdd, floors=0.0):
    """Sums of the absolute terms of Phi_q q, Phi_q qd and Phi_q qdd of each row, (3, m); floors (3, n) are added."""
    rows = np.abs(constraint_arrays(with_short_rows(packed), q, qd, t, WIDTH)[1])
    at, length = places(packed)
    half = np.arange(WIDTH // 2)
    index = np.where(half < length[:, :, None], at[:, :, None] + half, 0).reshape(len(at), WIDTH)
    rows *= (half < length[:, :, None]).reshape(len(at), WIDTH)
    rigid = packed.system.bodies[packed.system.bodies[:, 1] == 7, :1]
    rate = np.abs(qd[rigid + np.arange(3, 7)]).max(initial=0.0)
    levels = np.array((np.abs(q), np.abs(qd), np.abs(qdd) + rate * np.abs(qd))) + floors
    terms = np.array([(rows * x[index]).sum(axis=1) for x in levels])
    m = len(packed.system.segments)
    np.add.at(terms, (slice(None), packed.system.tails), terms[:, m:])  # of sums
    return terms[:, :m]


def _row_name(packed, row):
    for constraint in packed.constraints:
        if row < constraint.all_rows:
            return f"row {row + 1} of {constraint.name}" if constraint.all_rows > 1 else constraint.name
        row -= constraint.all_rows
    return ""


def newton_euler(solution):
    """Rates of linear and angular momentum of every body are its weight and the loads of all its neighbours.

    What rounding of positions changes is not judged: loads of hard springs between distant points.
    """
    bodies = solution.scene.bodies
    if not solution.success or not bodies:
        return
    around, picked = _neighbours(solution.scene), [bodies[i] for i in some(len(bodies), limits.BODIES)]
    found = _balances(solution, picked, around)
    if any(one.broken for one in found):
        shaken = _shaken(solution)
        found = _balances(solution, picked, around, [_loads(shaken, body, around[id(body)]) for body in picked])
    yield from found


def _balances(solution, bodies, around, shaken=None):
    sums = [_loads(solution, body, around[id(body)]) for body in bodies]
    largest, limit, found = max(one.size_of_force.max() for one in sums), _balance_limit(solution), []
    left, rate = _left_by_iteration(solution)
    for one, other in zip(sums, shaken or sums, strict=True):
        allowed = np.linalg.norm(one.force - other.force, axis=1).max() + one.body.mass * left
        found.append(_balance("force balance", one.force, allowed, one.size_of_force, largest, limit, one.body))
        if one.body.dimension == 7:
            floor = max(one.size_of_torque.max(), largest * extent(solution))
            allowed = np.linalg.norm(one.torque - other.torque, axis=1).max() + np.trace(one.body.inertia) * rate
            found.append(_balance("torque balance", one.torque, allowed, one.size_of_torque, floor, limit, one.body))
    return found


def _left_by_iteration(solution):
    """What implicit methods may leave of accelerations (k,), m/s^2 and rad/s^2: the tolerance of a step's rates."""
    method, h = solution._method, np.diff(solution.t, prepend=solution.t[0])
    if not solution.stats.iteration_matrices or method.atol is None:
        return np.zeros((2, h.size))
    turns = turning(solution.system.bodies, solution.qd.shape[1])
    largest = np.array([[np.abs(solution.qd[:, kind]).max(initial=0.0)] for kind in (~turns, turns)])
    return [[1.0], [2.0]] * (method.atol + method.rtol * largest) / np.where(h > 0.0, h, np.inf)


def _shaken(solution):
    """A copy of a solution, whose positions are off by one rounding of the largest.

    Velocities are off by ten tolerances, as the error of a run may be, where contacts slide: the direction of the
    friction of slower slips is not determined.
    """
    other, method = solution._picked(slice(None)), solution._method  # without what is derived
    signs = np.random.default_rng(0).choice((-1.0, 1.0), solution.q.shape)
    other.q = solution.q + EPS * np.abs(solution.q).max() * signs
    if method.atol is not None and any(getattr(part, "has_friction", False) for part in solution.scene.constraints):
        off = method.atol + method.rtol * np.abs(solution.qd).max()
        other.qd = solution.qd + 10.0 * off * signs
    return other


class BodyBalance(NamedTuple):
    """What acts on a body less the rate of its momentum, ground frame, and sums of absolute values."""

    body: object
    force: np.ndarray  # (k, 3), N
    torque: np.ndarray  # (k, 3), N m, about the centroid
    size_of_force: np.ndarray  # (k,)
    size_of_torque: np.ndarray  # (k,)


def _loads(solution, body, items):
    weight, push = body.mass * np.asarray(solution.scene.gravity), body.mass * solution.acceleration(body)
    force, size = weight - push, np.linalg.norm(weight) + np.linalg.norm(push, axis=1)
    torque, turning = np.zeros_like(force), np.zeros(len(force))
    if body.dimension == 7:
        A, omega = rotation_matrix(solution.orientation(body)), solution.angular_velocity(body)
        J = np.asarray(body.inertia)
        gain, momentum = solution.angular_acceleration(body) @ J, omega @ J
        torque = -np.einsum("kij,kj->ki", A, gain + np.cross(omega, momentum))
        turning = np.linalg.norm(gain, axis=1) + np.linalg.norm(omega, axis=1) * np.linalg.norm(momentum, axis=1)
    for item in items:
        load, moment = solution.reaction(item, on=body)
        arm = _arm(solution, item, body)
        amount = np.linalg.norm(load, axis=1)
        force, size = force + load, size + amount
        torque = torque + moment + np.cross(arm, load)
        turning = turning + np.linalg.norm(moment, axis=1) + np.linalg.norm(arm, axis=1) * amount
    return BodyBalance(body, force, torque, size, turning)


def _neighbours(scene):
    """Constraints and forces of each body, by its id."""
    around = {id(body): [] for body in scene.bodies}
    for item in (*scene.constraints, *scene.forces):
        for body in {id(body): body for body in bodies_of(item)}.values():
            around.get(id(body), []).append(item)
    return around


def bodies_of(item):
    """The bodies of a constraint or force, the ground among them."""
    return item.bodies if isinstance(item, Force) else [body for part in item.parts for body in (part.a, part.b)]


def rounding_of_places(solution):
    """Rounding of positions, relative to the distance of neighbours: large far from the origin."""
    bodies = solution.scene.bodies
    if not bodies:
        return 0.0
    places = np.array([solution.position(body)[0] for body in bodies])
    radii = np.array([radius_of_gyration(body) for body in bodies])
    nearest = cKDTree(places).query(places, k=[min(2, len(bodies))])[0][:, 0]
    return limits.ROUNDINGS * EPS * float(_farthest(solution) / (np.median(np.maximum(nearest, radii)) or 1.0))


def _farthest(solution):
    """The largest coordinate of a body's position, m."""
    return max((np.abs(solution.position(body)).max() for body in solution.scene.bodies), default=0.0)


def _balance_limit(solution):
    """Share of the terms of a balance that may be left."""
    return HALF_DIGITS * (limits.NEAR_SINGULAR if is_near_singular(solution) else 1.0) + rounding_of_places(solution)


def _balance(law, left, allowed, sizes, largest, limit, body):
    """Relative to the body's own terms; what is rounding of the largest terms in the scene doesn't count."""
    left = np.maximum(np.linalg.norm(left, axis=1) - allowed, 0.0)
    share = left / (sizes + (NEGLIGIBLE / HALF_DIGITS * largest or 1.0))
    return Finding(law, float(share.max(initial=0.0)), limit, body.name)


def _arm(solution, item, body):
    """Where the torque of an item is about: its contact point, or its first point on a body; from the centroid, (k, 3).

    In the ground frame.
    """
    letter, found = "a" if body is item.a else "b", member_of(solution.packed, item)
    if body.dimension != 7:
        return np.zeros((solution.t.size, 3))
    contact = None if found is None else touching(solution.packed, found, solution.q)
    if contact is not None:
        return contact[0] - solution.position(body)
    pairs = zip(item.markers, item.coordinates, strict=True)
    points = [s for marker, s in pairs if marker.body == letter and marker.code == POINT]
    return solution.rotation(body) @ (points[0] if points else np.zeros(3))


def dense_output(solution):
    """Dense output at the outputs of a run gives the outputs, to what the rows there do to rounding."""
    if solution._trajectory is None or not solution.success:
        return
    once = np.flatnonzero(np.append(np.diff(solution.t) > 0.0, True))  # at an event the later side
    at = once[some(once.size, limits.OUTPUTS)]
    state = solution.at(solution.t[at])
    limit = off_steps(solution)
    amplified = np.minimum(limits.ROUNDED_ROWS * EPS / weakest_rows(solution, at) ** 2, limits.NEAR_SINGULAR_ENDS)
    rounding = ROUNDING_AT_MOST * EPS * np.abs(solution.t).max()  # of an instant
    for name, rate in (("q", "qd"), ("qd", "qdd")):
        given, change = getattr(solution, name)[at], rounding * np.abs(getattr(solution, rate)[at])
        size = 1.0 + np.abs(given).max(initial=0.0)
        off = (np.abs(getattr(state, name) - given) - change).max(axis=1, initial=0.0) / size - amplified
        yield Finding(f"dense output, {name}", float(off.max(initial=0.0)), limit)


def weakest_rows(solution, at):
    """Smallest singular value of independent unit rows at outputs, (k,); 1 in large scenes."""
    scene, found = solution.scene, np.ones(len(at))
    if not 0 < solution.q.shape[1] <= DENSE:
        return found
    for i, k in enumerate(at):
        rows = constraint_arrays(scene.system, solution.q[k], solution.qd[k], solution.t[k])[1]
        if len(rows):
            sizes = np.linalg.norm(rows, axis=1)
            values = np.linalg.svd(rows / np.where(sizes > 0.0, sizes, 1.0)[:, None], compute_uv=False)
            found[i] = values[values > NEGLIGIBLE].min(initial=1.0)
    return found


def off_steps(solution):
    """How far dense output may be off the ends of steps, relative to the coordinates."""
    near = SUM_ROUNDING * _farthest(solution) / (extent(solution) or 1.0)
    return limits.ROUNDED * (limits.NEAR_SINGULAR if is_near_singular(solution) else 1.0) + near


def is_near_singular(solution):
    """Whether a run passes, or begins at, a singular configuration."""
    condition = solution.charts.condition
    return solution.stats.steps_near_singular > 0 or not np.nanmax(condition, initial=0.0) < limits.ILL_CONDITIONED


# Contacts, stops and ropes: what holds between events, and across them.


def unilateral(solution):
    """No contact penetrates or pulls, and an open one has no reaction: at outputs and between them."""
    if solution._phases is None or solution._trajectory is None:
        return
    lam = solution.multipliers
    times = np.unique(
        np.append(solution.t[some(solution.t.size, limits.OUTPUTS)], np.linspace(*solution.t[[0, -1]], limits.OUTPUTS))
    )
    states, size = solution.at(times), _size(solution)
    loads = (body.mass * np.linalg.norm(solution.acceleration(body), axis=1) for body in solution.scene.bodies)
    largest = max(np.abs(lam).max(initial=0.0), *(load.max(initial=0.0) for load in loads)) or 1.0
    for contact, rows in _contacts(solution.packed):
        limit = limits.PENETRATED * (1.0 if _is_angle(contact) else size)
        push = np.stack([-side.sign * lam[:, row] for side, row in zip(contact.sides, rows, strict=True)])
        is_open = _gap(contact, solution) > limit
        yield Finding("penetration", float(-_gap(contact, states).min()), limit, contact.name)
        yield Finding("reactions that pull", float(-push.min() / largest), HALF_DIGITS, contact.name)
        yield Finding("reactions of open contacts", float(np.abs(push[:, is_open]).max(initial=0.0)), 0.0, contact.name)


def phases(solution):
    """Phases follow each other: each begins where the one before it ends, and ends no sooner."""
    if solution._phases is not None:
        begin, end = np.array([each[:2] for each in solution.phases]).T
        off = np.abs(begin[1:] - end[:-1]).max(initial=0.0), (begin - end).max(initial=0.0)
        yield Finding("phases in a row", float(max(off)), 0.0)


def rubbing(solution):
    """Friction is within its cone where a contact sticks, and on it, against the slip, where it slides."""
    contacts = [] if solution._phases is None else [each for each in _contacts(solution.packed) if _slips(*each)]
    if not contacts:
        return
    lam, fastest = solution.multipliers, np.abs(solution.qd).max(axis=0)
    at, largest = some(solution.t.size, limits.OUTPUTS), np.abs(lam).max(initial=0.0) or 1.0
    slopes = [constraint_arrays(solution.packed.system, solution.q[i], solution.qd[i], solution.t[i])[1] for i in at]
    for contact, own in contacts:
        rows, bound = _slips(contact, own), contact.kinetic if contact.static is None else contact.static
        N, T = -contact.sides[0].sign * lam[at, own[0]], -lam[np.ix_(at, rows)]
        outside = float((np.linalg.norm(T, axis=1) - bound * N).max() / largest)
        yield Finding("friction in its cone", outside, HALF_DIGITS, contact.name)
        slip = np.array([every[rows] @ solution.qd[i] for every, i in zip(slopes, at, strict=True)])
        speed, most = np.linalg.norm(slip, axis=1), max((np.abs(every[rows]) @ fastest).max() for every in slopes)
        slides = ~solution.sticking(contact)[at] & (N > 0.0) & (speed > 0.0)
        off = np.linalg.norm(T * speed[:, None] + contact.kinetic * N[:, None] * slip, axis=1)[slides]
        share = float(off.max(initial=0.0) / (largest * most or 1.0))
        yield Finding("friction against the slip", share, limits.RUBBED, contact.name)


def impacts(solution, given=()):
    """What an impact changes are the momenta of its impulses, and of those of the bilateral constraints.

    given: of events whose actions give impulses: their times, the body and the impulse (3,), N s.
    """
    contacts = [] if solution._phases is None else list(_contacts(solution.packed))
    if not contacts:
        return
    system, fastest = solution.packed.system, np.abs(solution.qd).max(axis=0)
    lever = np.where(turning(system.bodies, fastest.size), 1.0 / _size(solution), 1.0)  # momenta as of positions
    rows = [row for contact, own in contacts for row in (*own, *_slips(contact, own))]
    before, after = _events(solution)
    times = {t for t, *_ in solution.impulses}.union(*(found.tolist() for found, *_ in given))
    hit = [k for k, i in enumerate(before) if solution.t[i] in times]
    for k in np.array(hit, int)[some(len(hit), limits.IMPACTS)] if hit else ():
        i, j = before[k], after[k]
        q, t = solution.q[i], solution.t[i]
        M, Phi_q = lever[:, None] * mass_matrix(system, q), lever * constraint_arrays(system, q, solution.qd[i], t)[1]
        change = M @ (solution.qd[j] - solution.qd[i])
        for times, body, impulse in given:
            at = system.bodies[index_of(solution.packed, body), 0]
            change[at : at + 3] -= (t in times) * lever[at : at + 3] * impulse
        for contact, own in contacts:
            found = [p for at, name, p in solution.impulses if (at, name) == (t, contact.name)]
            nearest = int(np.argmin([abs(gap[i]) for gap in _gaps(contact, solution)]))
            change = change - contact.sides[nearest].sign * Phi_q[own[nearest]] * sum(found)
            if found and _slips(contact, own):
                slips, P = Phi_q[_slips(contact, own)], sum(p.tangential for p in found)
                change = change - slips.T @ (_directions(solution.packed, contact, slips) @ P)
        B = np.delete(Phi_q, rows, axis=0)
        left = change - B.T @ np.linalg.lstsq(B.T, change, rcond=None)[0]
        share = np.abs(left).max() / ((np.abs(M) @ fastest).max() or 1.0)
        yield Finding("momenta at an impact", float(share), limits.IMPACTED, f"t = {t:.9g} s")


def energy_of_phases(left, solution):
    """The largest change of energy less work `left` (k,) within a phase, and its largest gain at an event; J."""
    numbers, (before, after) = solution._phase_of_rows, _events(solution)
    within = max((np.ptp(left[numbers == number]) for number in np.unique(numbers)), default=0.0)
    return float(max(within, (left[after] - left[before]).max(initial=0.0)))


def _events(solution):
    """First and last outputs of each instant that outputs have more than once."""
    _, first, count = np.unique(solution.t, return_index=True, return_counts=True)
    twice = count > 1
    return first[twice], first[twice] + count[twice] - 1


def _contacts(packed):
    """Yield the contacts of a packed scene, and the rows of their gaps."""
    for member in packed.members:
        if getattr(member.constraint, "unilateral", False):
            yield member.constraint, [member.rows.start + i for i in range(len(member.constraint.sides))]


def _slips(contact, own):
    """The rows of the slips of a contact with friction, which follow that of its gap."""
    return [own[0] + 1, own[0] + 2] if getattr(contact, "has_friction", False) else []


def _directions(packed, contact, slips):
    """Directions (2, 3) of slips, ground frame, from their rows (2, n) of Phi_q."""
    body, sign = (contact.a, 1.0) if contact.a.dimension else (contact.b, -1.0)
    at = packed.system.bodies[index_of(packed, body), 0]
    return sign * slips[:, at : at + 3]


def _size(solution):
    q = solution.q[:, ~turning(solution.system.bodies, solution.q.shape[1])]
    return max(extent(solution), float(np.abs(q).max(initial=0.0))) or 1.0


def _is_angle(contact):
    return isinstance(contact, Stop) and contact.sides[0].joint is not None


def _gap(contact, states):
    """The least gap (k,) of a contact."""
    return np.min(_gaps(contact, states), axis=0)


def _gaps(contact, states):
    """Gaps (sides, k) of a contact, m or rad, from what a user measures."""
    if isinstance(contact, Stop):
        x = (states.angle if _is_angle(contact) else states.displacement)(contact.joint)
        bounds = (contact.lower, 1.0), (contact.upper, -1.0)
        return [sign * (x - bound) for bound, sign in bounds if bound is not None]
    if isinstance(contact, Rope):
        ends = [_place(states, body, s) for body, s in contact.points]
        return [contact.length - sum(np.linalg.norm(b - a, axis=-1) for a, b in pairwise(ends))]
    point, base = next(pair for pair in POINTS if all(hasattr(contact, name) for name in pair))
    d = _place(states, contact.a, getattr(contact, point)) - _place(states, contact.b, getattr(contact, base))
    if contact.normal_b is not None:
        n = _turned(states, contact.b, contact.normal_b)
        return [(d * n).sum(axis=-1) - _reach(contact, states, n)]
    away = np.linalg.norm(d, axis=-1)
    radius = contact.radius_a
    return [contact.radius_b - radius - away if contact.inside else away - radius - contact.radius_b]


POINTS = ("center_a", "center_b"), ("center_a", "point_b"), ("point_a", "point_b")


def _reach(contact, states, n):
    """How far a body reaches from its centre or point towards a plane with the normal n."""
    if isinstance(contact, RollingDisc):
        across = (_turned(states, contact.a, contact.axis_a) * n).sum(axis=-1)
        return contact.radius * np.sqrt(1.0 - across**2) + contact.tyre_radius
    return getattr(contact, "radius_a", getattr(contact, "radius", 0.0))


def _place(states, body, s):
    return np.asarray(s, float) if body.dimension == 0 else states.position(body, point=s)


def _turned(states, body, s):
    return np.asarray(s, float) if body.dimension == 0 else states.rotation(body) @ np.asarray(s, float)


LAWS = (finite, constraints, newton_euler, dense_output, motors, unilateral, phases, rubbing, impacts)


def findings(solution, given=()):
    """Return what every law found; given: as of `impacts`."""
    if not len(solution.t):
        return []
    first, rest = list(finite(solution)), [law for law in LAWS if law not in (finite, impacts)]
    return first or [found for law in rest for found in law(solution)] + [*impacts(solution, given)]


def energy_left(solution):
    """Largest change of energy less work since the start, J, and the size of the energies, J; needs dense output.

    With contacts: within a phase, or gained at an event.
    """
    left = solution.energy - solution.work
    size = solution.kinetic_energy.max(initial=0.0) + np.ptp(solution.potential_energy) + np.abs(solution.work).max()
    change = np.abs(left - left[0]).max(initial=0.0) if solution._phases is None else energy_of_phases(left, solution)
    return float(change), float(size)


def momentum_left(solution):
    """Largest change of momenta of a scene that touches the ground nowhere: linear, and angular about the centroid.

    Both relative to the size of their parts.
    """
    masses = np.array([body.mass for body in solution.scene.bodies])
    places = np.stack([solution.position(body) for body in solution.scene.bodies])
    weight = masses.sum() * np.asarray(solution.scene.gravity)
    P = solution.linear_momentum
    centre = np.einsum("b,bki->ki", masses, places) / masses.sum()
    L = solution.angular_momentum - np.cross(centre, P)
    drift = P - P[0] - weight * (solution.t - solution.t[0])[:, None]
    speeds = np.stack([np.linalg.norm(solution.velocity(body), axis=1) for body in solution.scene.bodies])
    size = (masses @ speeds).max()
    spread = np.linalg.norm(places - centre, axis=2)
    turning = (masses @ (spread * speeds)).max() + np.abs(L).max()
    rounding = limits.ROUNDINGS * EPS * size * np.abs(places).max()  # of moments about the origin
    turned = max(np.abs(L - L[0]).max() - rounding, 0.0)
    return float(np.abs(drift).max() / (size or 1.0)), float(turned / (turning or 1.0))
