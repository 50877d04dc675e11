"""Sample and hold: joint loads whose Python functions are evaluated at times k period, between slices of a run.

A step ends at each sampling time. The driver returns, the functions that are due are evaluated, their values are stored
in the memory of the forces, and the driver continues from the new accelerations.
"""

import math

import numpy as np

from ..errors import InvalidArgument, InvalidForce, Status
from ..model import joint_motion
from ..motions.tolerances import TOGETHER
from ..validation import number
from .tolerances import MOST_INSTANTS, SAME_INSTANT


class Failed(Exception):
    """A function raised, or gave no finite number."""


class Sampling:
    """The sampled loads of one run, all of its parts.

    Parameters
    ----------
    prepared : Prepared
    continued : bool
        Whether the run goes on from a state, so that what is held there stays until the next instant.
    """

    def __init__(self, prepared, continued):
        self.packed, self.handles, self.loads = prepared.packed, prepared.handles, sampled(prepared.packed)
        self.last = [-math.inf] * len(self.loads)  # when each was evaluated
        self.begun = continued
        for load in self.loads:
            reset = getattr(load.force.function, "reset", None)
            if callable(reset) and not continued:
                reset()

    def ask(self, memory, t, q, qd):
        """Evaluate the functions that are due at t, and hold their values."""
        for i, load in enumerate(self.loads):
            force = load.force
            if t > self.last[i] and (not self.begun or is_due(t, force.period)):
                angles, self.last[i] = memory.run.remembered[: self.handles.count], t
                value = self._value(force, t, (q, qd), angles)
                memory.context.system.reals[self.packed.system.memory[load.slot]] = value
                memory.run.remembered[self.handles.count + load.slot] = value
        self.begun = True

    def _value(self, force, t, levels, angles):
        """Value of a force's function; angles are the approximate ones that the run has counted."""
        row = self.handles.row(force.joint, force.coordinate)
        evaluate, geometry = getattr(joint_motion, force.coordinate), force.geometry
        x, rate = (float(evaluate(geometry, *self.handles.motions(geometry, levels), level)) for level in (0, 1))
        if force.coordinate == "angle":
            x = float(joint_motion.counted(x, angles[row.first + force.which]))
        try:
            given = force.function(t, x, rate)
        except Exception as error:
            raise Failed(
                f"{force.name}: its function raised {type(error).__name__} at t = {t:.9g} s: {str(error).rstrip('.')}."
            ) from error
        value = number(given)
        if not math.isfinite(value):
            raise Failed(f"{force.name}: its function must return a finite number; at t = {t:.9g} s it gave {given!r}.")
        return value


class Sampled:
    """The memory of a run, advanced from instant to instant; see `Memory`."""

    def __init__(self, memory, sampling):
        self.memory, self.sampling = memory, sampling
        self.run, self.weight, self.context = memory.run, memory.weight, memory.context
        self.reason = ""

    def saved(self):
        """When each function was evaluated last."""
        return {"last": self.sampling.last, "begun": self.sampling.begun}

    def restore(self, numbers):
        """As it was when it was saved."""
        self.sampling.last, self.sampling.begun = numbers["last"], numbers["begun"]

    def advance(self, log, most):
        """Make up to `most` steps; the Status, as of the driver's `advance`."""
        run, work = self.run, self.memory.context.work
        numbers = run.numbers
        try:
            # The first values, before the first accelerations
            if not numbers.begun and most != 0:
                self.sampling.ask(self.memory, float(run.clock.t), work.q.copy(), work.qd.copy())
            first = numbers.history
            while True:
                # Up to the next instant, or to the end of the slice
                done = int(numbers.history - first)
                status = self.memory.advance(log, most - done if most > 0 else most)
                if status != Status.SLICE_DONE or not numbers.waiting:
                    return status
                # New values, and accelerations with them
                self.sampling.ask(self.memory, float(run.clock.t), run.now[0].copy(), run.now[1].copy())
                status = self.memory.advance(log, 0)
                if status != Status.SLICE_DONE or numbers.history - first >= most:
                    return status
        except Failed as failure:
            if not numbers.begun:
                raise InvalidForce(str(failure)) from failure.__cause__
            self.reason = str(failure)
            return Status.SAMPLING_FAILED


def sampled(packed):
    """The loads that are sampled."""
    return [load for load in packed.loads if getattr(load.force, "period", None) is not None]


def is_due(t, period):
    """Return True if t is an instant of a period."""
    return abs(t - round(t / period) * period) <= max(SAME_INSTANT * period, TOGETHER * abs(t))


def instants_of(packed, t0, t1):
    """The instants within (t0, t1) at which a function is asked, s, increasing."""
    found = []
    for load in sampled(packed):
        period = load.force.period
        count = (t1 - t0) / period
        if not count < MOST_INSTANTS:
            raise InvalidArgument(
                f"{load.force.name}: a period of {period:g} s makes {count:.3g} instants, and {MOST_INSTANTS} are as "
                "many as a run may have; take a longer period or a shorter run."
            )
        times = np.arange(math.floor(t0 / period), math.ceil(t1 / period) + 1) * period
        found.append(times[(times > t0) & (times < t1)])
    return np.unique(np.concatenate(found)) if found else np.empty(0)
