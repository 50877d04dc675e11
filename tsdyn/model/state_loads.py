"""Samples of forces that depend on time by a function or a law of the user's, at states that stay the same."""

import dis

import numpy as np

from ..elements.loops.coordinate_rows import call_kind
from ..elements.loops.forces import INTS
from ..elements.loops.template import AT, DIMENSION
from ..jit.code_hash import is_ours
from ..jit.kernels import entry
from ..motions.state_program import may_change
from ..motions.tracing import Untraceable
from .equations import set_time


@entry
def _sample(s, q, qd, t, at, Q, out):
    """out (k,): sums of all forces on the coordinates `at`, at times t (k,); Q (n,): zeros.

    Weights 1 + 0.37 j: forces that cancel in a plain sum, such as those on both ends of a load, don't.
    """
    set_time(s, t[0])
    for i in range(t.size):
        for j in range(s.forces.shape[0]):
            kind = s.forces[j]
            call_kind(kind.force, kind.count, kind.stride, s.table[kind.table :], s.reals[kind.reals :], q, qd, t[i], Q)
        total = 0.0
        for j in range(at.size):
            total += (1.0 + 0.37 * j) * Q[at[j]]
            Q[at[j]] = 0.0
        out[i] = total


def is_of_user(item):
    """Whether the law of a force, or a function of time and state in it, is a user's."""
    return hasattr(item, "function_of_state") or not is_ours(type(item).__module__)


def changes_with_state(load):
    """Whether the law of a `Load` is a user's, and may change within any part of a step."""
    force = load.force
    if not is_of_user(force) or "normal_load" in force.kernels:
        return False
    try:
        return not hasattr(force.kernels, "program") or may_change(force.kernels.program(len(load.parameters)))
    except Untraceable:
        return True


def depends_on_time(force):
    """Whether what a user has written for a force reads the time."""
    function, place = (force.function_of_state, 0) if hasattr(force, "function_of_state") else (type(force).law, 3)
    code = getattr(function, "py_func", function).__code__
    t = code.co_varnames[place]
    read = [each.argval for each in dis.get_instructions(code) if "LOAD" in each.opname]  # pairs in some versions
    return any(t == name or (isinstance(name, tuple) and t in name) for name in read)


def user_kinds(packed):
    """The rows of System.forces that run what a user has written: their numbers, a force of each."""
    return [(i, load.force) for i, load in enumerate(_first(packed)) if is_of_user(load.force)]


def _first(packed):
    """A `Load` of each row of System.forces."""
    first = {(one.force, one.stride): load for load in reversed(packed.loads) for one in load.alone}
    return [first[row.force, row.stride] for row in packed.system.forces]


def _spans(system, row):
    """Where the coordinates begin that the forces of a kind act on, and how many they are, (k, 2)."""
    places = system.table[row.table : row.table + row.count * INTS].reshape(-1, INTS)
    return np.column_stack((places[:, AT : AT + 2].ravel(), places[:, DIMENSION : DIMENSION + 2].ravel()))


def watched_loads(packed):
    """Rows of System.forces that are sampled along steps (k,), and the bodies that they act on (nb,)."""
    rows = [i for i, load in enumerate(_first(packed)) if changes_with_state(load)]
    found = [_spans(packed.system, packed.system.forces[i]) for i in rows]
    begins = np.unique([begin for spans in found for begin, size in spans if size])
    bodies = np.searchsorted(packed.system.bodies[:, 0], begins)
    return np.array(rows, np.int64), bodies.astype(np.int64)


def sampled_loads(packed, kinds, t):
    """Titles of the forces of each kind, and their sums (k,) at times t (k,): at the bodies' start, and nearby.

    At the start a force may be zero at all times that is not so in motion. Nearby all coordinates differ by up to a
    half, of any unit; where the function is not finite there, that state is left out.
    """
    system, found = packed.system, []
    if not kinds:
        return found
    q, qd = (np.concatenate([getattr(body, x) for body in packed.bodies]) for x in ("q", "qd"))
    near = 0.5 * np.cos(np.arange(q.size))
    for i, force in kinds:
        spans = _spans(system, system.forces[i])
        at = np.unique(np.concatenate([np.arange(begin, begin + size) for begin, size in spans]))
        own = system._replace(forces=system.forces[i : i + 1], reals=system.reals.copy())
        for move in (0.0, near):
            out = np.empty(t.size)
            _sample(own, q + move, qd + move, t, at, np.zeros(q.size), out)
            if move is not near or np.isfinite(out).all():
                found.append((force.title, out))
    return found
