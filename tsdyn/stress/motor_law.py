"""The law of motors: joints follow the motions that are prescribed, which rows of sines know modulo turns alone."""

import numpy as np

from .finding import Finding, some
from .tolerances import OUTPUTS, ROW_SHARE


def motors(solution):
    """The angle of a motor, and of the joint that it drives, is the one prescribed, turns included."""
    handles, at = solution.handles, some(solution.t.size, OUTPUTS)
    driven = [(one.motor.item, one.joint.item, one.place - one.joint.first) for one in handles.driven]
    driven += [(row.item, row.item, 0) for row in handles.rows]
    for motor, item, i in driven if solution.success else ():
        if motor.drives == "angle":
            angle = solution.angle(item)[at].reshape(len(at), -1)[:, i]
            wanted = np.array([motor.angle.value(t)[0] for t in solution.t[at]])
            size = float((np.abs(angle - wanted) / (1.0 + np.abs(wanted))).max())
            yield Finding("angles of motors", size, ROW_SHARE, item.title)
