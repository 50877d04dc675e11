"""Generalised forces along a trajectory, (k, n); which forces are not finite, or raise an exception."""

from typing import NamedTuple

import numpy as np

from ..elements.bodies import transform_g
from ..elements.element import AngleGeometry, to_ground
from ..elements.laws import SceneLaw
from ..elements.loads import STATE, ByState
from ..jit.kernels import entry
from ..model.equations import added_inertia, applied_forces, recall, set_time
from ..model.handles import BodyMotion, angle, displacement, handles_of
from ..model.laws import interrupts_answered
from ..model.packed import no_system
from ..motions.signals import Signal
from ..validation import counted

# Generalised forces along a trajectory, (k, n): applied forces Q_A, velocity forces Q_v, and M qdd.


@entry(no_system(), "vmmmm")
def sum_forces(s, t, q, qd, memory, out):
    """out (k, n) += all forces but gravity; memory (k, ...): of forces at each output, then normal loads."""
    for row in range(t.size):
        set_time(s, t[row])
        recall(s, memory[row])
        for i in range(memory.shape[1] - s.memory.size):
            s.reals[s.normals[i]] = memory[row, s.memory.size + i]
        applied_forces(s, q[row], qd[row], t[row], out[row])


def force_loads(system, t, q, qd, memory=None):
    """Forces without gravity (k, n); without forces no kernel is loaded."""
    out = np.zeros_like(q)
    if len(system.forces):
        system = system._replace(reals=system.reals.copy())  # signals and memory are written to
        memory = np.tile(system.reals[system.memory], (t.size, 1)) if memory is None else memory
        with interrupts_answered():
            sum_forces(system, t, q, qd, memory, out)
    return out


def applied_loads(system, t, q, qd, memory=None):
    """Q_A (k, n): forces and gravity."""
    Q = force_loads(system, t, q, qd, memory)
    Q[:, _places(system, 0, 3)] += system.mass[:, None] * system.gravity
    return Q


def velocity_forces(system, q, qd):
    """Q_v (k, n): 8 Gd^T J' Gd p on p, and -h^T gamma_h of inertia rows."""
    S, at = np.zeros_like(q), _places(system, 3, 7)
    if at.size:
        S[:, at] = 8.0 * _turned(qd[:, at], system, q[:, at])
    for columns, h, gamma in added_inertia(system, q, qd):
        S[:, columns] -= gamma[:, None] * h
    return S


def inertial_forces(system, q, qdd):
    """M qdd (k, n): m rdd on r, 4 G^T J' G pdd on p, and h^T h qdd of inertia rows."""
    f, at = np.zeros_like(q), _places(system, 0, 3)
    f[:, at] = system.mass[:, None] * qdd[:, at]
    at = _places(system, 3, 7)
    if at.size:
        f[:, at] = 4.0 * _turned(q[:, at], system, qdd[:, at])
    for columns, h, _ in added_inertia(system, q, np.zeros_like(q)):
        f[:, columns] += (h * qdd[:, columns]).sum(axis=1)[:, None] * h
    return f


def _places(system, first, end):
    """Return the indices of coordinates first to end of each body that has them, (b, end - first)."""
    bodies = system.bodies[system.bodies[:, 1] >= end, :1]
    return bodies + np.arange(first, end)


def _turned(p, system, x):
    """G(p)^T J' G(p) x of the rigid bodies; p, x (k, b, 4)."""
    G, J = transform_g(p), system.inertia[system.bodies[:, 1] == 7].reshape(-1, 3, 3)
    y = np.einsum("kbij,kbj->kbi", G, x)
    return np.einsum("kbji,kbj->kbi", G, np.einsum("bij,kbj->kbi", J, y))


def law_values(motion, load, memory):
    """The values (k, values) of the function of a law of the whole scene; memory (k, slots) of forces."""
    law = load.law
    if law.held:
        return memory[:, load.slot : load.slot + law.values].copy()
    rows = zip(motion.t.tolist(), motion.q, motion.qd, motion.angles, strict=True)
    found = [law.evaluate(t, q.copy(), qd.copy(), angles, load.parameters) for t, q, qd, angles in rows]
    return np.reshape(found, (motion.t.size, law.values))


# What a user's function of a force raises at a state: kernels make nan of it, plain Python says which exception.


