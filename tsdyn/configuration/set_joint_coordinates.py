"""`scene.set`: the coordinates of a joint at the start, and the rest of the scene assembled around it.

If the joint is the only link between two parts of the scene, one part is moved rigidly relative to the other; all other
joints keep their values. In a loop the joint is driven to its value in small steps, each followed by an assembly, so
that the mechanism stays on its branch.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..constraints.angle_driver import AngleDriver
from ..constraints.dot2 import Dot2
from ..constraints.thread import Thread
from ..elements.element import Angle, AngleGeometry, stop_waiting
from ..errors import InconsistentState, InvalidArgument, SingularConfiguration
from ..maths.tolerances import TINY
from ..model import handles as joint_motion
from ..model.handles import counts, handles_of
from ..motions.elementary import Polynomial
from ..validation import floats, number, sequence
from .assemble import assembled_nearby
from .motor_starts import RigidShift, approach, prescribed
from .tolerances import DRIVE_LEAST, DRIVE_SHARE, DRIVE_TURN, INITIAL_TOL

if TYPE_CHECKING:
    from ..hints import ArrayLike, AssemblyReport, ItemLike, Scene, Sequence


class Goal:
    """A joint coordinate: its present value, and the value to be reached."""

    def __init__(self, geometry, value, rate, new_value, new_rate, motor=None):
        self.geometry, self.turns = geometry, isinstance(geometry, AngleGeometry)
        self.value, self.rate, self.motor = value, rate, motor
        self.new_value = value if new_value is None else new_value
        self.new_rate = rate if new_rate is None else new_rate

    def driver(self, share, t, joint):
        """Return the constraint that prescribes a share of the way, with the new rate, at t."""
        g, value = self.geometry, self.value + share * (self.new_value - self.value)
        motion = Polynomial((value - self.new_rate * t, self.new_rate))
        name = f"{joint.name} at {value:.6g} {'rad' if self.turns else 'm'}, {self.new_rate:.6g} a second"
        if self.turns:
            return AngleDriver(g.own, g.other, reference_a=g.f, across_a=g.g, reference_b=g.h, angle=motion, name=name)
        points = {"point_a": g.s_own, "point_b": g.s_other}
        return Dot2(g.own, g.other, axis_a=g.e, **points, value=motion, name=name)


def set_joint(  # by name: a value and a rate of each coordinate
    scene: Scene,
    joint: ItemLike,
    *,
    angle: ArrayLike | None = None,
    displacement: float | None = None,
    rate: ArrayLike | None = None,
    angle_rate: ArrayLike | None = None,
    displacement_rate: float | None = None,
    keep: Sequence[ItemLike] = (),
    t: float = 0.0,
) -> AssemblyReport:
    """Set the initial coordinates and rates of a joint, and assemble the rest of the scene.

    Parameters
    ----------
    joint : joint or str
        With an angle or a displacement, such as Revolute or Translational; or its name.
    angle : float, rad; optional
        Of b relative to a, as `solution.angle` counts it, over any number of turns. Two for Universal.
    displacement : float, m; optional
        As given by `solution.displacement`.
    rate : float, rad/s or m/s; optional
        Of the only coordinate of the joint, or of the coordinate that is set.
    angle_rate, displacement_rate : float, rad/s and m/s; optional
        The same, for joints that have both.
    keep : sequence of joints, or names; optional
        In closed loops: other joints that keep their coordinates and rates.
    t : float, s
        Time at which rheonomic constraints are satisfied.

    Returns
    -------
    AssemblyReport
        Of the last assembly.

    Raises
    ------
    InvalidConstraint, InvalidArgument
        If the joint has no such coordinate, or a number is not finite.
    InconsistentState
        If the scene can't be assembled with these values. The bodies are unchanged.

    Notes
    -----
    Coordinates that aren't given keep their values. In a tree, the bodies beyond the joint move as one rigid body: no
    other joint changes. In a closed loop the joint is driven to its value in small steps, on the present branch; other
    freedoms take the nearest values in the metric of kinetic energy. Closed contacts hold where the values allow it;
    else all are left out, and a run names those that penetrate.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> bar = scene.add_body(**ts.shapes.cylinder(0.02, 1.0, axis="x", mass=1.0), position=(0.5, 0, 0))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    >>> report = scene.set(hinge, angle=0.5, rate=2.0)
    >>> print(bar.position.round(4) + 0.0, bar.angular_velocity.round(4) + 0.0)
    [ 0.4388  0.     -0.2397] [0. 2. 0.]
    """
    keep = sequence(keep, "set: keep must be a sequence of joints or names, such as (joint,)", InvalidArgument)
    if not np.isfinite(number(t)):
        raise InvalidArgument(f"set: t must be a finite time in s, got {t!r}.")
    handles = handles_of(scene.packed)
    given = {"angle": [angle, angle_rate], "displacement": [displacement, displacement_rate]}
    if rate is not None:
        given[_kind_of_rate(handles, joint, given)][1] = rate
    joint = handles.item(joint)
    _link(joint, given)
    given = {kind: pair for kind, pair in given.items() if any(x is not None for x in pair)}
    if not given:
        raise InvalidArgument(f"set: no value is given for {joint!r}; give angle=, displacement= or rate=.")
    goals = [goal for kind, pair in given.items() for goal in _goals(scene, handles, joint, kind, pair, t)]
    others = [other for other in map(handles.item, keep) if other is not joint]
    held = [(other, goal) for other in others for goal in _present(scene, handles, other, t)]
    motors, before = [goal.motor for goal in goals if goal.motor is not None], scene.start
    try:
        approach(scene, float(t), (), lambda: assembled_nearby(scene, (), t), motors)
        report = _drive(scene, joint, goals, held, t)
    except BaseException:
        scene.place(*before)
        raise
    turns = tuple(goal.new_value for goal in goals if goal.turns)
    if turns:
        joint.__dict__["angle_near"] = turns
        scene.touch()
    return report


def _link(joint, given):
    """Derive the displacement of a joint with a lead from its angle, or the angle from the displacement."""
    lead = getattr(joint, "travel_per_radian", None)
    if lead is not None:
        for i, (turn, travel) in enumerate(zip(*given.values(), strict=True)):
            if turn is not None and travel is None:
                given["displacement"][i] = lead * number(turn)
            elif travel is not None and turn is None:
                given["angle"][i] = number(travel) / lead


def _kind_of_rate(handles, joint, given):
    """Return the kind of coordinate that `rate` refers to: the one that is set, or the joint's only one."""
    asked = [kind for kind, pair in given.items() if pair[0] is not None]
    kinds = asked if len(asked) == 1 else _kinds(handles, joint)
    if len(kinds) > 1:
        raise InvalidArgument(f"set: {joint!r} has two kinds of rates; give angle_rate= or displacement_rate=.")
    kind = kinds[0]
    if given[kind][1] is not None:
        raise InvalidArgument(f"set: give rate= or {kind}_rate=, not both.")
    return kind


