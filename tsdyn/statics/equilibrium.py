"""`scene.equilibrium`: a static equilibrium, its stability and reactions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting_methods
from ..errors import NoEquilibrium
from ..jit.interrupts import interruptible
from ..observables import reactions
from ..observables.kinematics import Anchor
from ..observables.state import RememberingState
from .coordinates import chosen
from .descent import Descent
from .eigen import eigenpairs, stiffnesses
from .reduction import Reduced
from .smoothness import demand_continuous, demand_smooth
from .tolerances import GROWING, MOST_SADDLES, SETTLED
from .variations import Variations

if TYPE_CHECKING:
    from ..hints import BodyLike, Floats, ItemLike


@fitting_methods
class Equilibrium:
    """A static equilibrium, or one relative to axes that turn steadily; the scene is as it was.

    Attributes
    ----------
    state : State
        At rest, or in steady motion: `simulate(scene, span, state=report.state)` stays so,
        `scene.linearise(report.state)` has its modes.
    stable : bool
        No direction has negative stiffness, the potential energy being a minimum. In steady motion, or with loads that
        have no potential: no eigenvalue has a positive real part. Neutral directions don't count.
    smallest_stiffness : float, 1/s^2
        Of the reduced stiffness in the metric of kinetic energy, neutral directions left out: the square of the lowest
        angular frequency that isn't zero; negative if unstable, zero if all directions are neutral, NaN without
        freedom. In steady motion centrifugal terms are in it, but no gyroscopic ones, which may stabilise.
    neutral : int
        Number of directions without stiffness, in which the scene may turn or slide freely: what they have is rounding
        of the terms that the stiffness is a sum of, or due to `unbalanced`.
    moved : float
        Largest change of a coordinate from the start: m for positions, 1 for Euler parameters.
    rotation_rate : ndarray (3,), rad/s
        Of a steady motion, ground frame; zero at rest.
    unbalanced : float
        Largest acceleration left, over that of the loads by themselves.
    steps : int
    """

    def __init__(self, descent: Any, q0: Any, findings: Any, spin: Any = None) -> None:
        motion, packed = descent.motion, descent.packed
        t, levels = np.array([descent.t]), (motion.q[None], motion.qd[None], motion.accelerations[None])
        self.multipliers: Floats = reactions.multipliers(packed, t, *levels, descent.memory[None])
        arrays = descent.t, motion.q.copy(), motion.qd.copy(), levels[2][0].copy(), self.multipliers[0]
        self.state: RememberingState = RememberingState.of(
            packed, descent.memory.copy(), Anchor(descent.angles.copy()), *arrays
        )
        self.rotation_rate: Floats = np.zeros(3) if spin is None else spin
        self.stable, self.smallest_stiffness, self.neutral = findings
        self.moved, self.unbalanced, self.steps = float(np.abs(motion.q - q0).max()), descent.unbalanced, descent.steps

    def reaction(self, item: ItemLike, on: BodyLike | None = None) -> tuple[Floats, Floats]:
        """Force (3,), N, and torque (3,), N m, of a constraint, joint or force, as `Solution.reaction` defines them."""
        return self.state.reaction(item, on)

    def __repr__(self) -> str:
        kind = "stable" if self.stable else "unstable"
        neutral = f", {self.neutral} neutral" if self.neutral else ""
        moving = " in steady motion" if self.state.qd.any() else ""
        if neutral and self.smallest_stiffness == 0.0:
            return f"<Equilibrium{moving}: {kind}{neutral}>"
        which = "smallest other stiffness" if neutral else "smallest stiffness"
        return f"<Equilibrium{moving}: {kind}{neutral}, {which} {self.smallest_stiffness:.4g} 1/s^2>"


def find_equilibrium(packed, handles, remembered, t, q, q0, report):
    """The `Equilibrium` reached from a consistent q, q0 being where the search began; report(fraction, said)."""
    demand_continuous(packed)
    descent = Descent(packed, handles, remembered, t, q, report)
    _demand_held(descent.frame)
    for _ in range(MOST_SADDLES):
        if not descent.balance():
            _refuse(descent)
        demand_smooth(descent.motion)
        *findings, way = _stability(descent)
        if way is None:
            break
        descent.kick(way)
    return Equilibrium(descent, q0, findings)


def find_relative(packed, handles, remembered, t, q, q0, field, report):
    """The same in steady motion with the velocities of a `SteadyField`."""
    from .relative_equilibrium import SteadyDescent, find_steady

    demand_continuous(packed)
    descent = SteadyDescent(field, packed, handles, remembered, t, q, report)
    findings = find_steady(descent)
    demand_smooth(descent.motion)
    return Equilibrium(descent, q0, findings, field.spin)


def _stability(descent):
    """Whether stable, the smallest stiffness, number of neutral directions; and dq of negative stiffness, or None."""
    motion = descent.motion
    if not motion.freedom:
        return True, float("nan"), 0, None
    descent.report(0.7, f"balanced in {descent.steps} steps, {motion.freedom} coordinates are chosen for its stability")
    every = chosen(motion, Variations(motion, np.zeros(3)))
    descent.report(0.8, f"balanced in {descent.steps} steps, the stiffness is reduced to {motion.freedom} coordinates")
    reduced = Reduced(motion, every, descent.unbalanced <= SETTLED)
    nothing = descent.nothing(reduced)
    descent.report(0.9, f"balanced in {descent.steps} steps, eigenvalues of {motion.freedom} coordinates")
    found = stiffnesses(reduced, nothing)
    smallest = found.smallest
    if not found.symmetric:
        values = eigenpairs(reduced, nothing).values
        return bool(values.real.max() <= GROWING * np.abs(values).max()), smallest, found.neutral, None
    if smallest >= 0.0:
        return True, smallest, found.neutral, None
    from scipy.linalg import eigh, solve_triangular

    K_s = 0.5 * (reduced.K_hat + reduced.K_hat.T)
    softest = interruptible(lambda: eigh(K_s, subset_by_index=[0, 0])[1])
    way = reduced.T @ solve_triangular(reduced.R, softest[:, 0])
    return False, smallest, found.neutral, way


def _demand_held(frame):
    """Refuse scenes of which a part falls, by name."""
    falling = frame.falling()
    if falling.size:
        name = frame.packed.bodies[int(falling[0])].name
        others = f", joined to {falling.size - 1} more," if falling.size > 1 else ""
        raise NoEquilibrium(
            f"no equilibrium: {name}{others} falls freely, as no constraint and no force joins it to the ground. Add "
            "one, or take gravity away."
        )


def _refuse(descent):
    """Say why none was found."""
    raise NoEquilibrium(
        f"no equilibrium was found in {descent.steps} steps and {descent.gone:.3g} m of way: {descent.rest.fastest}. "
        "If nothing holds it, add a constraint or a spring; if a load drives it on, "
        "there is none; otherwise start nearer, with guess=."
    )
