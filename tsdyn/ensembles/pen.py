"""Numbers of a case, written straight into the arrays of an arena.

Each parameter has a function that writes a value, or finds that it can't: the case is then entered as a packed scene,
which says what is wrong with it.
"""

import math

import numpy as np

from ..elements.bodies import PointMass
from ..elements.element import checked_parameters
from ..elements.tolerances import LEAST_MASS
from ..motions.signals import Signal
from ..parameters.edit import sketch, with_values
from ..sparse.massless_axes import levers
from ..sparse.tolerances import THIN

MOVED = {"position": 0, "velocity": 1}  # attributes that are three numbers of q, or of qd


def pen_of(arena, names):
    """The `Pen` for these parameters of all cases; None if there is one of a constraint or function, or none at all."""
    family, owners = arena.study.family, {}
    for name in names:
        field = family.field(name)
        if field.keyword:
            return None
        owners.setdefault(id(field.owner), (field.owner, []))[1].append((name, field.attribute))
    bodies = (PointMass, type(family.template))
    if any(not isinstance(owner, bodies) and family.load_of(owner) is None for owner, _ in owners.values()):
        return None
    return Pen(arena, owners.values()) if owners else None


class Pen:
    """Writes the numbers of one case after the other.

    Attributes
    ----------
    written : set of str
        The arrays of a `System` that it writes to.
    moves : bool
        Whether starts differ.
    """

    def __init__(self, arena, owners):
        self.arena, self.written, self.moves, self._far = arena, set(), False, {}
        self._writers = [writer for owner, pairs in owners for writer in self._writers_of(owner, pairs)]

    def write(self, values):
        """Write values by name; the start of the case, or None if it must be entered in another way."""
        start = self.arena.study.family.start
        if self.moves:
            start = start[0].copy(), start[1].copy()
        for writer in self._writers:
            if not writer(values, start):
                return None
        return None if self._far and self._is_lean() else start

    def _is_lean(self):
        """Whether a body has next to no inertia about an axis, as `massless_axes.lean_bodies` finds it."""
        mass, moments = self.arena.packed.system.mass, self.arena.moments
        return any(moments[i][0] < THIN * max(moments[i][2], mass[i] * far) for i, far in self._far.items())

    def _writers_of(self, owner, pairs):
        family = self.arena.study.family
        if owner is family.template:
            self.written.add("gravity")
            return [self._gravity(pairs[0][0])]
        if not isinstance(owner, PointMass):
            self.written.add("reals")
            return [self._force(owner, family.load_of(owner), pairs)]
        writers, rest = [], []
        if owner.dimension == 7 and any(attribute in ("mass", "inertia") for _, attribute in pairs):
            self._far[owner.index] = float(levers(self.arena.base)[owner.index] ** 2)
        for name, attribute in pairs:
            if attribute == "mass":
                self.written |= {"mass"}
                writers.append(self._mass(owner, name))
            elif attribute == "inertia":
                self.written |= {"inertia"}
                writers.append(self._inertia(owner, name))
            else:
                self.moves = True
                rest.append((name, attribute))
        if rest and all(attribute in MOVED for _, attribute in rest):
            writers += [self._place(owner, *pair) for pair in rest]
        elif rest:
            writers.append(self._state(owner, rest))
        return writers

    def _gravity(self, name):
        arena = self.arena

        def write(values, start):
            value = values[name]
            if not _is_vector(value):
                return False
            for system in arena.systems():
                system.gravity[:] = value
            return True

        return write

    def _mass(self, body, name):
        arena, i = self.arena, body.index

        def write(values, start):
            m = values[name]
            if not (isinstance(m, float) and LEAST_MASS <= m < math.inf):
                return False
            for system in arena.systems():
                system.mass[i] = m
            for inverse, mass, _, _ in arena.weights():
                inverse[i, 0, 0], mass[i, 0, 0] = 1.0 / m, m
            return True

        return write

    def _inertia(self, body, name):
        arena, i = self.arena, body.index
        check = type(body).inertia.check

        def write(values, start):
            J = check(values[name], body)
            arena.moments[i] = np.linalg.eigh(J)[0].tolist()
            for system in arena.systems():
                system.inertia[i] = J.ravel()
            inverted, spins = np.linalg.inv(J), bool((J[0, 0] * np.eye(3) != J).any())
            for inverse, mass, lengths, turning in arena.weights():
                if lengths[i] == 7:  # of an orientation that isn't locked
                    inverse[i, 1:, :3], mass[i, 1:, :3], turning[i] = inverted, J, spins
            return True

        return write

    def _place(self, body, name, attribute):
        at, level = int(self.arena.base.system.bodies[body.index, 0]), MOVED[attribute]

        def write(values, start):
            value = values[name]
            if not _is_vector(value):
                return False
            start[level][at : at + 3] = value
            return True

        return write

    def _state(self, body, pairs):
        at, length = self.arena.base.system.bodies[body.index].tolist()

        def write(values, start):
            other = with_values(body, {attribute: values[name] for name, attribute in pairs})
            start[0][at : at + length], start[1][at : at + length] = other.q, other.qd
            return True

        return write

    def _force(self, force, load, pairs):
        arena, other = self.arena, sketch(force)
        vars(other)["added"] = False
        at, kernels, places = int(load.alone[0].reals), force.kernels, force.coordinates
        count = len(load.parameters)

        def write(values, start):
            for name, attribute in pairs:
                setattr(other, attribute, values[name])
            other.check()
            given = checked_parameters(other, Signal, "loads")
            if other.kernels is not kernels or len(given) != count or any(isinstance(x, Signal) for x in given):
                return False
            reals, begin = arena.packed.system.reals, at
            for old, new in zip(places, other.coordinates, strict=True):
                if new is not old:
                    reals[begin : begin + 3] = new
                begin += 3
            reals[begin : begin + count] = given
            return True

        return write


def _is_vector(value):
    """Whether a value is three finite numbers, as an array of floats."""
    return isinstance(value, np.ndarray) and value.shape == (3,) and bool(np.isfinite(value).all())