def _kinds(handles, joint):
    """Return the kinds of coordinates of a joint; ("angle",) for anything without, to be refused by name later."""
    declared = getattr(handles.item(joint), "joint_coordinates", ())
    return list(dict.fromkeys("angle" if isinstance(each, Angle) else "displacement" for each in declared)) or ["angle"]


def _goals(scene, handles, joint, kind, pair, t):
    """Return a `Goal` for each coordinate of a kind, from (value, rate)."""
    row = handles.row(joint, kind)
    geometries, (q, qd) = getattr(row, f"{kind}s"), scene.start
    evaluate, near = getattr(joint_motion, kind), handles.angles_at_start(t, q)
    goals = []
    wanted = [_numbers(joint, name, value, len(geometries)) for name, value in zip((kind, "rate"), pair, strict=True)]
    for i, (geometry, *new) in enumerate(zip(geometries, *wanted, strict=True)):
        bodies = handles.motions(geometry, (q, qd))
        value, rate = (float(evaluate(geometry, *bodies, level)) for level in (0, 1))
        if kind == "angle":
            value = float(joint_motion.counted(value, near[row.first + i]))
        motor = next((one.motor.item for one in handles.driven if one.geometry is geometry), None)
        if motor is not None:
            new = _as_prescribed(joint, motor, new, t)
        goals.append(Goal(geometry, value, rate, *new, motor))
    return goals


