"""Analyses of scenes with unilateral constraints: at a state as it stands, and along motions that leave them open."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..analyses.contact_problem import Inertia, NoSolution, closed_gaps, solve_contacts
from ..configuration.tolerances import INITIAL_TOL
from ..errors import InconsistentState, InvalidArgument, NoEquilibrium
from ..model.handles import first_rows
from ..model.kinematics import Anchor
from ..observables import reactions
from ..observables.state import RememberingState, State, StatePhase, remembered
from ..runs.task import state_arrays
from ..validation import finite_vector, listed, number
from .analyses import descend
from .contact_run import begun, demand_apart
from .grips import add_friction
from .phase_scenes import NAMED, at_start, dependent, gaps_of, inactive_of, named, phase_of
from .phases import UnitModes, shared_rows
from .scene_cache import prepared
from .termination import StageProgress

# What happens at a state is decided as a run from it does: contacts that are closed, at rest and push hold, the others
# are open.


def phase_at(scene: Any, state: Any, who: str) -> tuple[Any, RememberingState]:
    """The scene of the phase that a run begins with at a state, or at the start (None), and the state of that run.

    Refuses an impact.
    """
    run = begun(scene, 0.0 if state is None else number(getattr(state, "t", 0.0)), state)
    if run.phases.impulses:
        names = listed(list(dict.fromkeys(name for _, name, _ in run.phases.impulses)), NAMED)
        raise InconsistentState(
            f"{who}: velocities jump at this state, by the impact of {names}. Take the state after it, as "
            "ts.impact(scene, state) returns it."
        )
    angles, slots = run.remembered[: run.count], run.remembered[run.count :]
    levels = np.zeros_like(run.q), np.zeros(0)
    phase = run._scene()
    return phase, RememberingState.of(phase.packed, slots, Anchor(angles), run.t, run.q, run.qd, *levels)


def evaluate(scene, own, q=None, qd=None, t=0.0):
    """As of scenes without contacts: contacts closed at the start hold, frictions stick or slide as at this state."""
    if not any(getattr(force, "slides", ()) for force in scene._forces):
        return own(at_start(scene), q, qd, t)
    start, t = scene.start, number(t)
    q = finite_vector(start[0] if q is None else q, start[0].size, "q")
    qd = finite_vector(start[1] if qd is None else qd, start[0].size, "qd")
    return own(begun(scene, t, State(t, q, qd)).filled(), q, qd, t)


def linearise(scene, own, state=None, *arguments, **keywords):
    """As of scenes without contacts: contacts that push at the state hold."""
    return own(*phase_at(scene, state, "linearise"), *arguments, **keywords)


def along(scene, own, *arguments, **keywords):
    """`kinematics` or `inverse_dynamics` of the scene with open contacts; refuses a motion along which one is met."""
    who, motion, gaps = own.__name__, own(phase_of(scene, []), *arguments, **keywords), gaps_of(scene)
    for k, q in enumerate(motion.q):
        met = closed_gaps(gaps, q, motion.anchor.angles[k])
        if met:
            raise InvalidArgument(
                f"{who} takes contacts as open, and at t = {motion.t[k]:.9g} s this motion meets "
                f"{named(gaps.list[i].contact for i in met)}. Keep the "
                "motion off them, or hold them closed, in a scene with unilateral=False."
            )
    return motion


def set_start(scene, own, state=None, **keywords):
    """As of scenes without contacts; refuses a state that penetrates."""
    state = getattr(state, "state", state)
    q = scene.start[0] if state is None else state_arrays(state, scene.start[0].size)[0]
    _demand_apart(scene, state, q)
    own(phase_of(scene, []), state, **keywords)
    scene.touch()


class _Met(Exception):
    """Where the way to an equilibrium meets open contacts: the state there, and their gaps."""

    def __init__(self, state, gaps):
        super().__init__(gaps)
        self.state, self.gaps = state, gaps


class _Way:
    """Watches a descent with the open contacts: raises `_Met` before it goes on through them."""

    def __init__(self, gaps, closed):
        self.gaps, self.closed, self.before = gaps, closed, None

    def __call__(self, descent):
        q, angles = descent.rest.q, descent.angles
        values = self.gaps.at(q, angles)
        values[self.closed] = np.inf
        deep = np.flatnonzero(values < -INITIAL_TOL * (1.0 + np.abs(q).max()))
        if deep.size:
            shares = np.zeros(deep.size)  # of the step
            if self.before is not None:
                last, apart = self.before
                shares = np.clip(apart[deep] / (apart[deep] - values[deep]), 0.0, 1.0)
                q = descent.rest.closed(last + shares.min() * (q - last))
                q = last if q is None else q
            t, none = descent.t, np.zeros_like(q)
            state = RememberingState.of(descent.packed, descent.memory, Anchor(angles), t, q, none, none, none[:0])
            raise _Met(state, deep[shares <= shares.min() + INITIAL_TOL].tolist())
        self.before = q, values


def equilibrium(scene, own, guess=None, t=0.0, spin=None, about=(0.0, 0.0, 0.0), rotors=None, *, progress=None):
    """The `Equilibrium` with closed contacts that push and open ones that don't penetrate.

    Where frictions hold all that they act on, that which they hold; else without friction, from the contacts that are
    closed at the guess on: those that the way to the equilibrium meets are closed there, and those that would have to
    pull are opened.
    """
    gaps, kept = gaps_of(scene), prepared(phase_of(scene, []))
    frictions = [force for force in scene._forces if getattr(force, "slides", ())]
    if frictions or gaps.rough.any():
        _demand_still(frictions, gaps, spin, rotors)
        found = _held(scene, own, guess, t, spin, about, rotors, progress=progress)
        if found is not None:
            return found
    without = dependent(scene, (*inactive_of(scene), *frictions))
    q = scene.start[0] if guess is None else np.asarray(getattr(guess, "q", guess), float)
    closed, seen = closed_gaps(gaps, q, _angles(kept, guess, t, q)), set()
    with StageProgress(progress, "equilibrium") as report:
        while frozenset(closed) not in seen:
            phase = phase_of(scene, [gaps.list[i].side.gap for i in closed], without=without)
            try:
                found = descend(phase, guess, t, spin, about, rotors, report, _Way(gaps, closed))
            except _Met as met:
                closed, guess = sorted({*closed, *met.gaps}), met.state
                continue
            except NoEquilibrium as error:
                others = [gaps.names[i] for i in range(gaps.count) if i not in closed]
                raise NoEquilibrium(
                    f"{error} Open contacts carry no load: {listed(list(dict.fromkeys(others)), NAMED)}. Start where "
                    "those that are needed are closed, such as from the state of a run that has come to rest."
                    if others
                    else str(error)
                ) from None
            seen.add(frozenset(closed))
            state = found.state
            inertia = Inertia(gaps, float(t), state.q, state.memory, closed)
            try:
                contacts = solve_contacts(inertia, closed, state.qd)
            except NoSolution:
                break
            pushing = sorted([*contacts.closed, *contacts.idle])
            if pushing == closed:
                phase = phase_of(scene, [gaps.list[i].side.gap for i in contacts.closed], without=without)
                found.moved = float(np.abs(state.q - q).max())
                return _of_all(scene, found, gaps, phase, UnitModes(contacts.closed))
            guess, closed = state, pushing
    raise NoEquilibrium(
        "no set of closed contacts was found that push while the others stay open. Start nearer to the equilibrium, "
        "with guess=, such as from the state of a run that has come to rest."
    )


def _demand_still(frictions, gaps, spin, rotors):
    """Refuse friction of the exact law in steady motion."""
    if spin is not None or rotors is not None:
        items = [*frictions, *(gaps.list[i].contact for i in np.flatnonzero(gaps.rough))]
        raise InvalidArgument(
            f"equilibrium: a spin doesn't go with friction of the exact law ({named(items)}). "
            "Leave the friction out, or give slip_velocity (slip_rate of a torque), such as 1e-3 m/s."
        )


def _held(scene, own, guess, t, *arguments, **keywords):
    """The `Equilibrium` in which every friction holds what it acts on at the guess; None where one doesn't."""
    kept, n, t = prepared(phase_of(scene, [])), scene.start[0].size, number(t)
    if not np.isfinite(t):
        return None
    q = scene.start[0] if guess is None else finite_vector(getattr(guess, "q", guess), n, "guess")
    known = remembered(guess if hasattr(guess, "memory") else None, kept, t, q)
    anchor, slots = Anchor(known[: kept.handles.count]), known[kept.handles.count :]
    state = RememberingState.of(scene.packed, slots, anchor, t, q, *np.zeros((2, n)), np.zeros(0))
    for _ in range(2):  # where it stands; where what isn't held comes to rest
        try:
            run = begun(scene, t, state)
            phase = run.filled()
            state.packed, state.memory = phase.packed, run.remembered[run.count :]
            found = own(phase, state, t, *arguments, **keywords) if run.holds() else None
        except (InconsistentState, NoEquilibrium):
            return None
        if found is None:
            return None
        if not found.steps:
            found.moved = float(np.abs(found.state.q - q).max())
            return _of_all(scene, found, run.gaps, phase, run.modes)
        state = found.state
    return None


