"""`scene.equilibrium`: static and relative equilibria by descent of the energy, their stability and reactions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting_methods
from ..configuration.tolerances import MOST_ROTATION
from ..errors import InconsistentState, InvalidForce, NoEquilibrium, SingularConfiguration
from ..jit.interrupts import interruptible
from ..maths.tolerances import HALF_DIGITS, NEGLIGIBLE, PIVOT_ROUNDING, ROUNDING, SUM_ROUNDING, TINY
from ..model.kinematics import Anchor
from ..observables import reactions
from ..observables.generalised_forces import force_loads, velocity_forces
from ..observables.reactions import singular_place
from ..observables.state import RememberingState
from . import tolerances as limits
from .coordinates import Variations, chosen
from .moves import Moves
from .nominal_motion import NominalMotion
from .reduction import eigenpairs, equations, stiffnesses
from .steady import SteadyRest, is_invariant

if TYPE_CHECKING:
    from ..hints import BodyLike, Floats, ItemLike


# Loads without derivatives at a state are refused by name: jumps, kinks, sampled loads, friction of moving joints.


def demand_continuous(packed, but=()):
    """Refuse sampled loads, which are held whatever the scene does; those of some forces don't count."""
    for load in packed.loads:
        held = getattr(load.force, "period", None) is not None
        if held and not any(load.force is force for force in but):
            raise InvalidForce(
                f"{load.force.name}: a sampled load is no function of the state, so it has neither a derivative nor an "
                "equilibrium. Take a continuous one (without period=), or remove it and name its joint as an input."
            )


def demand_smooth(motion):
    """Refuse forces that can't be linearised at a `Motion`."""
    loads = motion.packed.loads
    demand_continuous(motion.packed)
    if motion.packed.loads and _rough(motion, motion.system.forces):
        worst = [load.force.name for load in loads if _rough(motion, load.alone)]
        raise InvalidForce(
            f"{', '.join(worst) or 'the forces'}: the force has a jump or a kink at this state, so it has no "
            "derivative. Choose another state, or a smooth law."
        )


def _rough(motion, forces):
    """Whether some forces differ on both sides of the state by other than a slope."""
    system, rng = motion.system._replace(forces=forces), np.random.default_rng(0)
    size = motion.packed.size or 1.0
    scale = np.ones(motion.q.size)
    scale[(motion.system.bodies[:, :1] + np.arange(3)).ravel()] = size
    t, memory = np.full(3, motion.t), np.tile(motion.memory, (3, 1))
    for place, speed in ((1.0, 0.0), (0.0, 1.0)):
        way = HALF_DIGITS * scale * rng.normal(size=motion.q.size)
        side = np.array([-1.0, 0.0, 1.0])[:, None]
        Q = force_loads(system, t, motion.q + place * side * way, motion.qd + speed * side * way, memory)
        if not np.isfinite(Q).all():
            return True
        bend, slope = np.abs(Q[0] - 2.0 * Q[1] + Q[2]).max(), np.abs(Q[2] - Q[0]).max()
        if bend > limits.ROUGH * slope + NEGLIGIBLE * np.abs(Q).max():
            return True
    return False


# Newton's increment where the stiffness is not positive, with the signs of its negative eigenvalues changed.
#
#     K v = lambda S v,  v.S v = 1,  A v = 0:        u = sum of v (v.load) / |lambda|
#
# S is the stiffness of each body by its size. The increment leads down along all eigenvectors, whereas Newton's leads
# to the saddle (Dauphin et al., Adv. Neural Inf. Process. Syst. 27, 2014). A shift of K would slow soft directions
# down.


def saddle_free(factors, load):
    """The increment u, by the `Factors` at mu = 0; None where there are too many negative eigenvalues."""
    if load.size <= limits.SMALL:
        return _by_all(factors, load)
    if factors.negative > limits.FEW_NEGATIVE:
        return None
    return _by_few(factors, load)


def _by_all(factors, load):
    """By all eigenvectors, dense."""
    K, A = factors.dense()
    Z = np.linalg.qr(A.T, mode="complete")[0][:, len(A) :]
    w, v = np.linalg.eigh(0.5 * Z.T @ (K + K.T) @ Z)
    v, scale = Z @ v, factors.scale
    along = v.T @ (scale * load)
    along[(np.abs(w) <= limits.SOFT) & (np.abs(along) <= PIVOT_ROUNDING * factors.size_of_loads)] = 0.0  # neutral
    return scale * (v @ (along / np.maximum(np.abs(w), HALF_DIGITS)))


