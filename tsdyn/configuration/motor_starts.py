"""Checks of a start: violated rows, mirrored branches, angles of motors, rows of plug-ins that are not holonomic."""

import math
from itertools import pairwise

import numpy as np

from ..constraints.rotation_motor import RotationMotor
from ..constraints.thread import Thread
from ..elements.bodies import IDENTITY, euler_product, rotation_matrix
from ..elements.element import AngleGeometry
from ..elements.loops.template import state
from ..errors import InconsistentState, InvalidConstraint, SingularConfiguration
from ..jit.code_hash import is_ours
from ..jit.kernels import twin
from ..model import handles as joint_motion
from ..model.handles import counts, handles_of
from ..motions.elementary import Polynomial
from ..motions.prescribed import Motion
from ..motions.tolerances import QUOTIENT_ERROR
from ..observables.diagnostics import starts_of
from ..rows.constraint_graph import MASS_REMEDY, mass_ratio
from ..validation import listed
from .tolerances import DRIVE_TURN, INITIAL_TOL, LEAST_X, PHI_STEPS

# Rigid displacement of one part of a scene relative to the other, across the only joint between them.
#
# A point x moves to c + R (x - c) + d, with R a rotation about the axis of the joint through c and d a translation
# along its direction. Velocities v - v_F and omega - omega_F relative to the fixed body F are rotated by R.


class RigidShift:
    """Moves the bodies on one side of a joint; their velocities relative to the other side are preserved.

    Parameters
    ----------
    joint : joint
    stays, goes : Body or ground
        Its two bodies.
    bodies : list of Body
        The moving bodies: `goes`, and all bodies beyond it.
    """

    def __init__(self, joint, stays, goes, bodies):
        self.joint, self.stays, self.goes, self.bodies = joint, stays, goes, bodies

    @classmethod
    def of(cls, scene, joint):
        """Return the shift across a joint; None if the joint is in a loop."""
        for stays, goes in ((joint.a, joint.b), (joint.b, joint.a)):
            found = _beyond(scene, stays, goes)
            if not any(body is stays or body is scene.ground for body in found):
                return cls(joint, stays, goes, found)
        return None

    def gain(self, goals):
        """Set the rates of the goals' coordinates."""
        for goal in goals:
            axis, centre, sense = self._line(goal)
            gain = sense * (goal.new_rate - goal.rate) * axis
            for body in self.bodies:
                if not goal.turns:
                    body.velocity = body.velocity + gain
                    continue
                body.velocity = body.velocity + np.cross(gain, body.position - centre)
                if body.dimension == 7:
                    body.angular_velocity = body.angular_velocity + rotation_matrix(body.orientation).T @ gain

    def move(self, goals, share):
        """Move by a share of the goals' increments."""
        for goal in goals:
            axis, centre, sense = self._line(goal)
            way = sense * share * (goal.new_value - goal.value)
            turn, travel = (way, 0.0 * axis) if goal.turns else (0.0, way * axis)
            half = np.append(np.cos(0.5 * turn), np.sin(0.5 * turn) * axis)
            R = rotation_matrix(half)
            r, v, omega = _motion(self.stays)
            for body in self.bodies:
                x, xd, w = _motion(body)
                place = centre + R @ (x - centre) + travel
                body.velocity = v + np.cross(omega, place - r) + R @ (xd - v - np.cross(omega, x - r))
                body.position = place
                if body.dimension == 7:
                    body.orientation = euler_product(half, body.orientation)
                    body.angular_velocity = rotation_matrix(body.orientation).T @ (omega + R @ (w - omega))

    def _line(self, goal):
        """Return the axis of a goal's coordinate (ground frame), a point on it, and the sign for the moving side."""
        geometry, point = goal.geometry, "point_a" if self.goes is self.joint.a else "point_b"
        direction = np.cross(geometry.f, geometry.g) if goal.turns else geometry.e
        axis = rotation_matrix(_orientation(geometry.own)) @ direction
        s = getattr(self.joint, point, np.zeros(3))
        centre = self.goes.position + rotation_matrix(_orientation(self.goes)) @ s
        return axis, centre, 1.0 if self.goes is geometry.other else -1.0


def _beyond(scene, stays, goes):
    """Return the bodies on one side when the links between two are cut; in a loop, the other is among them."""
    links = {}
    for constraint in scene.constraints:
        bodies = dict.fromkeys(body for part in constraint.parts for body in (part.a, part.b) if body is not None)
        if bodies.keys() != {stays, goes}:
            for a, b in pairwise(bodies):
                links.setdefault(a, []).append(b)
                links.setdefault(b, []).append(a)
    found, waiting = {goes}, [goes]
    while waiting:
        for body in links.get(waiting.pop(), ()):
            if body not in found:
                found.add(body)
                waiting.append(body)
    return list(found)


