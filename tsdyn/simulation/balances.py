"""Balances of a run: energies, powers and momenta, mixed into `Solution`."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from ..calls import fitting_methods
from ..errors import InvalidArgument
from ..observables import diagnostics, power, reactions
from ..observables.exerted import member
from .mechanical_work import work as integrate_work

if TYPE_CHECKING:
    from ..hints import Floats, ItemLike


@fitting_methods
class Balances:
    """Mixed into what has `system`, `packed`, `handles` and outputs t (k,), q and qd (k, n)."""

    @cached_property
    def kinetic_energy(self) -> Floats:
        """Kinetic energy (k,), J."""
        return diagnostics.kinetic_energy(self.system, self.q, self.qd)

    @cached_property
    def potential_energy(self) -> Floats:
        """Potential energy (k,), J, of gravity (zero at the origin) and of springs; applied loads have none."""
        return diagnostics.potential_energy(self.system, self.q) + self._force_powers.potential

    @property
    def energy(self) -> Floats:
        """Kinetic and potential energy together (k,), J."""
        return self.kinetic_energy + self.potential_energy

    @cached_property
    def _force_powers(self):
        return power.force_powers(self)

    @cached_property
    def power(self) -> Floats:
        """Power (k,), W, of applied forces, actuators and driven constraints: dE/dt = power - dissipation."""
        return self._force_powers.applied + power.driving_power(self)

    @property
    def dissipation(self) -> Floats:
        """Power (k,), W, dissipated by dampers and friction; not negative."""
        return self._force_powers.dissipation

    @cached_property
    def work(self) -> Floats:
        """Work (k,), J, since the start: of applied and driving forces, less dissipation.

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
        return power.power_of(self, self._part(item))

    def work_of(self, item: ItemLike) -> Floats:
        """Work (k,), J, since the start, of one constraint or force: the integral of `power_of`.

        Raises
        ------
        InvalidArgument
            If the run kept no dense output.
        """
        return self._integrated(self._part(item))

    def _part(self, item):
        """The `Load` of a force, or the `Member` of a constraint."""
        item = self.handles.item(item)
        load = reactions.loads_of(self.packed).get(id(item))
        return member(self.packed, item) if load is None else load

    def _integrated(self, part):
        if self._trajectory is None:
            raise InvalidArgument("work is integrated over dense output: simulate(..., dense_output=True) keeps it.")
        return integrate_work(self, self._trajectory, part)

    @cached_property
    def linear_momentum(self) -> Floats:
        """Linear momentum (k, 3), kg m/s, ground frame."""
        return diagnostics.linear_momentum(self.system, self.q, self.qd)

    @cached_property
    def angular_momentum(self) -> Floats:
        """Angular momentum about the ground's origin (k, 3), kg m^2/s, ground frame."""
        return diagnostics.angular_momentum(self.system, self.q, self.qd)
