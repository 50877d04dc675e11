"""Relative equilibria: configurations that a steady spin keeps, their stability with gyroscopic terms.

With qd = D (q - c) the loads that are not balanced are Q_A + Q_v - M D D (q - c) - Phi_q^T lam, and their stiffness is

    K = M D D - C* D + K*        C* = (Q_A + Q_v)_qd,    K* = (M qdd - Q_A - Q_v)_q + (Phi_q^T lam)_q

Newton's method goes to the nearest root. One that is not stable is left by the descent of descent.py, on the amended
potential V - Omega . J Omega / 2 (Simo, Lewis, Marsden 1991).
"""

import numpy as np

from ..errors import InconsistentState, NoEquilibrium
from ..observables.generalised_forces import velocity_forces
from .coordinates import chosen
from .descent import Descent
from .eigen import eigenpairs, stiffnesses
from .motion import Motion
from .reduction import Reduced
from .steady import is_invariant
from .steady_rest import SteadyRest
from .tolerances import (
    BALANCED,
    GROWING,
    LEAST_SHIFT,
    MOST_NEWTON,
    MOST_SADDLES,
    STEADY,
    TURNED,
)
from .variations import Variations


class SteadyMotion(Motion):
    """A `Motion` with the velocities of a `SteadyField`; qdd are the accelerations that are left over."""

    def __init__(self, packed, memory, t, q, field):
        qd, self._gains = field.levels(q)
        super().__init__(packed, memory, t, q, qd, still=True)
        self.field = field
        Q = self.Q_A + velocity_forces(self.system, q[None], qd[None])[0]
        self.qdd, found = self.solve(Q - self.M @ self._gains, np.zeros(self.kept.size))
        self.lam = np.zeros(len(self.Phi))
        self.lam[self.kept] = found

    @property
    def accelerations(self):
        """Those of the steady motion."""
        return self._gains


class SteadyDescent(Descent):
    """A configuration in steady motion, moved step by step; arguments of `Descent` after the `SteadyField`."""

    relative = True

    def __init__(self, field, *start):
        self.field = field
        super().__init__(*start)

    def _at(self, q):
        return SteadyRest(self.frame, self.memory, q, self.field)

    def _motion_at(self, q):
        return SteadyMotion(self.packed, self.memory, self.t, q, self.field)

    def approach(self):
        """Take Newton steps to the nearest root; True if it is reached."""
        for _ in range(MOST_NEWTON):
            before, rest = self.unbalanced, self.rest
            self.report_steps()
            if before <= BALANCED:
                break
            u = rest.quadratic.factors(0.0, 0.0).newton(rest.left)
            if u is None:
                break
            self.steps += 1
            if not self.approach_by(u):
                break
        return self.unbalanced <= TURNED


def find_steady(descent):
    """The findings of a relative equilibrium, the descent being moved there."""
    unstable = None
    for _ in range(MOST_SADDLES):
        start = descent.rest, descent.memory.copy(), descent.angles.copy()
        found = descent.approach()
        if not found:  # Newton's steps have gone astray
            descent.rest, descent.memory, descent.angles = start
            found = descent.balance() and descent.approach()
        if not found:
            if unstable is None:
                _refuse(descent)
            break
        *findings, way = _stability(descent)
        if way is None:
            return findings
        if unstable is None or not findings[0]:
            unstable = findings, descent.rest, descent.memory.copy(), descent.angles.copy()
        descent.kick(way)
        if not descent.balance():
            break
    findings, descent.rest, descent.memory, descent.angles = unstable
    return findings


def _stability(descent):
    """Whether stable, the smallest amended stiffness, number of neutral directions; and dq of growth, or None."""
    at, field = descent.motion, descent.field
    motion = Motion(at.packed, at.memory, at.t, at.q, at.qd)
    size = motion.packed.size or descent.reach
    rate = max(np.abs(motion.spins(1)).max(initial=0.0), np.linalg.norm(field.spin))
    if not is_invariant(motion, field.spin, size, rate):
        raise NoEquilibrium(
            "a configuration is balanced in the turning axes at this instant only: from axes that turn about "
            f"{field.spin} rad/s the scene doesn't look the same. Gravity, ground points, springs to the ground and "
            "rotors must be symmetric about the axis; about= moves it."
        )
    if not motion.freedom:
        return True, float("nan"), 0, None
    descent.report(0.7, f"balanced in {descent.steps} steps, {motion.freedom} coordinates are chosen for its stability")
    reduced = Reduced(motion, chosen(motion, Variations(motion, field.spin)))
    nothing = descent.nothing(reduced)
    descent.report(0.9, f"balanced in {descent.steps} steps, eigenvalues of {motion.freedom} coordinates")
    found, pairs = stiffnesses(reduced, nothing), eigenpairs(reduced, nothing)
    worst = int(pairs.values.real.argmax())
    if pairs.values.real[worst] <= GROWING * np.abs(pairs.values).max(initial=0.0):
        return True, found.smallest, found.neutral, None
    shape = pairs.vectors[:, worst]
    real = shape.real if np.linalg.norm(shape.real) >= np.linalg.norm(shape.imag) else shape.imag
    return False, found.smallest, found.neutral, reduced.T @ real


def demand_admitted(scene, rates, qd):
    """Refuse a spin that constraints don't admit, by the row; rates (m,) are Phi_q qd + Phi_t."""
    size = max(scene.packed.size, 1.0) * max(np.abs(qd).max(), LEAST_SHIFT)
    if not np.abs(rates).max(initial=0.0) <= STEADY * size:
        row = int(np.abs(rates).argmax())
        raise InconsistentState(
            f"equilibrium: {scene.row_names()[row]} doesn't admit this spin: Phi_q qd + Phi_t = {rates[row]:.3g}. "
            "Choose its axis, about= a point of it, or the rate that a motor has."
        )


def _refuse(descent):
    raise NoEquilibrium(
        f"no steady motion with this spin was found in {descent.steps} steps: {descent.rest.fastest} in the "
        "turning axes. Start nearer, with guess=, or change the rate."
    )