def _by_few(factors, load):
    """By Newton's increment and the eigenvectors of negative eigenvalues, by shifted inverse Lanczos iteration."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    newton, shift = factors.newton(load), factors.positive_shift()
    if newton is None or shift is None:
        return None
    size, solve = load.size, factors.solver(shift)
    K = LinearOperator((size, size), factors.stiffness)
    inverse = LinearOperator((size, size), solve)
    try:
        w, v = eigsh(K, factors.negative, sigma=-shift, OPinv=inverse, v0=solve(np.ones(size)), tol=1e-6)
    except ArpackError:
        return None
    v, w = v[:, w < 0.0], w[w < 0.0]
    scale = factors.scale
    return newton + scale * (v @ (2.0 * (v.T @ (scale * load)) / np.maximum(-w, HALF_DIGITS)))


# Descent of the potential energy on the constraint manifold, to a static equilibrium.
#
#     [ K + mu D    A^T ] [ u    ]     [ Q - A^T lam ]
#     [ A           0   ] [ dlam ]  =  [ 0           ]        K = (Phi_q^T lam)_q - Q_q by increments u
#
# With mu = 0 steps are Newton's. They are taken from the start on where K is positive on the motions that the
# constraints admit. Elsewhere the signs of negative eigenvalues are changed, or mu grows until K + mu D is positive: no
# step leads up to a saddle, and one that is close is left along a direction of negative stiffness. The method is
# Levenberg's, with the multipliers in the second derivatives as in sequential quadratic programming (Nocedal and
# Wright, Numerical Optimization, 2006, ch. 18).


class Descent(Moves):
    """A configuration at rest, moved step by step; arguments of `Moves`."""

    relative = False  # whether what has no positive stiffness may be stable all the same
    watch = None  # called with the descent at its start and after each step; what it raises ends the way

    def __init__(self, *start):
        super().__init__(*start)
        self.steps, self.mu = 0, limits.FIRST_MU

    def report_steps(self):
        """Report progress: digits gained over digits required."""
        left = self.unbalanced
        digits = np.log(left) / np.log(SUM_ROUNDING) if left > 0.0 else 1.0
        self.report(
            limits.SEARCH * min(max(digits, 0.0), 1.0), f"{self.steps} steps, {left:.1e} of the loads are not balanced"
        )

    def balance(self):
        """Take steps until the loads are balanced to rounding; True if they are."""
        vain = 0
        while (
            self.steps < limits.MOST_STEPS
            and self.gone < limits.FARTHEST * self.reach
            and self.turned < limits.MOST_TURNED
        ):
            before = self.unbalanced
            self.report_steps()
            if self.watch is not None:
                self.watch(self)
            if before <= SUM_ROUNDING or not self._step():
                break
            self.steps += 1
            vain = vain + 1 if before <= limits.ACCEPTED and not self.unbalanced < 0.5 * before else 0
            if vain == limits.IN_VAIN:
                break  # rounding
        return self.unbalanced <= limits.ACCEPTED

    def _step(self):
        """Take a step; False if no step is left along which the loads do work."""
        quadratic, load = self.rest.quadratic, self.rest.left
        near = self.unbalanced <= limits.AT_SADDLE
        if near and (self.relative or quadratic.circulatory):
            u = quadratic.factors(0.0, 0.0).newton(load)
            if u is not None and self.approach_by(u):
                return True
        mu = 0.0
        for _ in range(limits.MOST_TRIES):
            factors = quadratic.factors(mu, self._least(mu))
            if factors.positive:
                u = factors.step(load) if mu > 0.0 else factors.newton(load)
                if u is not None and self.size(u) <= ROUNDING:
                    return False
                if u is not None and self._is_fit(u, mu):
                    leaves = near and mu > 0.0 and not self.relative
                    if (leaves and self._leave(factors, u)) or self.advance(u, factors):
                        self.mu = max(mu * limits.SOFTER, limits.LEAST_MU) if mu > 0.0 else self.mu
                        return True
                    if self.size(u) <= limits.FINAL:
                        return False
            elif mu == 0.0 and factors.negative > 0:
                u = saddle_free(factors, load)
                if u is not None and self.length(u) <= limits.TOO_FAR * self.trust and self.advance(u, factors):
                    return True
            mu = max(mu * limits.STIFFER, self.mu)
        return False

    def _least(self, mu):
        """Stiffness, N m, that replaces K where there is none, and where D doesn't suffice."""
        stiffness = self.rest.quadratic.local.max(initial=0.0)
        if stiffness == 0.0:
            return limits.SLIDING * np.abs(self.rest.left).max() * max(mu, 1.0)
        return mu * stiffness if mu > limits.STIFF else 0.0

    def _is_fit(self, u, mu):
        """Whether an increment is short enough to be tried; a larger mu makes it shorter."""
        slides = self.trust == 1.0 and self.increments.extent(u)[1] <= limits.TOO_FAR * MOST_ROTATION
        return (
            slides or mu >= 1.0 or self.length(u) <= limits.TOO_FAR * self.trust or not self.rest.quadratic.shift.any()
        )

    def _leave(self, factors, step):
        """Leave a saddle nearby along a direction of negative stiffness, if that gains more than a step."""
        quadratic, load = self.rest.quadratic, self.rest.left
        u = factors.downhill(load, np.random.default_rng(self.steps))
        if u is None:
            return False
        u = u / self.size(u)
        if not -(limits.KICKS[0] ** 2) * quadratic.along(u) > 2.0 * float(load @ step) - quadratic.along(step):
            return False
        return any(self.attempt(share * u, factors) for share in limits.KICKS)

    def kick(self, way):
        """Leave a saddle along a direction dq by a tenth of a radian, or of the size."""
        rest = self.rest
        u = self.increments.of(rest.q, way)
        for share in limits.KICKS:
            q = rest.closed(self.increments.moved(rest.q, share / self.size(u) * u))
            if q is not None:
                self.rest = self._at(q)
                self.remember()
                break


