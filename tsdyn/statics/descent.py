"""Descent of the potential energy on the constraint manifold, to a static equilibrium.

    [ K + mu D    A^T ] [ u    ]     [ Q - A^T lam ]
    [ A           0   ] [ dlam ]  =  [ 0           ]        K = (Phi_q^T lam)_q - Q_q by increments u

With mu = 0 steps are Newton's. They are taken from the start on where K is positive on the motions that the constraints
admit. Elsewhere the signs of negative eigenvalues are changed, or mu grows until K + mu D is positive: no step leads
up to a saddle, and one that is close is left along a direction of negative stiffness. The method is Levenberg's, with
the multipliers in the second derivatives as in sequential quadratic programming (Nocedal and Wright, Numerical
Optimization, 2006, ch. 18).
"""

import numpy as np

from .moves import Moves
from .saddle_free import saddle_free
from .tolerances import (
    AT_SADDLE,
    BALANCED,
    FARTHEST,
    FINAL,
    FIRST_MU,
    IN_VAIN,
    KICKS,
    LEAST_MU,
    LEAST_STEP,
    MOST_STEPS,
    MOST_TRIES,
    MOST_TURN,
    MOST_TURNED,
    SEARCH,
    SLIDING,
    SOFTER,
    STIFF,
    STIFFER,
    TOO_FAR,
    TURNED,
)


class Descent(Moves):
    """A configuration at rest, moved step by step; arguments of `Moves`."""

    relative = False  # whether what has no positive stiffness may be stable all the same

    def __init__(self, *start):
        super().__init__(*start)
        self.steps, self.mu = 0, FIRST_MU

    def report_steps(self):
        """Report progress: digits gained over digits required."""
        left = self.unbalanced
        digits = np.log(left) / np.log(BALANCED) if left > 0.0 else 1.0
        self.report(
            SEARCH * min(max(digits, 0.0), 1.0), f"{self.steps} steps, {left:.1e} of the loads are not balanced"
        )

    def balance(self):
        """Take steps until the loads are balanced to rounding; True if they are."""
        vain = 0
        while self.steps < MOST_STEPS and self.gone < FARTHEST * self.reach and self.turned < MOST_TURNED:
            before = self.unbalanced
            self.report_steps()
            if before <= BALANCED or not self._step():
                break
            self.steps += 1
            vain = vain + 1 if before <= TURNED and not self.unbalanced < 0.5 * before else 0
            if vain == IN_VAIN:
                break  # rounding
        return self.unbalanced <= TURNED

    def _step(self):
        """Take a step; False if no step is left along which the loads do work."""
        quadratic, load = self.rest.quadratic, self.rest.left
        near = self.unbalanced <= AT_SADDLE
        if near and (self.relative or quadratic.circulatory):
            u = quadratic.factors(0.0, 0.0).newton(load)
            if u is not None and self.approach_by(u):
                return True
        mu = 0.0
        for _ in range(MOST_TRIES):
            factors = quadratic.factors(mu, self._least(mu))
            if factors.positive:
                u = factors.step(load) if mu > 0.0 else factors.newton(load)
                if u is not None and self.size(u) <= LEAST_STEP:
                    return False
                if u is not None and self._is_fit(u, mu):
                    leaves = near and mu > 0.0 and not self.relative
                    if (leaves and self._leave(factors, u)) or self.advance(u, factors):
                        self.mu = max(mu * SOFTER, LEAST_MU) if mu > 0.0 else self.mu
                        return True
                    if self.size(u) <= FINAL:
                        return False
            elif mu == 0.0 and factors.negative > 0:
                u = saddle_free(factors, load)
                if u is not None and self.length(u) <= TOO_FAR * self.trust and self.advance(u, factors):
                    return True
            mu = max(mu * STIFFER, self.mu)
        return False

    def _least(self, mu):
        """Stiffness, N m, that replaces K where there is none, and where D doesn't suffice."""
        stiffness = self.rest.quadratic.local.max(initial=0.0)
        if stiffness == 0.0:
            return SLIDING * np.abs(self.rest.left).max() * max(mu, 1.0)
        return mu * stiffness if mu > STIFF else 0.0

    def _is_fit(self, u, mu):
        """Whether an increment is short enough to be tried; a larger mu makes it shorter."""
        slides = self.trust == 1.0 and self.increments.extent(u)[1] <= TOO_FAR * MOST_TURN
        return slides or mu >= 1.0 or self.length(u) <= TOO_FAR * self.trust or not self.rest.quadratic.shift.any()

    def _leave(self, factors, step):
        """Leave a saddle nearby along a direction of negative stiffness, if that gains more than a step."""
        quadratic, load = self.rest.quadratic, self.rest.left
        u = factors.downhill(load, np.random.default_rng(self.steps))
        if u is None:
            return False
        u = u / self.size(u)
        if not -(KICKS[0] ** 2) * quadratic.along(u) > 2.0 * float(load @ step) - quadratic.along(step):
            return False
        return any(self.attempt(share * u, factors) for share in KICKS)

    def kick(self, way):
        """Leave a saddle along a direction dq by a tenth of a radian, or of the size."""
        rest = self.rest
        u = self.increments.of(rest.q, way)
        for share in KICKS:
            q = rest.closed(self.increments.moved(rest.q, share / self.size(u) * u))
            if q is not None:
                self.rest = self._at(q)
                self.remember()
                break