def _orientation(body):
    return IDENTITY if body.dimension == 3 else body.orientation


def _motion(body):
    """Position, velocity and angular velocity of a body at the start, ground frame."""
    if body.dimension == 0:
        return np.zeros((3, 3))
    omega = rotation_matrix(body.orientation) @ body.angular_velocity if body.dimension == 7 else np.zeros(3)
    return body.position, body.velocity, omega


# Motors at the start: how far their joints stand from the angle prescribed, and the way there.
#
# The row of a motor is periodic and admits the angle half a turn away, so `assemble` takes a joint that stands far from
# its motor there first. In a tree, one part is turned rigidly; in a loop the motor is driven in small steps, each
# followed by an assembly, so that the mechanism stays on its branch.


class MotorApproach:
    """The way of a motor from the present angle to the one prescribed at t; a goal of `RigidShift`."""

    turns = True

    def __init__(self, scene, motor, t, threaded):
        self.motor = motor
        self.geometry = geometry_of(motor)
        handles, q = handles_of(scene.packed), scene._initial()[0]
        near = near_of(handles, motor, t, q) if threaded else motor.angle.value(t)[0]
        here = joint_motion.angle(self.geometry, *handles.motions(self.geometry, (q,)), 0)
        self.value, self.new_value = float(joint_motion.counted(here, near)), float(motor.angle.value(t)[0])

    @property
    def length(self):
        """How far it is, rad."""
        return abs(self.new_value - self.value)


def geometry_of(motor):
    """Return where a motor measures, along its axis to rounding."""
    (row,) = motor.parts
    f, g, h = (tuple(x.tolist()) for x in (row.reference_a, row.across_a, row.reference_b))
    return AngleGeometry(row.a, row.b, f, g, h)


def near_of(handles, motor, t, q):
    """Return the turn that the joint of a motor stands on, rad; zero without a joint."""
    for one in handles.driven:
        if one.motor.item is motor:
            return present_turn(handles, one, t, q)
    return 0.0


def present_turn(handles, one, t, q):
    """Return the angle near which that of a driven joint would be counted without its motor."""
    item, i = one.joint.item, one.place - one.joint.first
    moved = [joint_motion.displacement(g, *handles.motions(g, (q,)), 0) for g in one.joint.displacements]
    return float(np.broadcast_to(item.counted_from(t, *moved), len(one.joint.angles))[i])


def has_motors(scene):
    """Whether there are motors that `approach` may have to deal with."""
    return any(isinstance(member.constraint, RotationMotor) for member in scene.packed.members)


def approach(scene, t, fixed, assembled, besides=()):
    """Take the joints of motors that stand far from the angle prescribed at t there, or nearly so.

    Parameters
    ----------
    fixed : list of int
        Bodies that stay.
    assembled : callable
        Assembles the scene.
    besides : sequence of RotationMotor, optional
        Those that are left where they stand.
    """
    motors = [each for each in scene.constraints if isinstance(each, RotationMotor) and each not in besides]
    threaded = any(isinstance(part, Thread) for part in scene.primitives)
    ways = [way for way in (MotorApproach(scene, motor, t, threaded) for motor in motors) if way.length > DRIVE_TURN]
    for way in list(ways):
        shift = None if threaded else RigidShift.of(scene, way.motor)
        if shift is not None and not {body.index for body in shift.bodies} & set(fixed):
            shift.move([way], 1.0)
            ways.remove(way)
    if ways:
        _drive(scene, ways, assembled)


def _drive(scene, ways, assembled):
    """Drive motors in a loop to the last step before the angle prescribed; leave a scene that can't be driven so."""
    before, motions = scene.start, [way.motor.angle for way in ways]
    steps = math.ceil(max(way.length for way in ways) / DRIVE_TURN)
    try:
        for step in range(1, steps):
            for way in ways:
                way.motor.angle = Polynomial((way.value + step / steps * (way.new_value - way.value),))
            assembled()
    except (InconsistentState, SingularConfiguration):
        scene.place(*before)
    finally:
        for way, motion in zip(ways, motions, strict=True):
            way.motor.angle = motion


