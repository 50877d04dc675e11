"""Motors at the start: how far their joints stand from the angle prescribed, and the way there.

The row of a motor is periodic and admits the angle half a turn away, so `assemble` takes a joint that stands far from
its motor there first. In a tree, one part is turned rigidly; in a loop the motor is driven in small steps, each
followed by an assembly, so that the mechanism stays on its branch.
"""

import math

import numpy as np

from ..constraints.rotation_motor import RotationMotor
from ..constraints.thread import Thread
from ..elements.joint_coordinates import AngleGeometry
from ..errors import InconsistentState, SingularConfiguration
from ..model import joint_motion
from ..model.handles import counts, handles_of
from ..motions.elementary import Polynomial
from ..motions.prescribed import Motion
from .rigid_shift import RigidShift
from .tolerances import DRIVE_TURN, ELSEWHERE


class Way:
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
    ways = [way for way in (Way(scene, motor, t, threaded) for motor in motors) if way.length > DRIVE_TURN]
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
        if abs(away) > ELSEWHERE * (1.0 + abs(wanted)):
            said.append(
                f"{motor.title} prescribes {wanted:.9g} {unit} at t = {t:g} s, where {joint.title} stands at "
                f"{here:.9g} {unit}: call scene.assemble(), or let the motion begin at the present {kind}."
            )
        elif abs(moves - rate) > ELSEWHERE * (1.0 + abs(rate)):
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
