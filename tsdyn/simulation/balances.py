"""Balances of a run: energies, powers, momenta, and the work of forces along the trajectory."""

from __future__ import annotations

from functools import cached_property, partial, wraps
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Polynomial

from ..calls import fitting_methods
from ..errors import InvalidArgument
from ..maths.tolerances import ROUNDING
from ..model.handles import handles_of
from ..observables import diagnostics, reactions
from ..observables.reactions import member, with_normal_loads
from .tolerances import AGREE, DEEPEST, NO_POWER


def in_phases(method):
    """Decorate a method without arguments that returns arrays over the outputs, a tuple of them, or a named tuple."""

    @wraps(method)
    def call(self):
        return by_phase(self, method)

    return call


def by_phase(solution, ask, whole=False):
    """What a solution says; where phases differ in forces or numbers, what the outputs of each packed scene say.

    whole: as of `Phases.parts`, to ask about a constraint.
    """
    phases = getattr(solution, "_phases", None)
    if phases is None:
        return ask(solution)
    return gathered(solution, ask, whole) if phases.varies else ask(solution._before_jumps)


def gathered(solution, ask, whole=False):
    """What the outputs of each packed scene say, in the order of the outputs."""
    found, order = [], []
    for part, mine in solution._phases.parts(solution, whole):
        found.append(ask(part))
        order.append(mine)
    back = np.argsort(np.concatenate(order), kind="stable")
    if isinstance(found[0], tuple):
        columns = [np.concatenate(column)[back] for column in zip(*found, strict=True)]
        return type(found[0])(*columns) if hasattr(found[0], "_fields") else tuple(columns)
    return np.concatenate(found)[back]


if TYPE_CHECKING:
    from ..hints import Floats, ItemLike


# Energy error of an undriven and undamped run near singular configurations.

MOST_OUTPUTS = 200  # examined


