"""Coupler: a joint coordinate that depends on those of other joints, on any bodies.

    q_0 = offset + ratio_1 q_1 + ratio_2 q_2 + ...          (1)  AngleTerm, DisplacementTerm
    q_0 = offset + f_1(q_1) + f_2(q_2) + ...                (2)  the same of functions
    q_0 = offset + f(q_1, q_2, ...)                         (3)  and shares of a function of several

One row, the sum of a term for each joint. Angles are counted over turns; a step must rotate each by less than half a
turn. Never singular: the dependent coordinate stands alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    CoordinateFunction,
    InvalidConstraint,
    JointFunction,
    Smooth,
    SumRow,
    chosen_coordinate,
    finite,
    fitting,
    floats,
    functions_of,
    geometry_of,
    label,
    shown,
)
from .angle_term import AngleTerm, _AngleFunctionTerm
from .displacement_term import DisplacementTerm, _DisplacementFunctionTerm
from .joint_function_term import joint_function_term

if TYPE_CHECKING:
    from ..hints import ArrayLike, Function, JointCoordinate, Prescribed


class Coupler(SumRow):
    """A joint coordinate that depends on those of other joints: gears, belts, differentials, mimic joints, cams.

    Parameters
    ----------
    dependent : Joint, or (Joint, "angle" or "displacement"), or (Joint, "angle", index)
        The joint whose coordinate depends on others; as a pair where it has an angle and a displacement, with an index
        where it has several angles (Universal).
    *independents : the same
        The joints on which it depends, one or more, on any bodies of the scene.
    ratio : float, or one of each independent; rad or m over rad or m
        Change of the dependent coordinate over that of an independent one; 1 by default.
    offset : float, rad or m
        Added to the dependent coordinate.
    polynomial : array_like (n,), optional
        a_0, a_1, ... of q_0 = a_0 + a_1 q_1 + a_2 q_1^2 + ..., in place of a ratio.
    function : one of ts.motions, a ts.Table, a spline of SciPy's, or a function f(q_1, ...), optional
        The dependent coordinate, in place of a ratio; a plain function of several joints, up to five unless it is a
        sum of functions of one each. It may use arithmetic and the functions of NumPy, without branches.

    Raises
    ------
    InvalidConstraint
        If a joint is missing, has no such coordinate, is given twice or isn't in the scene, if couplers go in a circle,
        if a number is not finite, or a function is none of these.

    Notes
    -----
    One row. Coordinates are those of `solution.angle(joint)`, over any number of turns, and
    `solution.displacement(joint)`. a and b are the bodies of the dependent joint; `solution.reaction(coupler, on=body)`
    serves for all bodies of the joints. Functions are differentiated exactly. Ratios, polynomials and functions have
    Taylor series; data change from piece to piece, and other methods run them.

    Examples
    --------
    Two hinges at right angles, the second at half the rate of the first:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> one = scene.add_body(mass=1.0, inertia=(1, 1, 1), angular_velocity=(0, 0, 4))
    >>> two = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(1, 0, 0), angular_velocity=(2, 0, 0))
    >>> fast = scene.add(ts.constraints.Revolute.at(scene.ground, one, point=one.position, axis=(0, 0, 1)))
    >>> slow = scene.add(ts.constraints.Revolute.at(scene.ground, two, point=two.position, axis=(1, 0, 0)))
    >>> scene.add(ts.constraints.Coupler(slow, fast, ratio=0.5, name="gear"))
    <Coupler 'gear': 1 row>
    >>> state = ts.simulate(scene, (0, 10)).state
    >>> print(f"{state.angle(fast):.4f} rad, {state.angle(slow):.4f} rad")
    40.0000 rad, 20.0000 rad
    """

    permanent = ("dependent", "independents")

    @fitting
    def __init__(
        self,
        dependent: JointCoordinate,
        *independents: JointCoordinate,
        ratio: ArrayLike | float | None = None,
        offset: float = 0.0,
        polynomial: ArrayLike | None = None,
        function: Prescribed | Function | None = None,
        name: str = "",
    ) -> None:
        name = label(name, "Coupler", InvalidConstraint)
        where = name or "Coupler"
        if not independents:
            raise InvalidConstraint(f"{where}: give one joint or more on which {shown(dependent)} depends.")
        chosen = [chosen_coordinate(where, given) for given in (dependent, *independents)]
        self.__dict__.update(dependent=chosen[0], independents=tuple(chosen[1:]))
        joint = chosen[0][0]
        super().__init__(joint.a, joint.b, (), name)
        self.ratio, self.offset, self.polynomial, self.function = ratio, offset, polynomial, function

    def _untitled(self, bodies):
        return f"Coupler({', '.join(joint.name for joint, *_ in self._all)})"

    @property
    def _all(self):
        return (self.dependent, *self.independents)

    @property
    def referred(self) -> tuple[Any, ...]:
        """Its bodies and joints."""
        return (self.a, self.b, *(joint for joint, *_ in self._all))

    @property
    def ratios(self) -> list[float]:
        """The ratio of each independent coordinate."""
        given = 1.0 if self.ratio is None else self.ratio
        values = np.ravel(given).tolist() if np.ndim(given) else [given] * len(self.independents)
        if len(values) != len(self.independents):
            raise self.error(
                f"{self.name}: {len(values)} ratios are given for {len(self.independents)} independent joints; give "
                "one for each, or one for all."
            )
        return [finite(value, f"{self.name}: ratio", self.error) for value in values]

    def check(self):
        """Joints of the scene, each once; finite numbers."""
        for i, coordinate in enumerate(self._all):
            joint, kind, _ = coordinate
            if joint.scene is not self.scene:
                raise self.error(f"{self.name}: {joint.name!r} belongs to another scene.")
            self._demand_added(joint)
            before = self._all[:i]
            if coordinate == self.dependent and before:
                raise self.error(f"{self.name}: the {kind} of {joint.name!r} would depend on itself.")
            if coordinate in before:
                raise self.error(f"{self.name}: the {kind} of {joint.name!r} is given twice; add up its ratios.")
        given = [word for word in ("ratio", "polynomial", "function") if getattr(self, word) is not None]
        if len(given) > 1:
            raise self.error(f"{self.name}: give one of ratio, polynomial and function, not {' and '.join(given)}.")
        finite(self.offset, f"{self.name}: offset", self.error)
        _ = self.ratios if self.plain else self.functions

    @property
    def plain(self) -> bool:
        """Whether it has ratios."""
        return self.polynomial is None and self.function is None

    @property
    def functions(self) -> list[CoordinateFunction]:
        """The function of each independent coordinate."""
        what, count = f"{self.name}: {'function' if self.polynomial is None else 'polynomial'}", len(self.independents)
        if self.polynomial is None:
            return functions_of(self.function, count, what)
        coefficients = floats(self.polynomial)
        if coefficients.ndim != 1 or not coefficients.size or not np.isfinite(coefficients).all():
            raise self.error(f"{what} must be finite coefficients a_0, a_1, ..., got {shown(self.polynomial)}.")
        if count > 1:
            raise self.error(f"{what} is of one coordinate, and {count} independent joints are given; use function=.")
        return [CoordinateFunction(Smooth("polynomial", (), tuple(coefficients.tolist())))]

    def place_in(self, scene):
        """Refuse couplers that go in a circle."""
        following = {}
        for each in scene.constraints:
            if isinstance(each, Coupler):
                following.setdefault(each.dependent, []).append(each)
        before, ahead = {self: None}, [self]  # couplers that it depends on, each with the one that led there
        while ahead:
            coupler = ahead.pop()
            if coupler is not self and self.dependent in coupler.independents:
                names = []
                while coupler is not None:
                    names.append(repr(coupler.name))
                    coupler = before[coupler]
                raise self.error(
                    f"{self.name}: the couplers {', '.join(names[::-1])} go in a circle, by which "
                    f"{self.dependent[0].name!r} would depend on itself; leave one out."
                )
            for other in (other for each in coupler.independents for other in following.get(each, ())):
                if other not in before:
                    before[other] = coupler
                    ahead.append(other)

    def compose(self):
        """Eq. (1), (2) or (3): the dependent coordinate, less the others."""
        functions = [None, *([None] * len(self.independents) if self.plain else self.functions)]
        if isinstance(functions[-1], JointFunction):
            yield self._term(*self.dependent, None, 1.0, -float(self.offset))
            yield from map(self._share, functions[1:])
            return
        factors = [1.0, *(-ratio for ratio in self.ratios)] if self.plain else [1.0] + [-1.0] * len(self.independents)
        offsets = [-float(self.offset)] + [0.0] * len(self.independents)
        for (joint, kind, index), *numbers in zip(self._all, functions, factors, offsets, strict=True):
            yield self._term(joint, kind, index, *numbers)

    def _term(self, joint, kind, index, function, factor, offset):
        """The term of one coordinate."""
        given = {"ratio": factor, "offset": offset} | ({} if function is None else {"function": function})
        if kind == "angle":
            own, other, f, g, h = geometry_of(joint, kind, index)
            cls = AngleTerm if function is None else _AngleFunctionTerm
            term = cls(own, other, reference_a=f, across_a=g, reference_b=h, **given)
            term.__dict__["counted"] = ((joint, index),)
            return term
        own, other, e, s_own, s_other = geometry_of(joint, kind, index)
        cls = DisplacementTerm if function is None else _DisplacementFunctionTerm
        return cls(own, other, axis_a=e, point_a=s_own, point_b=s_other, **given)

    def _share(self, function):
        """The term of one coordinate in a function of several."""
        chosen = [self.independents[i] for i in function.order]
        bodies, places, counted = [], [], []
        for joint, kind, index in chosen:
            own, other, *given = geometry_of(joint, kind, index)
            bodies += own, other
            places += given
            counted += [(joint, index)] * (kind == "angle")
        cls = joint_function_term("".join(kind[0] for _, kind, _ in chosen))
        term = cls(*bodies[:2], others=tuple(bodies[2:]), function=function, places=places)
        term.__dict__["counted"] = tuple(counted)
        return term

    @classmethod
    def example(cls, rng, a, b):
        """The two coordinates of a random cylindrical joint, which it adds to the scene."""
        from .cylindrical import Cylindrical

        joint = a.scene.add(Cylindrical(a, b, axis_a=rng.normal(size=3), axis_b=rng.normal(size=3)))
        return cls((joint, "angle"), (joint, "displacement"), ratio=rng.uniform(0.5, 2.0), offset=rng.normal())
