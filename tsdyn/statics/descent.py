"""Descent of the potential energy on the constraint manifold, to a static equilibrium.

    [ K_s + mu M    H^T ] [ dq   ]     [ Q_A - Phi_q^T lam ]
    [ H             0   ] [ dlam ]  =  [ 0                 ]        K_s = (Phi_q^T lam)_q - Q_A,q

M a = Q_A - Phi_q^T lam is what isn't balanced, a the acceleration from rest. A step counts if the loads do work on it;
otherwise mu grows, and the step turns towards a / mu. With mu near zero steps are Newton's. The work along a step is
that of the trapezoidal rule, so no load needs a potential. The method is Levenberg's, with the multipliers in the
second derivatives as in sequential quadratic programming (Nocedal and Wright, Numerical Optimization, 2006, ch. 18).
"""

import numpy as np

from ..configuration.continuation import close
from ..configuration.kinetic_metric import Metric
from ..elements.bodies import transform_g
from ..errors import SingularConfiguration
from ..jit.kernels import entry
from ..model import joint_motion
from ..model.equations import remember, set_time
from .motion import Motion
from .tolerances import (
    BALANCED,
    CLOSED,
    FARTHEST,
    KICKS,
    LEAST_SHIFT,
    LEAST_STEP,
    MOST_STEPS,
    MOST_SWEEPS,
    MOST_TURN,
    MOST_TURNED,
    NEARLY_CLOSED,
    SLOWEST,
    SOFTER,
    SOFTEST,
    STALLED,
    STIFFER,
    TURNED,
)


@entry
def update_memory(s, q, qd, t, out):
    """Let forces and constraints remember a configuration; out (slots,)."""
    set_time(s, t)
    remember(s, q, qd, t, out)


