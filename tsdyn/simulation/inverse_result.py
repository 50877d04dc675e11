"""The result of `scene.inverse_dynamics`: loads of actuators beside all that a solution has."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..calls import fitting_methods
from ..drawing import Drawn, new_figure
from ..elements.force import Force
from ..jit.compiled import clock
from ..observables import power, reactions
from ..observables.exerted import acted
from ..validation import unknown_name
from .given_motion import GivenMotion

if TYPE_CHECKING:
    from ..hints import BodyLike, Floats, ItemLike, Scene


@fitting_methods
class InverseDynamics(Drawn, GivenMotion):
    """What `scene.inverse_dynamics` returns: a `Solution` of the motion, driven by loads of actuators.

    Reactions, multipliers and power are those under these loads. The reaction of a joint that is an actuator is without
    the actuator's load.

    Attributes
    ----------
    actuators : tuple of str
    loads : dict of ndarray (k,), N or N m
        By the names of the actuators; `units` has their units.
    residual : ndarray (k,)
        Largest acceleration that the actuators can't give, over the largest accelerations of the loads.
    """

    _method = "inverse dynamics"

    def __init__(self, scene: Scene, wanted: int, kept: Any, followed: Any, every: Any, message: str = "") -> None:
        from ..inverse.loads import demand_produced, find_loads  # imported here: a run needs none of it

        super().__init__(scene, wanted, kept, followed, message)
        started = clock()
        found = find_loads(self.packed, self.t, self.q, self.qd, self.qdd, self._remembers, every)
        self.residual: Floats = demand_produced(self, every, found)
        self.actuators: tuple[str, ...] = tuple(one.name for one in every)
        self.units: dict[str, str] = {one.name: one.unit for one in every}
        self.loads: dict[str, Floats] = {one.name: u for one, u in zip(every, found.u.T, strict=True)}
        self._seconds = {"prepare": 0.0, "run": followed.seconds + clock() - started}
        self._every, self.multipliers, self._normals = every, found.multipliers, found.normals

    def __getitem__(self, part: slice) -> Self:
        """Return the result at some of the times, `result[a:b]`."""
        other = super().__getitem__(part)
        other.multipliers, other._normals, other.residual = (
            each[part] for each in (self.multipliers, self._normals, self.residual)
        )
        other.loads = {name: u[part] for name, u in self.loads.items()}
        other._every = [one._replace(loads=one.loads[part]) for one in self._every]
        return other

    @cached_property
    def _memory(self):
        return np.hstack((self._remembers, self._normals))

    def load(self, actuator: ItemLike) -> Floats:
        """Load of an actuator, by handle or name: (k,), N or N m; (k, c) of one with c components or coordinates."""
        values = np.stack([self.loads[one.name] for one in self._of(actuator, True)], axis=1)
        return values[:, 0] if values.shape[1] == 1 else values

    def power_of(self, item: ItemLike) -> Floats:
        """Power (k,), W, supplied by an actuator, or by a constraint or force, as `Solution.power_of`."""
        found = self._of(item)
        own = 0.0 if found and self._replaced(found[0]) else super().power_of(found[0].item if found else item)
        return own + sum((self._gain(one) * one.rate(self.qd) for one in found), np.zeros(self.t.size))

    def reaction(self, item: ItemLike, on: BodyLike | None = None) -> tuple[Floats, Floats]:
        """Force (N) and torque (N m) that a constraint, a joint or a force exerts: (k, 3) each, as of a `Solution`."""
        item = self.handles.item(item)
        load, found = reactions.loads_of(self.packed).get(id(item)), [one for one in self._every if one.item is item]
        if load is None or not found:
            return super().reaction(item, on)
        body = acted(self.packed, item, on)
        at, dimension = self.handles.where(body)
        whole = np.zeros_like(self.q)
        for one in found:
            whole[:, one.columns] += self._gain(one)[:, None] * one.loads
        parts = [reactions.at_first_point(self, body, whole[:, at : at + dimension], item, load.coordinates)]
        if not self._replaced(found[0]):
            parts.append(reactions.force_reaction(self, load, body))
        return tuple(np.sum(each, axis=0) for each in zip(*parts, strict=True))

    @cached_property
    def _force_powers(self):
        replaced = {id(one.item) for one in self._every if self._replaced(one)}
        total = power.ForcePowers(*np.zeros((3, self.t.size)))
        for load in self.packed.loads:
            if id(load.force) not in replaced:
                parts = power.load_powers(self.packed, load, self.t, self.q, self.qd, self._memory)
                for sum_, part in zip(total, parts, strict=True):
                    sum_ += part
        for one in self._every:
            total.applied[:] += self._gain(one) * one.rate(self.qd)
        return total

    def _replaced(self, one):
        """Whether the load takes the place of a force's law; a spring keeps its stiffness and damping."""
        return isinstance(one.item, Force) and not hasattr(one.item, "stiffness")

    def _gain(self, one):
        """The load of an actuator, less what the force exerts by itself."""
        load = reactions.loads_of(self.packed).get(id(one.item))
        from ..inverse.actuators import tension_given

        given = 0.0 if load is None or self._replaced(one) else tension_given(load, self.t)
        return self.loads[one.name] - given

    def _of(self, item, required=False):
        """The actuators of a handle or a name; with `required` there is one."""
        name = item if isinstance(item, str) else None
        found = [one for one in self._every if one.item is item or name in (one.name, one.item.name)]
        if not found and required:
            raise unknown_name("actuator", item, self.actuators)
        return found

    def _facts(self):
        facts = super()._facts()
        for name, u in self.loads.items():
            if u.size:
                facts[name] = f"{u.min():.6g} to {u.max():.6g} {self.units[name]}"
        return facts

    def figure(self) -> Any:
        """Loads over time, a panel for each unit; a matplotlib Figure."""
        units = list(dict.fromkeys(self.units.values()))
        with new_figure(6.0, 1.0 + 2.2 * len(units)) as figure:
            for unit, ax in zip(units, np.atleast_1d(figure.subplots(len(units), sharex=True)), strict=True):
                for name, u in self.loads.items():
                    if self.units[name] == unit:
                        ax.plot(self.t, u, label=name)
                ax.set_ylabel("force (N)" if unit == "N" else "torque (N m)")
                ax.legend(frameon=False, fontsize="small")
            ax.set_xlabel("time (s)")
        return figure
