"""What a user's function of a force raises at a state: kernels make nan of it, plain Python says which exception."""

import numpy as np

from ..elements.joint_coordinates import AngleGeometry
from ..elements.user_functions import STATE, ByState
from ..maths.vectors import to_ground
from ..model.handles import handles_of
from ..model.joint_motion import BodyMotion, angle, displacement
from ..motions.signals import Signal


def raised(packed, force, t, q, qd):
    """The exception that a function of a force raises at a state; None where it raises none."""
    for name in type(force).loads:
        given, arguments = getattr(force, name, None), (float(t),)
        if isinstance(given, Signal) and given.is_function:
            function = given.source
        elif isinstance(force, ByState) and name == force.given:
            function, arguments = _with_state(packed, force, float(t), (q, qd))
        else:
            continue
        try:
            with np.errstate(all="ignore", divide="raise"):
                function(*arguments)
        except FloatingPointError as error:  # of NumPy's numbers, where kernels raise Python's exception
            return ZeroDivisionError(str(error)).with_traceback(error.__traceback__)
        except Exception as error:
            return error
    return None


def _with_state(packed, force, t, levels):
    """The function of a force by state, and its arguments but for the time, as kernels give them."""
    handles, function = handles_of(packed), force.function_of_state
    if hasattr(force, "geometry"):
        pair = handles.motions(force.geometry, levels)
        evaluate = angle if isinstance(force.geometry, AngleGeometry) else displacement
        return function, (t, *(float(evaluate(force.geometry, *pair, level)) for level in (0, 1)))
    ends = ((force.a, force.point_a), (force.b, getattr(force, "point_b", None)))[: force.arguments.count(STATE)]
    states = [_state(BodyMotion(*handles.where(body), levels), point) for body, point in ends]
    if force.has_numbers:
        return function, (t, *states, np.array(force.parameters()), np.zeros(force.given_numbers))
    return function, (t, *states)


def _state(motion, point):
    """Position and velocity of a point, Euler parameters and angular velocity of its body, (13,)."""
    s = tuple(float(x) for x in point)
    return np.concatenate((motion.point(s, 0), motion.p, motion.point(s, 1), to_ground(motion.p, motion.turning(1))))