# Relative equilibria: configurations that a steady spin keeps, their stability with gyroscopic terms.
#
# With qd = D (q - c) the loads that are not balanced are Q_A + Q_v - M D D (q - c) - Phi_q^T lam, and their stiffness
# is
#
#     K = M D D - C* D + K*        C* = (Q_A + Q_v)_qd,    K* = (M qdd - Q_A - Q_v)_q + (Phi_q^T lam)_q
#
# Newton's method goes to the nearest root. One that is not stable is left by `SteadyDescent`, on the amended
# potential V - Omega . J Omega / 2 (Simo, Lewis, Marsden 1991).


class SteadyMotion(NominalMotion):
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
        for _ in range(limits.MOST_NEWTON):
            before, rest = self.unbalanced, self.rest
            self.report_steps()
            if before <= SUM_ROUNDING:
                break
            u = rest.quadratic.factors(0.0, 0.0).newton(rest.left)
            if u is None:
                break
            self.steps += 1
            if not self.approach_by(u):
                break
        return self.unbalanced <= limits.ACCEPTED


def find_steady(descent):
    """The findings of a relative equilibrium, the descent being moved there."""
    unstable = None
    for _ in range(limits.MOST_SADDLES):
        start = descent.rest, descent.memory.copy(), descent.angles.copy()
        found = descent.approach()
        if not found:  # Newton's steps have gone astray
            descent.rest, descent.memory, descent.angles = start
            found = descent.balance() and descent.approach()
        if not found:
            if unstable is None:
                _refuse_spin(descent)
            break
        *findings, way = _stability_of_spin(descent)
        if way is None:
            return findings
        if unstable is None or not findings[0]:
            unstable = findings, descent.rest, descent.memory.copy(), descent.angles.copy()
        descent.kick(way)
        if not descent.balance():
            break
    findings, descent.rest, descent.memory, descent.angles = unstable
    return findings


