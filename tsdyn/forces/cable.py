"""Cable: an elastic cable through points of bodies, without friction, slack where it is not stretched.

    l = |x_2 - x_1| + |x_3 - x_2| + ...                          (1)
    T = max(0, k (l - l_0) + c ld)  where l > l_0, else 0        (2)  tension, the same everywhere
    each point is pulled by T towards both of its neighbours     (3)
    U = k (l - l_0)^2 / 2           where l > l_0, else 0        (4)

With a damper T jumps where the cable becomes taut at a rate. (2) is a law of the whole scene: a program that kernels
interpret.
"""

from __future__ import annotations

from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import Action, Force, InvalidForce, SceneLaw, Turn, gate, ground_point, label, not_negative, rope_points
from .spring import BEYOND

if TYPE_CHECKING:
    from ..hints import RopePoints


def _law(t, state, *, stiffness=0.0, damping=0.0, free_length=0.0):
    """Stands for Eq. (2), which `Cable.results` gives."""


def _motion(state, body, s):
    """Position and velocity of a point, (3,) each."""
    if body.dimension == 0:
        return np.array(s), np.zeros(3)
    return state.position(body, s), state.velocity(body, s)


class Cable(SceneLaw, Force):
    """Elastic cable through any number of points of bodies, which it can only pull: winches, tendons, rubber bands.

    Parameters
    ----------
    points : sequence of (Body or ground, array_like (3,)), m
        Two points or more, in the order of the cable, each in the frame of its body. The ends are fixed there; through
        the others the cable runs without friction.
    stiffness : float, N/m
        Of the whole cable: change of tension over change of length.
    damping : float, N s/m
        Of the whole cable, while it is taut.
    free_length : float, m; optional
        None takes the present length.

    Raises
    ------
    InvalidForce
        If there are fewer than two points, all are on one body, neighbouring points coincide, a body belongs to another
        scene, a number is negative or not finite, or stiffness and damping are both zero.

    Notes
    -----
    Slack below its free length. The potential energy is that of the stretch; damping takes the rest. The mass of the
    cable is neglected. Points may pass each other at speed, as those of a Spring may: the direction turns.

    Examples
    --------
    A load of 1 kg hangs on the movable block of a cable of 100 N/m, both parts of which carry it:

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> load = scene.add_point_mass(mass=1.0, position=(0, 0, -1))
    >>> points = [(scene.ground, (0, 0, 0)), (load, (0, 0, 0)), (scene.ground, (0, 0, 0))]
    >>> cable = scene.add(ts.forces.Cable(points, stiffness=100.0))
    >>> state = ts.simulate(scene, (0, np.pi / 20)).state
    >>> print(f"lowest at {state.position(load)[2]:.4f} m, free length {cable.free_length:g} m")
    lowest at -1.0500 m, free length 2 m
    """

    markers = (Turn("a"),)
    particles = True
    given = "law_of_state"
    law_of_state = staticmethod(_law)
    permanent = ("points", "law_of_state")
    sources = ("stiffness", "damping")
    loads = ()
    checked = True
    quantities = MappingProxyType(dict.fromkeys(("stiffness", "damping", "free_length"), not_negative))

    def __init__(
        self,
        points: RopePoints,
        *,
        stiffness: float = 0.0,
        damping: float = 0.0,
        free_length: float | None = None,
        name: str = "",
    ) -> None:
        name = label(name, "Cable", InvalidForce)
        points = rope_points(points, name or "Cable", InvalidForce)
        self.__dict__["points"] = points
        super().__init__(self.bodies[0], None, name=name)
        places = [ground_point(body, np.array(s)) for body, s in points]
        present = float(sum(np.linalg.norm(np.subtract(*pair)) for pair in pairwise(places)))
        self.stiffness, self.damping = stiffness, damping
        self.free_length = present if free_length is None else free_length

    def _untitled(self, bodies):
        return f"Cable({', '.join(body.name for body, _ in self.points)})"

    @property
    def referred(self) -> tuple[Any, ...]:
        """Its bodies."""
        return tuple(body for body, _ in self.points)

    def parameters(self):
        """(k, c, l_0)."""
        return self.stiffness, self.damping, self.free_length

    def actions(self):
        """The tension of each span between two bodies, at its ends."""
        return [Action(False, a, b, None, (), s, r) for (a, s), (b, r) in pairwise(self.points) if a is not b]

    def results(self, function, t, state, numbers):
        """Eq. (2), for each of these spans."""
        stiffness, damping, free_length = numbers
        stretch, rate, count = -free_length, 0.0, 0
        for (a, s), (b, r) in pairwise(self.points):
            if a is b:
                stretch = stretch + float(np.linalg.norm(np.subtract(s, r)))
                continue
            (x, xd), (y, yd) = _motion(state, a, s), _motion(state, b, r)
            length = np.sqrt((y - x) @ (y - x))
            stretch, rate, count = stretch + length, rate + ((y - x) @ (yd - xd)) / length, count + 1
        tension = stiffness * stretch + damping * rate
        return [gate(stretch + BEYOND * rate, gate(tension, tension))] * count

    @staticmethod
    def powers(l, ld, par):
        """Eq. (4), what damping takes, and no applied power, at lengths l and rates ld."""
        stretch = np.maximum(l - par[2], 0.0)
        tension = np.where(stretch > 0.0, np.maximum(par[0] * stretch + par[1] * ld, 0.0), 0.0)
        return 0.5 * par[0] * stretch**2, tension * ld - par[0] * stretch * ld, 0.0 * l

    @classmethod
    def example(cls, rng, a, b):
        """Through four points, taut."""
        s = rng.normal(size=(4, 3)) if a.dimension != 3 and b.dimension != 3 else np.zeros((4, 3))
        places = zip((a, b, a, b), s.tolist(), strict=True)
        return cls(list(places), stiffness=rng.uniform(0.5, 2.0), damping=rng.uniform(0.5, 2.0), free_length=0.1)