def energy_error(solution, task):
    """Return the largest change of energy since the start over the largest kinetic energy; None if it isn't conserved.

    Outputs and the last state are compared.
    """
    system, packed = solution.system, solution.packed
    if system.rheonomic[0] or system.normals.size:
        return None
    some, slots = solution[:: max(solution._length() // MOST_OUTPUTS, 1)], system.memory.size
    t = np.concatenate(([task.span[0]], some.t, [solution.reached]))
    q, qd = (
        np.vstack((first, rows, last))
        for first, rows, last in zip((task.q, task.qd), (some.q, some.qd), solution._last[:2], strict=True)
    )
    memory = np.vstack((task.remembered[-slots:] if slots else np.zeros(0), some._remembers, solution._remembered))
    forces = diagnostics.force_powers(SimpleNamespace(t=t, q=q, qd=qd, _memory=memory, packed=packed))
    kinetic = diagnostics.kinetic_energy(system, q, qd)
    largest = kinetic.max()
    if not (
        largest > 0.0 and max(np.abs(forces.applied).max(), np.abs(forces.dissipation).max()) <= NO_POWER * largest
    ):
        return None
    energy = kinetic + diagnostics.potential_energy(system, q) + forces.potential
    return float(np.abs(energy - energy[0]).max() / largest)


# Mechanical work along a trajectory: Gauss quadrature of power on the dense output of every step.

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
AT_ONCE = 2000  # pieces of the interval, evaluated in one call


def work(solution, trajectory, item=None):
    """Work (k,), J, since the start: of applied and driving forces, less dissipation.

    item restricts it to one constraint or force, as in `diagnostics.power_of`.
    """
    edges = np.unique(np.concatenate([[trajectory.start], trajectory.edges, solution.t]))
    power, floor = partial(_power, solution, trajectory, item), ROUNDING * solution.kinetic_energy.max(initial=0.0)
    pieces = np.zeros(0)
    for first in range(0, edges.size - 1, AT_ONCE):
        some = edges[first : first + AT_ONCE + 1]
        pieces = np.append(pieces, _integrals(power, some[:-1], some[1:], floor)[0])
    done = np.append(0.0, np.cumsum(pieces))[np.searchsorted(edges, solution.t)]
    if item is None and solution._phases is not None:  # impacts
        done += solution._phases.gained()[solution._phase_of_rows]
    return done


def _integrals(power, a, b, floor, depth=0, known=None):
    """Return the work from each a to its b, by bisection until halves agree, or to a floor, J: steps are long.

    And by how much halves are off. Next to singular configurations, where those of halves are off by more, powers are
    rounding: there the whole counts. known: what `_quadrature` gives for them, if it has been asked already.
    """
    done, size = known or _quadrature(power, a, b)
    middle, count = 0.5 * (a + b), a.size
    a, b = np.append(a, middle), np.append(middle, b)
    parts, sizes = _quadrature(power, a, b)
    found = parts[:count] + parts[count:]
    error = np.abs(found - done)
    off = np.flatnonzero(~(error <= np.maximum(AGREE * size, floor)))
    if off.size and depth < DEEPEST:
        both = np.append(off, off + count)
        finer, left = _integrals(power, a[both], b[both], floor, depth + 1, (parts[both], sizes[both]))
        finer, left = finer[: off.size] + finer[off.size :], left[: off.size] + left[off.size :]
        better = ~(left > error[off])
        found[off[better]], error[off[better]] = finer[better], left[better]
    return found, error


def _quadrature(power, a, b):
    """Integrals (k,) of the power and of its size, five nodes each.

    Powers next to a singular configuration, where there is no state, are those of the polynomial through the others.
    """
    middle, half = 0.5 * (b + a), 0.5 * (b - a)
    values = power((middle[:, None] + half[:, None] * NODES).ravel()).reshape(-1, NODES.size)
    lost = np.isnan(values)
    for k in np.flatnonzero(lost.any(axis=1) & ~lost.all(axis=1)):
        there = NODES[~lost[k]], values[k, ~lost[k]]
        values[k, lost[k]] = Polynomial.fit(*there, there[0].size - 1)(NODES[lost[k]])
    return half * (values @ WEIGHTS), half * (np.abs(values) @ WEIGHTS)


def _power(solution, trajectory, item, t):
    states, memory, status = trajectory(t)
    if status != 0:  # of one of them at least
        halves = np.array_split(t, 2) if t.size > 1 else ()
        return np.concatenate([_power(solution, trajectory, item, some) for some in halves] or [np.full(1, np.nan)])
    levels, power, phases = [np.ascontiguousarray(states[:, i]) for i in range(3)], np.zeros(t.size), solution._phases
    varies = phases is not None and phases.varies
    for packed, mine in phases.packed_at(t) if varies else [(solution.packed, slice(None))]:
        some = t[mine], *(level[mine] for level in levels)
        slots = with_normal_loads(packed, *some, memory[mine]) if varies else solution._with_normal_loads(*some, memory)
        at = SimpleNamespace(t=some[0], q=some[1], qd=some[2], _memory=slots, packed=packed, system=packed.system)
        if packed.system.rheonomic[0]:
            at.multipliers = (reactions.multipliers if varies else solution._multipliers_at)(
                *([packed] if varies else []), *some, slots
            )
        power[mine] = _supplied(at, item)
    losses = solution._losses_at(t, *levels, memory)
    return power - solution._losses_of(item, losses)


def _supplied(at, item):
    """Power (k,) supplied by an item, or without one by all, at states that have a packed scene."""
    if item is None:
        powers = diagnostics.force_powers(at)
        return powers.applied + diagnostics.driving_power(at) - powers.dissipation
    item = handles_of(at.packed).own(item)
    if reactions.is_idle(at.packed, item):
        return np.zeros(at.t.size)
    load = reactions.loads_of(at.packed).get(id(item))
    return diagnostics.power_of(at, member(at.packed, item) if load is None else load)


# Balances of a run: energies, powers and momenta, mixed into `Solution`.


@fitting_methods
class Balances:
    """Mixed into what has `system`, `packed`, `handles` and outputs t (k,), q and qd (k, n)."""

    @cached_property
    @in_phases
    def kinetic_energy(self) -> Floats:
        """Kinetic energy (k,), J."""
        return diagnostics.kinetic_energy(self.system, self.q, self.qd)

    @cached_property
    @in_phases
    def potential_energy(self) -> Floats:
        """Potential energy (k,), J, of gravity (zero at the origin) and of springs; applied loads have none."""
        return diagnostics.potential_energy(self.system, self.q) + self._force_powers.potential

    @property
    def energy(self) -> Floats:
        """Kinetic and potential energy together (k,), J."""
        return self.kinetic_energy + self.potential_energy

    @cached_property
    @in_phases
    def _force_powers(self):
        return diagnostics.force_powers(self)

    @cached_property
    @in_phases
    def power(self) -> Floats:
        """Power (k,), W, of applied forces, actuators and driven constraints: dE/dt = power - dissipation."""
        return self._force_powers.applied + diagnostics.driving_power(self)

    @property
    def dissipation(self) -> Floats:
        """Power (k,), W, dissipated by dampers and friction; not negative."""
        return self._force_powers.dissipation + self._losses_of(None, self._losses())

    @cached_property
    def work(self) -> Floats:
        """Work (k,), J, since the start: of applied and driving forces, less dissipation and losses of impacts.

        energy - work is constant up to the integration error. The work is integrated over the dense output.

        Raises
        ------
        InvalidArgument
            If the run kept no dense output.
        """
        return self._integrated(None)

    def power_of(self, item: ItemLike) -> Floats:
        """Power (k,), W, supplied by one constraint or force (or its name): its share of dE/dt.

        Of a motor or a driver: the power of its force or torque along the prescribed motion. Of a force: the power of
        its loads and actuators, less dissipation; stored energy of a spring doesn't count. Of other constraints: zero.
        """
        supplied = by_phase(self, lambda part: _supplied(part, part._part(item)))
        return supplied - self._losses_of(self._part(item), self._losses())

    def work_of(self, item: ItemLike) -> Floats:
        """Work (k,), J, since the start, of one constraint or force: the integral of `power_of`.

        Raises
        ------
        InvalidArgument
            If the run kept no dense output.
        """
        return self._integrated(self._part(item))

    def _part(self, item):
        """A constraint or force of the scene."""
        item = self.handles.item(item)
        if id(item) not in reactions.loads_of(self.packed) and not reactions.is_idle(self.packed, item):
            member(self.packed, item)
        return item

    def _integrated(self, part):
        if self._trajectory is None:
            raise InvalidArgument("work is integrated over dense output: simulate(..., dense_output=True) keeps it.")
        return work(self, self._trajectory, part)

    @cached_property
    @in_phases
    def linear_momentum(self) -> Floats:
        """Linear momentum (k, 3), kg m/s, ground frame."""
        return diagnostics.linear_momentum(self.system, self.q, self.qd)

    @cached_property
    @in_phases
    def angular_momentum(self) -> Floats:
        """Angular momentum about the ground's origin (k, 3), kg m^2/s, ground frame."""
        return diagnostics.angular_momentum(self.system, self.q, self.qd)