def _stability_of_spin(descent):
    """Whether stable, the smallest amended stiffness, number of neutral directions; and dq of growth, or None."""
    at, field = descent.motion, descent.field
    motion = NominalMotion(at.packed, at.memory, at.t, at.q, at.qd)
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
    reduced = equations(motion, chosen(motion.placed, Variations(motion, field.spin)))
    nothing = descent.nothing(reduced)
    descent.report(0.9, f"balanced in {descent.steps} steps, eigenvalues of {motion.freedom} coordinates")
    found, pairs = stiffnesses(reduced, nothing), eigenpairs(reduced, nothing)
    worst = int(pairs.values.real.argmax())
    if pairs.values.real[worst] <= HALF_DIGITS * np.abs(pairs.values).max(initial=0.0):
        return True, found.smallest, found.neutral, None
    shape = pairs.vectors[:, worst]
    real = shape.real if np.linalg.norm(shape.real) >= np.linalg.norm(shape.imag) else shape.imag
    return False, found.smallest, found.neutral, reduced.T @ real


def demand_admitted(scene, rates, qd):
    """Refuse a spin that constraints don't admit, by the row; rates (m,) are Phi_q qd + Phi_t."""
    size = max(scene.packed.size, 1.0) * max(np.abs(qd).max(), TINY)
    if not np.abs(rates).max(initial=0.0) <= HALF_DIGITS * size:
        row = int(np.abs(rates).argmax())
        raise InconsistentState(
            f"equilibrium: {scene.row_names()[row]} doesn't admit this spin: Phi_q qd + Phi_t = {rates[row]:.3g}. "
            "Choose its axis, about= a point of it, or the rate that a motor has."
        )


def _refuse_spin(descent):
    raise NoEquilibrium(
        f"no steady motion with this spin was found in {descent.steps} steps: {descent.rest.fastest} in the "
        "turning axes. Start nearer, with guess=, or change the rate."
    )


# `scene.equilibrium`: a static equilibrium, its stability and reactions.


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
        if np.isnan(self.smallest_stiffness):
            return f"<Equilibrium: {kind}, nothing can move>"
        if neutral and self.smallest_stiffness == 0.0:
            return f"<Equilibrium{moving}: {kind}{neutral}>"
        which = "smallest other stiffness" if neutral else "smallest stiffness"
        return f"<Equilibrium{moving}: {kind}{neutral}, {which} {self.smallest_stiffness:.4g} 1/s^2>"


def find_equilibrium(packed, handles, remembered, t, q, q0, report, watch=None):
    """The `Equilibrium` reached from a consistent q, q0 being where the search began; report(fraction, said).

    watch: of the `Descent`.
    """
    demand_continuous(packed)
    descent = Descent(packed, handles, remembered, t, q, report)
    descent.watch = watch
    _demand_held(descent.frame)
    for _ in range(limits.MOST_SADDLES):
        if not descent.balance():
            _refuse(descent)
        place = singular_place(packed, descent.motion.q)
        if place:
            raise SingularConfiguration(
                f"equilibrium: the way down ends in a singular configuration: {place}. Start nearer to another "
                "equilibrium, with guess=, or add what holds it."
            )
        demand_smooth(descent.motion)
        *findings, way = _stability(descent)
        if way is None:
            break
        descent.kick(way)
    return Equilibrium(descent, q0, findings)


def find_relative(packed, handles, remembered, t, q, q0, field, report):
    """The same in steady motion with the velocities of a `SteadyField`."""
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
    every = chosen(motion.placed, Variations(motion, np.zeros(3)))
    descent.report(0.8, f"balanced in {descent.steps} steps, the stiffness is reduced to {motion.freedom} coordinates")
    reduced = equations(motion, every, descent.unbalanced <= NEGLIGIBLE)
    nothing = descent.nothing(reduced)
    descent.report(0.9, f"balanced in {descent.steps} steps, eigenvalues of {motion.freedom} coordinates")
    found = stiffnesses(reduced, nothing)
    smallest = found.smallest
    if not found.symmetric:
        values = eigenpairs(reduced, nothing).values
        return bool(values.real.max() <= HALF_DIGITS * np.abs(values).max()), smallest, found.neutral, None
    if smallest >= 0.0:
        return True, smallest, found.neutral, None
    from scipy.linalg import eigh

    K_s = 0.5 * (reduced.K_hat + reduced.K_hat.T)
    softest = interruptible(lambda: eigh(K_s, subset_by_index=[0, 0])[1])
    return False, smallest, found.neutral, reduced.way(softest[:, 0])


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