class Descent:
    """A configuration at rest, moved step by step.

    Parameters
    ----------
    packed : Packed
    handles : Handles
    remembered : ndarray
        Joint angles, then memory of forces and constraints.
    t : float, s
    q : ndarray (n,)
        Consistent.
    """

    def __init__(self, packed, handles, remembered, t, q):
        self.packed, self.handles, self.t = packed, handles, t
        self.angles, self.memory = remembered[: handles.count].copy(), remembered[handles.count :].copy()
        self.metric, self.steps, self.gone, self.turned = Metric(packed, None, t), 0, 0.0, 0.0
        self.reach, self.mu = self.metric.reach(q), 0.0
        self.motion = self._at(q, self.memory)
        self.longest = 0.5 * self.reach

    def _at(self, q, memory):
        return Motion(self.packed, memory, self.t, q, np.zeros(q.size), still=True)

    @property
    def unbalanced(self):
        """The largest acceleration from rest, m/s^2, over that of the loads by themselves."""
        turning = self.reach * np.abs(self.motion.spins(2)).max(initial=0.0)
        size = max(np.abs(self.motion.translations(2)).max(initial=0.0), turning)
        return float(size) / self.motion.acceleration_scale(self.reach)

    def settle(self):
        """Take steps until the loads are balanced to rounding; True if they are."""
        while self.steps < MOST_STEPS and self.gone < FARTHEST * self.reach and self.turned < MOST_TURNED:
            self.steps += 1
            if self.unbalanced <= BALANCED or not self._step():
                break
        return self.unbalanced <= TURNED

    def _step(self):
        """Take a step; False if none is left that the loads do work on."""
        motion = self.motion
        solve, stiffness = saddle(motion), motion.stiffness
        if stiffness > 0.0:
            self.mu = min(max(self.mu, SOFTEST * stiffness), stiffness)
        else:
            self.mu = self.mu or motion.acceleration_scale(self.reach) / self.reach
        load, before = motion.M @ motion.qdd, self.unbalanced
        while True:
            way = solve(self.mu, load)
            if way is not None:
                shift, turn = self._extent(way)
                if shift <= LEAST_STEP * self.reach and turn <= LEAST_STEP:
                    return False
                factor = min(1.0, self.longest / max(shift, LEAST_SHIFT), MOST_TURN / max(turn, LEAST_SHIFT))
                if self._try(factor * way, load, before):
                    self.mu *= SOFTER if factor == 1.0 else 1.0
                    self.longest *= 2.0 if factor < 1.0 and factor * turn < MOST_TURN else 1.0
                    return True
            self.mu *= STIFFER

    def _try(self, way, load, before):
        """Move if the loads do work on the way there."""
        old = self.motion
        q = self._moved(way)
        if q is None or not load @ way > 0.0:
            return False
        try:
            motion = self._at(q, self.memory)
        except SingularConfiguration:
            return False
        change = q - old.q
        self.motion = motion
        work = 0.5 * (load + motion.M @ motion.qdd) @ change
        if not (work > 0.0 or (self.unbalanced < 0.5 * before and np.isfinite(work) and before < TURNED)):
            self.motion = old
            return False
        shift, turn = self._extent(change)
        self.gone, self.turned = self.gone + shift, self.turned + turn
        self._remember()
        return True

    def _moved(self, way):
        """The consistent configuration next to that after a displacement; None where there is none."""
        q, before = self.motion.q + way, np.inf
        allowed = 1.0 + np.abs(q).max()
        for _ in range(MOST_SWEEPS):  # of simplified Newton, by the factors at hand
            Phi = self.motion.residuals(q)
            size = np.abs(Phi).max(initial=0.0)
            if size <= CLOSED * allowed or not size < SLOWEST * before:
                break
            before, q = size, q + self.motion.solve(np.zeros(q.size), -Phi[self.motion.kept])[0]
        if not size <= STALLED * allowed:
            return None  # too long a way
        if not size <= NEARLY_CLOSED * allowed:
            q, Phi, _ = close(self.metric, self._unit(self.motion.q + way))
            size = np.abs(Phi).max(initial=0.0)
        return self._unit(q) if size <= TURNED * allowed else None

    def _unit(self, q):
        """q (n,) with Euler parameters of unit length."""
        q = q.copy()
        p = q[self.metric.p]
        q[self.metric.p] = p / np.linalg.norm(p, axis=1)[:, None]
        return q

    def _extent(self, way):
        """The largest shift, m, and turn, rad."""
        metric, q = self.metric, self.motion.q
        turns = 2.0 * np.einsum("bij,bj->bi", transform_g(q[metric.p]), way[metric.p])
        return tuple(float(np.linalg.norm(x, axis=1).max(initial=0.0)) for x in (way[metric.r], turns))

    def _remember(self):
        """Count turns up to here."""
        q, at = self.motion.q, 0
        for row in self.handles.rows:
            for geometry in row.angles:
                here = joint_motion.angle(geometry, *self.handles.motions(geometry, (q,)), 0)
                self.angles[at] = joint_motion.counted(here, self.angles[at])
                at += 1
        if self.memory.size:
            out, system = np.zeros(self.memory.size), self.motion.system
            update_memory(system, q, np.zeros(q.size), self.t, out)
            if not np.array_equal(out, self.memory):
                self.memory = out
                self.motion = self._at(q, out)

    def kick(self, way):
        """Leave a saddle along a direction dq by a tenth of a radian, or of the size."""
        shift, turn = self._extent(way)
        for share in KICKS:
            q = self._moved(share * way / max(turn, shift / self.reach))
            if q is not None:
                self.motion = self._at(q, self.memory)
                self._remember()
                break
        self.mu = 0.0


def saddle(motion):
    """Return solve(mu, load) -> dq; None where the matrix is singular."""
    from scipy.sparse import block_array, diags_array
    from scipy.sparse.linalg import splu

    unit = diags_array(1.0 / motion.root)
    K, M, H = unit @ (motion.derivatives.K - motion.derivatives.Q_q) @ unit, unit @ motion.M @ unit, motion.H @ unit
    H = diags_array(1.0 / np.maximum(np.sqrt(H.multiply(H).sum(axis=1)), LEAST_SHIFT)) @ H

    def solve(mu, load):
        weight = motion.stiffness + mu or 1.0
        matrix = block_array([[(K + mu * M) / weight, H.T], [H, None]], format="csc")
        right = np.concatenate((load / motion.root / weight, np.zeros(H.shape[0])))
        try:
            found = splu(matrix).solve(right)[: load.size] / motion.root
        except RuntimeError:
            return None
        return found if np.isfinite(found).all() else None

    return solve