def _as_prescribed(joint, motor, given, t):
    """Return the coordinate and the rate that a motor prescribes; refuse others, None being any."""
    found = prescribed(motor, t)
    for name, value, wanted in zip((motor.drives, "rate"), given, found, strict=True):
        away = 0.0 if value is None else value - wanted
        if name == "angle" and not counts(joint):
            away = joint_motion.counted(away, 0.0)
        if abs(away) > INITIAL_TOL * (1.0 + abs(wanted)):
            raise InconsistentState(
                f"set: {name}={value:.9g} of {joint.title} contradicts {motor.title}, which prescribes {wanted:.9g} at "
                f"t = {t:g} s. Leave {name} out, change the motion, or remove the motor."
            )
    return found


def _numbers(joint, name, value, count):
    """Return the numbers given; None for each coordinate that keeps its value."""
    if value is None:
        return [None] * count
    numbers = np.atleast_1d(floats(value))
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        many = "a finite number" if count == 1 else f"{count} finite numbers"
        raise InvalidArgument(f"set: {name} of {joint!r} must be {many}, got {value!r}.")
    return numbers.tolist()


def _present(scene, handles, joint, t):
    """Return goals that hold all coordinates of a joint."""
    return [goal for kind in _kinds(handles, joint) for goal in _goals(scene, handles, joint, kind, (None, None), t)]


def _drive(scene, joint, goals, held, t):
    """Drive a joint to its goals; return the report of the last assembly."""
    threaded = any(isinstance(part, Thread) or part.counted for part in scene.primitives)
    size, steps = _size(scene), 1
    shift = RigidShift.of(scene, joint)
    for goal in goals:
        if goal.turns and not threaded:  # whole turns move nothing
            goal.value = float(joint_motion.counted(goal.value, goal.new_value))
        way = abs(goal.new_value - goal.value) / (DRIVE_TURN if goal.turns else DRIVE_SHARE * size)
        steps = max(steps, math.ceil(way)) if shift is None else 1
    share, step, before = 0.0, 1.0 / steps, scene.start
    if shift is not None:
        shift.gain(goals)
    while True:
        ahead = min(share + step, 1.0) if share + 1.5 * step < 1.0 else 1.0
        drivers = [goal.driver(ahead, t, joint) for goal in goals]
        drivers += [goal.driver(1.0, t, other) for other, goal in held]
        if shift is not None:
            shift.move(goals, ahead - share)
        try:
            report = _assembled(scene, drivers, t, [goal.motor for goal in goals if ahead < 1.0])
        except (InconsistentState, SingularConfiguration) as error:
            scene.place(*before)
            step *= 0.5
            if shift is not None or step * steps < DRIVE_LEAST:
                raise InconsistentState(
                    f"{joint.title} can't be set so: the scene can be assembled {share:.0%} of the way. {error}"
                ) from error
            continue
        share, before = ahead, scene.start
        if threaded:
            _follow_turns(scene)
        if share == 1.0:
            return report


def _assembled(scene, drivers, t, motors):
    """Assemble the scene with temporary constraints, and without motors that prescribe the same coordinates."""
    for driver in drivers:
        stop_waiting(driver)
    added = scene._added
    scene._added = [*(each for each in added if each not in motors), *drivers]
    scene.touch()
    try:
        return assembled_nearby(scene, (), float(t))
    finally:
        scene._added = added
        scene.touch()


def _follow_turns(scene):
    """Let joints whose angles are coupled count on from the turn that they are on now."""
    handles = handles_of(scene.packed)
    for joint in dict.fromkeys(joint for part in scene.primitives for joint, _ in part.counted):
        row = handles.row(joint, "angle")
        near = np.broadcast_to(np.ravel(joint.angle_near), len(row.angles))
        now = (joint_motion.angle(g, *handles.motions(g, scene.start[:1]), 0) for g in row.angles)
        joint.__dict__["angle_near"] = tuple(float(joint_motion.counted(*pair)) for pair in zip(now, near, strict=True))
        scene.touch()


def _size(scene):
    """Return the extent of the scene, m."""
    places = np.array([body.position for body in scene.bodies])
    return max(float(np.ptp(places, axis=0).max()), scene.packed.size, TINY)