def elsewhere(packed, t, q, qd=None):
    """Return a sentence for each motor whose joint stands elsewhere at q, or moves at another rate.

    Whole turns matter where the displacement of the joint counts them.
    """
    handles, said = handles_of(packed), []
    for one in handles.driven:
        motor, joint, kind = one.motor.item, one.joint.item, one.motor.item.drives
        (wanted, rate), unit = prescribed(motor, t), "rad" if kind == "angle" else "m"
        bodies = handles.motions(one.geometry, (q, qd))
        here, moves = getattr(joint_motion, kind)(one.geometry, *bodies, 0), rate
        if kind == "angle":
            here = float(joint_motion.counted(here, present_turn(handles, one, t, q)))
        away = wanted - here if kind != "angle" or counts(joint) else joint_motion.counted(wanted - here, 0.0)
        if qd is not None:
            moves = getattr(joint_motion, kind)(one.geometry, *bodies, 1)
        if abs(away) > INITIAL_TOL * (1.0 + abs(wanted)):
            said.append(
                f"{motor.title} prescribes {wanted:.9g} {unit} at t = {t:g} s, where {joint.title} stands at "
                f"{here:.9g} {unit}: call scene.assemble(), or let the motion begin at the present {kind}."
            )
        elif abs(moves - rate) > INITIAL_TOL * (1.0 + abs(rate)):
            said.append(
                f"{motor.title} prescribes {rate:.9g} {unit}/s at t = {t:g} s, where {joint.title} moves at "
                f"{moves:.9g} {unit}/s: call scene.assemble(), or scene.set({joint.name!r}, rate={rate:.9g})."
            )
    return said


def prescribed(motor, t):
    """Return the coordinate that a motor prescribes at t, and its rate."""
    motion = getattr(motor, motor.drives)
    return motion.value(t)[:2] if isinstance(motion, Motion) else (motion, 0.0)


def demand_turns(packed, q, t):
    """Refuse a motor whose joint is whole turns away, by its displacement: the rows don't distinguish turns."""
    if any(one.place >= 0 and counts(one.joint.item) for one in handles_of(packed).driven):
        said = elsewhere(packed, t, q)
        if said:
            raise InconsistentState("\n".join(said))


# Mirrored branches of joints: rows that align directions also admit opposed ones; such a start is refused.


def demand_aligned(packed, q, t):
    """Refuse positions q (n,) at t that meet the rows with directions opposed or turns away, by the joint's name."""
    names = opposed(packed, q, t)
    if names:
        raise InconsistentState(
            f"{listed(names)}: directions that the joint keeps parallel point opposite ways here. Its "
            "rows hold so, too, but it is the mirrored joint. Give one of the axes (or references) the other sign, or "
            "turn a body half a turn." + "".join(f"\n{each}" for each in elsewhere(packed, t, q))
        )
    demand_turns(packed, q, t)


def opposed(packed, q, t):
    """Titles of the constraints whose directions are opposed at positions q (n,) at t, each once."""
    which, titles = _opposed(packed, q, t)
    return list(dict.fromkeys(titles[i] for i in np.flatnonzero(which)))


def are_aligned(packed, q, t):
    """Which of many positions (k, n) at t `demand_aligned` lets pass."""
    return ~_opposed(packed, q, t)[0].any(axis=-1)


def _opposed(packed, q, t):
    """Which pairs of directions are opposed at positions q (..., n), and their titles."""
    if packed.derived.aligned is None:
        packed.derived.aligned = _pairs(packed)
    titles, places, directions, moving = packed.derived.aligned
    if not titles:
        return np.zeros((*q.shape[:-1], 0), bool), titles
    if moving:
        directions = directions.copy()
        for i, direction in moving:
            directions[0, i] = direction(t)
    p = np.concatenate((q, np.broadcast_to(IDENTITY, (*q.shape[:-1], 4))), axis=-1)[..., places]
    turned = np.einsum("...skij,skj->...ski", rotation_matrix(p), directions)
    return ~((turned[..., 0, :, :] * turned[..., 1, :, :]).sum(axis=-1) > 0.0), titles


def _pairs(packed):
    """Titles; where the Euler parameters of both bodies are in (q, 1, 0, 0, 0), (2, k, 4); directions (2, k, 3).

    Then the places of first directions that are functions of time, with them.
    """
    starts = {id(body): int(at) + 3 for body, (at, _) in zip(packed.bodies, packed.system.bodies, strict=True)}
    ground = int(packed.system.bodies[:, 1].sum())
    titles, places, directions, moving = [], [], [], []
    for member in packed.members:
        for pair in member.constraint.opposed if hasattr(type(member.constraint), "opposed") else ():
            titles.append(member.constraint.title)
            places.append([starts.get(id(body), ground) for body, _ in pair])
            (_, first), (_, second) = pair
            if callable(first):
                moving.append((len(directions), first))
                first = np.zeros(3)  # of another time each time
            directions.append([first, second])
    places = np.array(places, np.int64).reshape(-1, 2).T[..., None] + np.arange(4)
    return titles, places, np.array(directions).reshape(-1, 2, 3).swapaxes(0, 1), moving


# Checks of initial conditions against the constraints; messages name the violated rows.


def demand_finite(scene, *arrays):
    """Refuse rows that are not finite, by name."""
    for array in arrays:
        bad = np.flatnonzero(~np.isfinite(array if array.ndim == 1 else array.sum(axis=1)))
        if bad.size:
            raise InconsistentState(
                f"{scene.row_names()[bad[0]]}: its constraint or a derivative of it is not finite at the start. Look "
                "at its parameters, its motion, or its kernels."
            )