def raised(packed, force, t, q, qd):
    """The exception that a function of a force raises at a state; None where it raises none."""
    if isinstance(force, SceneLaw):
        return _raised_by_law(packed, force, t, q, qd)
    for name in type(force).loads:
        given, arguments = getattr(force, name, None), (float(t),)
        if isinstance(given, Signal) and given.is_function:
            function = given.source
        elif isinstance(force, ByState) and name == force.given:
            function, arguments = _with_state(packed, force, float(t), (q, qd))
        else:
            continue
        try:
            with np.errstate(all="ignore", divide="raise"):
                function(*arguments)
        except FloatingPointError as error:  # of NumPy's numbers, where kernels raise Python's exception
            return ZeroDivisionError(str(error)).with_traceback(error.__traceback__)
        except Exception as error:
            return error
    return None


def _raised_by_law(packed, force, t, q, qd):
    handles, law = handles_of(packed), next(load.law for load in packed.loads if load.force is force)
    try:
        with np.errstate(all="ignore"):
            law.evaluate(float(t), q.copy(), qd.copy(), handles.angles_at_start(t, q), force.parameters())
    except Exception as error:
        return error
    return None


def _with_state(packed, force, t, levels):
    """The function of a force by state, and its arguments but for the time, as kernels give them."""
    handles, function = handles_of(packed), force.function_of_state
    if hasattr(force, "geometry"):
        pair = handles.motions(force.geometry, levels)
        evaluate = angle if isinstance(force.geometry, AngleGeometry) else displacement
        return function, (t, *(float(evaluate(force.geometry, *pair, level)) for level in (0, 1)))
    ends = ((force.a, force.point_a), (force.b, getattr(force, "point_b", None)))[: force.arguments.count(STATE)]
    states = [_state(BodyMotion(*handles.where(body), levels), point) for body, point in ends]
    if force.has_numbers:
        return function, (t, *states, np.array(force.parameters()), np.zeros(force.given_numbers))
    return function, (t, *states)


def _state(motion, point):
    """Position and velocity of a point, Euler parameters and angular velocity of its body, (13,)."""
    s = tuple(float(x) for x in point)
    return np.concatenate((motion.point(s, 0), motion.p, motion.point(s, 1), to_ground(motion.p, motion.turning(1))))


# Which forces are not finite, raise an exception or change at once: what a run that ends there can name.

FEW = 3  # forces named in a message


class NotFinite(NamedTuple):
    """What there is to say, "" for nothing, and the exception of a user's function that is behind it, or None."""

    said: str
    cause: Exception | None


def not_finite(packed, t, q, qd, slots):
    """Which forces give inf or nan at a state, a `NotFinite`; slots: what forces remember."""
    state = np.array([t]), q[None], qd[None], np.asarray(slots, float)[None]
    with np.errstate(all="ignore"):
        struck = _struck(packed, force_loads(packed.system, *state)[0])
        forces = [load.force for load in packed.loads if _strikes(packed, load, struck, state)]
    found = [force.name for force in forces]
    if not found:
        return NotFinite("", None)
    for force in forces[:FEW]:
        error = raised(packed, force, t, q, qd)
        if error is not None:
            said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
            return NotFinite(f"The function of {force.name!r} raises {said.rstrip('.')}, at t = {t:.9g} s.", error)
    more = f" and {counted(len(found) - FEW, 'other force')}" if len(found) > FEW else ""
    verb = "is" if len(found) == 1 else "are"
    return NotFinite(f"{', '.join(map(repr, found[:FEW]))}{more} {verb} inf or nan at t = {t:.9g} s.", None)


def jumping(packed, t, q, qd, slots, lengths):
    """Names of the forces that change by as much within the shorter one of two lengths (m or rad) on both sides of q.

    Along qd, or all coordinates at rest. A smooth force changes in proportion to the length.
    """
    step = qd / np.abs(qd).max() if qd.any() else np.ones(q.size)
    places = np.array([q + side * length * step for length in lengths for side in (-1.0, 1.0)])
    state = np.full(4, t), places, np.tile(qd, (4, 1)), np.tile(np.asarray(slots, float), (4, 1))
    found = []
    for load in packed.loads:
        with np.errstate(all="ignore"):
            Q = force_loads(packed.system._replace(forces=load.alone), *state)
        near, far = np.abs(Q[1::2] - Q[::2]).max(axis=1)
        if near > 0.5 * far and near > 0.5 * np.abs(Q).max():
            found.append(load.force.name)
    return found


def _struck(packed, Q):
    """The bodies on which the sum of the forces is not finite, by id."""
    bad = ~np.isfinite(Q)
    return {
        id(body) for body, (at, n) in zip(packed.bodies, packed.system.bodies, strict=True) if bad[at : at + n].any()
    }


def _strikes(packed, load, struck, state):
    """Whether a force is not finite; forces on other bodies than those struck aren't evaluated."""
    if not struck.intersection(map(id, load.force.bodies)):
        return False
    return not np.isfinite(force_loads(packed.system._replace(forces=load.alone), *state)).all()
