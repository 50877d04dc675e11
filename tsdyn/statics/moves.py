"""A configuration at rest, and moves to others: increments that satisfy the constraints, along which loads do work.

The work along an increment is that of the trapezoidal rule, so no load needs a potential.
"""

import numpy as np

from ..errors import SingularConfiguration
from ..jit.kernels import entry
from ..model.equations import remember, set_time
from ..model.joint_motion import all_angles, counted
from .frame import Frame
from .motion import Motion
from .rest import Rest
from .tolerances import FINAL, GOOD, HALVINGS, LEAST_SHIFT, MOST_TURN, NO_STIFFNESS, SHORT, SHORTER, WORTH


@entry
def update_memory(s, q, qd, t, out):
    """Let forces and constraints remember a configuration; out (slots,)."""
    set_time(s, t)
    remember(s, q, qd, t, out)


class Moves:
    """A configuration at rest.

    Parameters
    ----------
    packed : Packed
    handles : Handles
    remembered : ndarray
        Joint angles, then memory of forces and constraints.
    t : float, s
    q : ndarray (n,)
        Consistent.
    report : callable (fraction, said)
        Called with the progress of the search.

    Attributes
    ----------
    rest : Rest
    angles, memory : ndarray
        What is remembered here.
    gone, turned : float
        Of all moves: the largest shifts, m, and turns, rad.
    longest : float, m
        A move's largest shift.
    trust : float
        The share of the longest move that the last one did its work on.
    """

    def __init__(self, packed, handles, remembered, t, q, report):
        self.report = report
        self.packed, self.handles, self.t = packed, handles, t
        self.angles, self.memory = remembered[: handles.count].copy(), remembered[handles.count :].copy()
        self.frame = Frame(packed, t, q)
        self.reach, self.increments = self.frame.reach, self.frame.increments
        self.rest, self._motion = self._at(q), None
        self.gone, self.turned, self.longest, self.trust = 0.0, 0.0, 0.5 * self.reach, 1.0

    def _at(self, q):
        return Rest(self.frame, self.memory, q)

    @property
    def motion(self):
        """The `Motion` here."""
        if self._motion is None or self._motion.q is not self.rest.q:
            self._motion = self._motion_at(self.rest.q)
        return self._motion

    def _motion_at(self, q):
        return Motion(self.packed, self.memory, self.t, q, np.zeros(q.size), still=True)

    @property
    def unbalanced(self):
        """The largest acceleration from rest, m/s^2, over that of the loads by themselves."""
        return self.rest.unbalanced

    def nothing(self, reduced):
        """Stiffness, 1/s^2, that counts as zero: rounding of its terms, and apparent stiffness of residual loads."""
        left = self.unbalanced * self.rest.acceleration_scale / self.reach
        return NO_STIFFNESS * reduced.scale + len(reduced.K_hat) * left

    def size(self, u):
        """The largest shift, as a share of the reach, or turn, rad, of an increment."""
        shift, turn = self.increments.extent(u)
        return max(shift / self.reach, turn)

    def length(self, u):
        """The same over that of the longest move."""
        shift, turn = self.increments.extent(u)
        return max(shift / self.longest, turn / MOST_TURN, LEAST_SHIFT)

    def advance(self, u, factors):
        """Move by an increment, or a fraction along which loads do the predicted work; whether it moves."""
        far, factor = self.length(u), 1.0
        turn = self.increments.extent(u)[1]
        factor = min(1.0, self.trust / far)
        for _ in range(HALVINGS):
            if self.attempt(factor * u, factors):
                limited = factor * far > 0.99 * self.trust
                if limited and self.trust == 1.0 and factor * turn < 0.99 * MOST_TURN:
                    self.longest *= 2.0
                self.trust = min(1.0, self.trust * 2.0) if limited or factor == 1.0 else factor * far
                return True
            factor *= SHORTER
        return False

    def attempt(self, u, factors):
        """Move by an increment if the loads do work along it; whether they do."""
        old, size = self.rest, self.size(u)
        promised = float(old.left @ u) - 0.5 * old.quadratic.along(u)
        moved = self.increments.moved(old.q, u)
        q = old.closed(moved, factors.correction)
        q = old.closed(moved) if q is None else q
        if q is None or not np.isfinite(promised):
            return False
        if size > SHORT:
            work = 0.5 * (old.Q + old.loads_at(q)) @ (q - old.q)
            if not work > WORTH * promised:
                return False
        return self._move(q, u, size, promised)

    def approach_by(self, u):
        """Move by an increment, or a fraction that reduces the residual; whether one does."""
        factor = min(1.0, 1.0 / self.length(u))
        for i in range(HALVINGS):
            q = self.rest.closed(self.increments.moved(self.rest.q, factor * 0.5**i * u))
            if q is not None and self._move(q, factor * 0.5**i * u, 0.0, np.inf):
                return True
        return False

    def _move(self, q, u, size, promised):
        """Be at q. After a short way, whose work is rounding, less must be unbalanced, or what is left does work."""
        old = self.rest
        try:
            rest = self._at(q)
        except SingularConfiguration:
            return False
        better = size > SHORT or rest.unbalanced < GOOD * old.unbalanced
        if not (better or (size > FINAL and 0.5 * (old.left + rest.left) @ u > WORTH * promised)):
            return False
        shift, turn = self.increments.extent(u)
        self.gone, self.turned, self.rest = self.gone + shift, self.turned + turn, rest
        self.remember()
        return True

    def remember(self):
        """Count turns up to here."""
        q = self.rest.q
        if self.handles.count:
            self.angles = counted(all_angles(self.handles, q), self.angles)
        if self.memory.size:
            out, system = np.zeros(self.memory.size), self.rest.system
            update_memory(system, q, np.zeros(q.size), self.t, out)
            if not np.array_equal(out, self.memory):
                self.memory = out
                self.rest = self._at(q)