def _of_all(scene, found, gaps, phase, modes):
    """The same `Equilibrium` of a phase with multipliers of all rows of the scene."""
    state, t = found.state, np.array([found.state.t])
    levels = state.q[None], state.qd[None], state.qdd[None]
    lam = reactions.multipliers(phase.packed, t, *levels, state.memory[None])
    found.multipliers = np.zeros((1, len(scene.system.segments)))
    shared = rows, columns = shared_rows(scene.packed, phase.packed)
    found.multipliers[:, rows] = lam[:, columns]
    if modes.grips:
        add_friction(gaps, modes, phase.packed, shared, t, *levels[:2], state.memory[None], lam, found.multipliers)
    else:
        first = {id(part): row for part, row in first_rows(phase.packed.constraints)}
        for i in modes.closed:
            found.multipliers[:, gaps.rows[i]] = lam[:, first[id(gaps.list[i].side.gap)]]
    found.state = RememberingState.of(scene.packed, state.memory, state.anchor, *state[:4], found.multipliers[0])
    if phase.packed.derived.holds:
        inactive = tuple(item.name for item in inactive_of(scene))
        found.state.phase = StatePhase(inactive, {}, phase.packed, scene.packed)
    return found


def _angles(kept, state, t, q):
    return remembered(state if hasattr(state, "memory") else None, kept, float(t), q)[: kept.handles.count]


def _demand_apart(scene, state, q):
    kept = prepared(phase_of(scene, []))
    gaps, angles = gaps_of(scene), _angles(kept, state, getattr(state, "t", 0.0), q)
    demand_apart(gaps, gaps.at(q, angles), gaps.extent(q), INITIAL_TOL)
