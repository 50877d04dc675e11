"""Descent of the potential energy on the constraint manifold, to a static equilibrium.

    [ K + mu D    A^T ] [ u    ]     [ Q - A^T lam ]
    [ A           0   ] [ dlam ]  =  [ 0           ]        K = (Phi_q^T lam)_q - Q_q by increments u

With mu = 0 steps are Newton's. They are taken from the start on where K is positive on the motions that the constraints
admit; elsewhere mu grows until K + mu D is, so no step leads up to a saddle. A step counts if the work of the loads is a
share of what it promises. That work is by the trapezoidal rule, so no load needs a potential. The method is
Levenberg's, with the multipliers in the second derivatives as in sequential quadratic programming (Nocedal and Wright,
Numerical Optimization, 2006, ch. 18).
"""

import numpy as np

from ..errors import SingularConfiguration
from ..jit.kernels import entry
from ..model.equations import remember, set_time
from ..model.joint_motion import all_angles, counted
from .frame import Frame
from .motion import Motion
from .rest import Rest
from .saddle_free import saddle_free
from .tolerances import (
    AT_SADDLE,
    BALANCED,
    FARTHEST,
    FINAL,
    FIRST_MU,
    GOOD,
    HALVINGS,
    IN_VAIN,
    KICKS,
    LEAST_MU,
    LEAST_SHIFT,
    LEAST_STEP,
    MOST_STEPS,
    MOST_TRIES,
    MOST_TURN,
    MOST_TURNED,
    SHORT,
    SHORTER,
    SOFTER,
    STIFF,
    STIFFER,
    TOO_FAR,
    TURNED,
    WORTH,
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

    relative = False  # whether saddles may be stable all the same

    def __init__(self, packed, handles, remembered, t, q):
        self.packed, self.handles, self.t = packed, handles, t
        self.angles, self.memory = remembered[: handles.count].copy(), remembered[handles.count :].copy()
        self.frame, self.steps, self.gone, self.turned = Frame(packed, t, q), 0, 0.0, 0.0
        self.reach, self.mu = self.frame.reach, FIRST_MU
        self.rest, self._motion = self._at(q), None
        self.longest, self.trust = 0.5 * self.reach, 1.0

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

    def settle(self):
        """Take steps until the loads are balanced to rounding; True if they are."""
        vain = 0
        while self.steps < MOST_STEPS and self.gone < FARTHEST * self.reach and self.turned < MOST_TURNED:
            before = self.unbalanced
            if before <= BALANCED or not self._step():
                break
            self.steps += 1
            vain = vain + 1 if before <= TURNED and not self.unbalanced < 0.5 * before else 0
            if vain == IN_VAIN:
                break  # rounding
        return self.unbalanced <= TURNED

    def _step(self):
        """Take a step; False if none is left that the loads do work on."""
        quadratic, load = self.rest.quadratic, self.rest.left
        near, stiffness = self.unbalanced <= AT_SADDLE, float(quadratic.local.max(initial=0.0))
        if near and (self.relative or quadratic.circulatory):
            u = quadratic.factors(0.0, 0.0).newton(load)
            if u is not None and self._along(u):
                return True
        mu = 0.0
        for _ in range(MOST_TRIES):
            least = mu * stiffness if mu > STIFF else 0.0
            if stiffness == 0.0:
                least = np.abs(load).max() * max(mu, 1.0)
            factors = quadratic.factors(mu, least)
            u = None
            if factors.positive:
                u = factors.step(load) if mu > 0.0 else factors.newton(load)
            elif mu == 0.0 and factors.negative > 0 and self._without_saddle(factors, load):
                return True
            if u is not None:
                shift, turn = self.frame.increments.extent(u)
                if max(shift / self.reach, turn) <= LEAST_STEP:
                    return False
                far = max(shift / self.longest, turn / MOST_TURN)
                slides = self.trust == 1.0 and turn <= TOO_FAR * MOST_TURN
                if slides or not (far > TOO_FAR * self.trust and mu < 1.0 and quadratic.shift.any()):
                    if (near and mu > 0.0 and not self.relative and self._leave(factors, u)) or self._some_of(
                        u, far, factors
                    ):
                        self.mu = max(mu * SOFTER, LEAST_MU) if mu > 0.0 else self.mu
                        return True
                    if max(shift / self.reach, turn) <= FINAL:
                        return False
            mu = max(mu * STIFFER, self.mu)
        return False

    def _without_saddle(self, factors, load):
        """Move by the increment that leads down along all directions, if it isn't too far."""
        u = saddle_free(factors, load)
        if u is None:
            return False
        shift, turn = self.frame.increments.extent(u)
        far = max(shift / self.longest, turn / MOST_TURN)
        return bool(far <= TOO_FAR * self.trust and self._some_of(u, far, factors))

    def _some_of(self, u, far, factors):
        """Move by an increment, or a share of it if that is too far."""
        shift, turn = self.frame.increments.extent(u)
        size, factor = max(shift / self.reach, turn), min(1.0, self.trust / max(far, LEAST_SHIFT))
        for _ in range(HALVINGS):
            if self._try(factor * u, factor * size, factors):
                limited = factor * far > 0.99 * self.trust
                self.longest *= 2.0 if limited and self.trust == 1.0 and factor * turn < 0.99 * MOST_TURN else 1.0
                self.trust = min(1.0, self.trust * 2.0) if limited or factor == 1.0 else factor * far
                return True
            factor *= SHORTER
        return False

    def _along(self, u):
        """Move by Newton's increment, shortened, if less is unbalanced there."""
        shift, turn = self.frame.increments.extent(u)
        factor = min(1.0, 1.0 / max(shift / self.longest, turn / MOST_TURN, LEAST_SHIFT))
        for i in range(HALVINGS):
            q = self.rest.closed(self.frame.increments.moved(self.rest.q, factor * 0.5**i * u))
            if q is not None and self._move(q, factor * 0.5**i * u, 0.0):
                return True
        return False

    def _leave(self, factors, step):
        """Leave what is close to a saddle along a direction of negative stiffness that gains more than a step does."""
        quadratic, load = self.rest.quadratic, self.rest.left
        u = factors.downhill(load, np.random.default_rng(self.steps))
        if u is None:
            return False
        shift, turn = self.frame.increments.extent(u)
        u = u / max(turn, shift / self.reach)
        if not -(KICKS[0] ** 2) * quadratic.along(u) > 2.0 * float(load @ step) - quadratic.along(step):
            return False
        return any(self._try(share * u, share, factors) for share in KICKS)

    def _try(self, u, size, factors):
        """Move by an increment if the loads do work on the way."""
        old = self.rest
        promised = float(old.left @ u) - 0.5 * old.quadratic.along(u)
        moved = self.frame.increments.moved(old.q, u)
        q = old.closed(moved, factors.correction)
        q = old.closed(moved) if q is None else q
        if q is None or not np.isfinite(promised):
            return False
        if size > SHORT:
            work = 0.5 * (old.Q + old.loads_at(q)) @ (q - old.q)
            if not work > WORTH * promised:
                return False
        return self._move(q, u, size, promised)

    def _move(self, q, u, size, promised=np.inf):
        """Be at q, if less is unbalanced there or the step is not short."""
        old = self.rest
        try:
            rest = self._at(q)
        except SingularConfiguration:
            return False
        if size <= SHORT and not rest.unbalanced < GOOD * old.unbalanced:
            if size <= FINAL or not 0.5 * (old.left + rest.left) @ u > WORTH * promised:
                return False
        shift, turn = self.frame.increments.extent(u)
        self.gone, self.turned, self.rest = self.gone + shift, self.turned + turn, rest
        self._remember()
        return True

    def _remember(self):
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

    def kick(self, way):
        """Leave a saddle along a direction dq by a tenth of a radian, or of the size."""
        rest = self.rest
        u = self.frame.increments.of(rest.q, way)
        shift, turn = self.frame.increments.extent(u)
        for share in KICKS:
            q = rest.closed(self.frame.increments.moved(rest.q, share / max(turn, shift / self.reach) * u))
            if q is not None:
                self.rest = self._at(q)
                self._remember()
                break
