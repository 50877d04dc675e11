"""Rope: a rope that does not stretch runs through points of bodies, without friction; unilateral.

    |x_2 - x_1| + |x_3 - x_2| + ... = length     (1)  one row, the sum of a `Span` for each pair of neighbouring points
    gap = length - |x_2 - x_1| - ... >= 0        (2)

The tension is the same everywhere, the multiplier of (1). Singular where two neighbouring points of a taut rope
coincide, and where every point is pulled from opposite sides: a straight rope between fixed ends.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import InvalidConstraint, Side, SumRow, Unilateral, fitting, ground_point, label, positive, rope_points
from .span import Span

VANISHING = 1e-9  # share of the rope's length below which a span has no direction; its square is below rounding

if TYPE_CHECKING:
    from ..hints import RopePoints


class Rope(Unilateral, SumRow):
    """Inextensible rope through any number of points of bodies, which only pulls: hoists, tackles, tethers, leashes.

    Parameters
    ----------
    points : sequence of (Body or ground, array_like (3,)), m
        Two points or more, in the order of the rope, each in the frame of its body. The ends are fixed there; through
        the others the rope runs without friction.
    length : float, m; optional
        Of the rope between its ends; None takes the present one.
    always_taut : bool
        True: the rope is taut at all times, and pushes where it ought to go slack. By default it goes slack where its
        tension vanishes, and becomes taut again with an impact.
    restitution : float, 0 to 1
        Coefficient of restitution where the rope becomes taut: 0, the default, where its ends then move at its length,
        1 where they bounce back without loss.

    Raises
    ------
    InvalidConstraint
        If there are fewer than two points, all are on one body, neighbouring points of a rope without a given length
        coincide, a body belongs to another scene, the length is not positive or shorter than the spans that no motion
        changes, or restitution is inadmissible.

    Notes
    -----
    One row. The tension is the multiplier of the row, zero where the rope is slack; `solution.reaction(rope, on=body)`
    is the force on each of its bodies, about the centroid. `solution.phases` shows when the rope is taut,
    `solution.impulses` the impulses with which it becomes so. The masses of rope and pulleys are neglected. A pulley of
    radius R is a point where the rope turns about its axle; the wrapped length, which changes little, is left out. A
    run ends where a span of a taut rope shrinks to length zero and has no direction.

    Examples
    --------
    Atwood's machine, 3 kg against 1 kg, over two fixed pulleys:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> heavy = scene.add_point_mass(mass=3.0, position=(0, 0, -2))
    >>> light = scene.add_point_mass(mass=1.0, position=(1, 0, -2))
    >>> points = [(heavy, (0, 0, 0)), (scene.ground, (0, 0, 0)), (scene.ground, (1, 0, 0)), (light, (0, 0, 0))]
    >>> rope = scene.add(ts.constraints.Rope(points, name="rope"))
    >>> solution = ts.simulate(scene, (0, 0.5))
    >>> print(f"{solution.state.velocity(light)[2]:.3f} m/s, tension {solution.multipliers[-1, 0]:.1f} N")
    2.500 m/s, tension 15.0 N

    A rope of 5.2 m is slack at first, until both have fallen so far that it becomes taut, with an impact:

    >>> rope.length = 5.2
    >>> light.velocity = (0, 0, -1)
    >>> solution = ts.simulate(scene, (0, 0.5))
    >>> print([(round(t, 9), name, round(impulse, 9)) for t, name, impulse in solution.impulses])
    [(0.1, 'rope', 2.25)]
    """

    permanent = ("points", "always_taut")
    _opens_by, excess = "always_taut=False", "is overstretched"

    @fitting
    def __init__(
        self,
        points: RopePoints,
        length: float | None = None,
        always_taut: bool = False,
        restitution: float = 0.0,
        name: str = "",
    ) -> None:
        name = label(name, "Rope", InvalidConstraint)
        where = name or "Rope"
        if not isinstance(always_taut, bool):
            raise InvalidConstraint(f"{where}: always_taut must be True or False, got {always_taut!r}.")
        points = rope_points(points, where, InvalidConstraint, apart=always_taut or length is None)
        self.__dict__.update(points=points, always_taut=always_taut, unilateral=not always_taut)
        (a, _), (b, _) = next(pair for pair in pairwise(points) if pair[0][0] is not pair[1][0])
        super().__init__(a, b, (), name)
        self.length = self._present_length if length is None else length
        self._set_law(restitution)

    def _untitled(self, bodies):
        return f"Rope({', '.join(body.name for body, _ in self.points)})"

    @property
    def _present_length(self):
        """The length in the present poses, m."""
        return float(sum(np.linalg.norm(np.subtract(*pair)) for pair in pairwise(self._present_places)))

    @property
    def _present_places(self):
        return [ground_point(body, np.array(s)) for body, s in self.points]

    @property
    def _held_length(self):
        """The length of spans between points of one body, m."""
        spans = [(s, r) for (a, s), (b, r) in pairwise(self.points) if a is b]
        return float(sum(np.linalg.norm(np.subtract(s, r)) for s, r in spans))

    def check(self):
        """A length that spans between bodies may have, and an admissible coefficient of restitution."""
        self._check_law()
        positive(self.length, f"{self.name}: length (m)", self.error)
        (first, s), (last, r) = self.points[0], self.points[-1]
        least = self._held_length
        if first is last:
            least = max(least, float(np.linalg.norm(np.subtract(s, r))))
        if not self.length > least:
            raise self.error(
                f"{self.name}: the length of {self.length:g} m is too short: {least:g} m lie between points whose "
                "distance doesn't change. Give a longer rope, or leave length out for the present one."
            )

    @property
    def referred(self) -> tuple[Any, ...]:
        """Its bodies."""
        return tuple(body for body, _ in self.points)

    def compose(self):
        """Eq. (1). No span of a rope that is always taut may vanish; that of a slack one may."""
        least = VANISHING * self.length if self.always_taut else 0.0
        offset = self._held_length - float(self.length)
        for (a, s), (b, r) in pairwise(self.points):
            if a is not b:
                yield Span(a, b, point_a=s, point_b=r, offset=offset, least=least)
                offset = 0.0

    @property
    def sides(self):
        """Eq. (2)."""
        return (Side(self, -1.0),)

    @classmethod
    def example(cls, rng, a, b):
        """Through four points, two of them on b."""
        s = rng.normal(size=(4, 3)).tolist()
        return cls([(a, s[0]), (b, s[1]), (b, s[2]), (a, s[3])], always_taut=True)