def demand_small(scene, residual, tol, level, formula, start):
    """Refuse residuals (m,) above tol, by name; start is (t, q) or (t, q, qd)."""
    bad = np.flatnonzero(~(np.abs(residual) <= tol))
    if bad.size == 0:
        return
    names = scene.row_names()
    worst = sorted(bad, key=lambda i: -abs(residual[i]))
    lines = [f"  {names[i]}: {formula} = {residual[i]:.6g}" for i in worst[:8]]
    if bad.size > 8:
        lines.append(f"  ... and {bad.size - 8} more rows")
    said = elsewhere(scene.packed, *start)
    raise InconsistentState(
        f"the initial {level} breaks {bad.size} constraint row{'s' if bad.size > 1 else ''} (allowed: {tol:.2g}):\n"
        + "\n".join(lines + said)
        + f"\nCorrect the bodies' {'poses' if level == 'position' else 'velocities'}, or call scene.assemble() to move "
        "them to the nearest consistent ones."
    )


def refuse_vanished(row):
    """Refuse a row of Phi_q, by its name, that is zero."""
    raise SingularConfiguration(
        f"the row of {row} in Phi_q is zero in this configuration: the constraint is singular here. Start from another "
        "configuration, or use a constraint that is regular here."
    )


def refuse_masses(scene, graph, row):
    """Refuse masses so unequal that S is singular to rounding at a row of the graph."""
    where = scene.row_names()[graph.row[row]] if graph.row[row] >= 0 else "a body with many joints"
    raise SingularConfiguration(f"{mass_ratio(scene.packed)}, found at {where}. {MASS_REMEDY}")


# Check that the rows of a plug-in are holonomic: its jacobian is the derivative of its phi.
#
# The tangent form would run a row on velocities that is given as one of phi. The forms with a basis solve for positions
# with Phi and Phi_q together and silently give wrong results if one isn't the derivative of the other.

TRIED = 3  # instances of each kind


def demand_holonomic(packed, q, t, form):
    """Raise InvalidConstraint for a plug-in whose jacobian isn't the derivative of its phi at q (n,)."""
    if packed.derived.holonomic:
        return
    seen = {}
    for constraint, given, places in zip(packed.constraints, packed.parameters, packed.coordinates, strict=True):
        kind = type(constraint)
        seen[kind] = seen.get(kind, 0) + 1
        if is_ours(kind.__module__) or seen[kind] > TRIED or not kind.rows:
            continue
        par = [x for value in given for x in (value.value(t) if isinstance(value, Motion) else (value,))]
        par += [0.0] * kind.memory
        row = _wrong_row(constraint, par, _markers(packed, constraint, places, q), t)
        if row is not None:
            raise InvalidConstraint(
                f"{constraint.name}: row {row} of its jacobian is not the derivative of its phi: it is not holonomic, "
                f"for which {form!r} with this method gives wrong results. Correct the kernels with "
                f"ts.testing.check_primitive({kind.__name__}); make a row on velocities alone one of rate_rows."
            )
    packed.derived.holonomic = True


def _markers(packed, constraint, places, q):
    """Return the marker coordinates x of a constraint."""
    starts, parts = starts_of(packed), []
    for marker, s in zip(constraint.markers, places, strict=True):
        body, x = constraint.body_of(marker), np.zeros(marker.size)
        twin(state)(marker.code, body.dimension, starts.get(body, 0), q, np.zeros_like(q), s, x, np.zeros(marker.size))
        parts.append(x)
    return np.concatenate(parts)


def _wrong_row(constraint, par, x, t):
    """Return a row of the jacobian that no difference quotient of phi confirms; None if there is none."""
    kind = type(constraint)
    phi, jacobian = twin(kind.phi), twin(kind.jacobian)

    def value(x):
        out = np.zeros(kind.rows)
        phi(x, par, t, out)
        return out

    direction = np.random.default_rng(0).normal(size=x.size)
    Phi_x = np.zeros((kind.rows, x.size))
    try:
        jacobian(x, par, t, Phi_x)
        rate, size = Phi_x @ direction, np.abs(Phi_x) @ np.abs(direction)
        off = np.full(kind.rows, np.inf)
        for step in PHI_STEPS:
            h = step * max(np.abs(x).max(), LEAST_X) * direction
            quotient = (value(x + h) - value(x - h)) * np.abs(direction).max() / (2.0 * np.abs(h).max())
            off = np.fmin(off, np.abs(quotient - rate))
    except Exception:  # the compiled kernels report it
        return None
    wrong = np.flatnonzero(off > QUOTIENT_ERROR * size)
    return int(wrong[0]) if wrong.size else None
