"""Tableaus of Runge-Kutta, diagonally implicit and Nystrom methods, with checks of their order conditions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..calls import fitting_constructor
from ..errors import InvalidArgument
from ..maths.tolerances import SUM_ROUNDING
from ..validation import floats, shown

if TYPE_CHECKING:
    from ..hints import Floats, Sequence


def _numbers(values, count, said):
    """So many finite numbers; or InvalidArgument, what is due and what there is."""
    found = floats(values)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise InvalidArgument(f"{said}, got {shown(values)}.")
    return found


def _weights(values, stages, what):
    """Numbers, one a stage."""
    return _numbers(values, stages, f"{what}: b and c have one number a stage, {stages} by c")


def _demand_stages(values, stages, what):
    if len(values) != stages:
        raise InvalidArgument(f"{what}: a has one row a stage, {stages} by c, got {len(values)}.")


def _rows(values, stages, what):
    """A strictly lower triangular matrix from its rows below the diagonal."""
    _demand_stages(values, stages, what)
    matrix = np.zeros((stages, stages))
    for i, row in enumerate(values):
        matrix[i, :i] = _numbers(row, i, f"{what}: row {i} of an explicit tableau has {i} entries")
    return matrix


def _lower(values, stages, what):
    """A lower triangular matrix from its rows up to the diagonal."""
    _demand_stages(values, stages, what)
    matrix = np.zeros((stages, stages))
    for i, row in enumerate(values):
        matrix[i, : i + 1] = _numbers(
            row, i + 1, f"{what}: row {i} of a diagonally implicit tableau has {i + 1} entries"
        )
    return matrix


def demand(what, size=1.0, **conditions):
    """Refuse what fails by more than rounding of coefficients of that size."""
    for name, value in conditions.items():
        if not np.abs(value).max() <= SUM_ROUNDING * size:
            raise InvalidArgument(f"{what}: the condition {name} fails by {np.abs(value).max():.3g}.")


@fitting_constructor
@dataclass(frozen=True)
class RungeKuttaTableau:
    """An explicit Runge-Kutta method: stage times c, coefficients a (rows below the diagonal), weights b.

    Examples
    --------
    The classical method of order 4; a wrong coefficient is refused:

    >>> import tsdyn as ts
    >>> classical = {"a": ((), (1 / 2,), (0, 1 / 2), (0, 0, 1)), "b": (1 / 6, 1 / 3, 1 / 3, 1 / 6), "order": 4}
    >>> len(ts.RungeKuttaTableau(**classical, c=(0, 1 / 2, 1 / 2, 1)).b)
    4
    >>> try:
    ...     ts.RungeKuttaTableau(**classical, c=(0, 1 / 2, 1 / 3, 1))
    ... except ts.InvalidArgument as error:
    ...     print(error)
    RungeKuttaTableau: the condition sum a = c fails by 0.167.
    """

    a: Sequence[Sequence[float]]
    b: Sequence[float]
    c: Sequence[float]
    order: int
    error: Sequence[
        float
    ] = ()  # weights of the error estimate: one a stage, and one of the derivative at the step's end
    second_error: Sequence[float] = ()  # those of a second, lower one
    embedded_order: int = 0

    def __post_init__(self) -> None:
        a, b, c = self.arrays
        ones, size = np.ones(len(c)), max(1.0, np.abs(a).sum(axis=1).max(), np.abs(b).sum())
        what = "RungeKuttaTableau", size
        for weights in (self.error, self.second_error):
            if len(weights) not in (0, len(c) + 1):
                raise InvalidArgument(f"{what[0]}: an error estimate has {len(c) + 1} weights, got {len(weights)}.")
            demand(*what, **{"sum of the error weights = 0": np.sum(weights)})
        demand(*what, **{"sum a = c": a @ ones - c, **quadrature(b, c, self.order)})
        demand(*what, **_trees(a, b, c, min(self.order, 4)))

    @property
    def arrays(self) -> tuple[Floats, ...]:
        """a (s, s), b (s,), c (s,)."""
        s, what = len(self.c), "RungeKuttaTableau"
        return _rows(self.a, s, what), _weights(self.b, s, what), _weights(self.c, s, what)

    @cached_property
    def numbers(self) -> Floats:
        """The numbers as the kernels read them: s; a stage's same-place flag, c, row of a; b; rows of error weights."""
        a, b, c = self.arrays
        stages = [[0.0, c[i], *a[i]] for i in range(len(c))]
        return np.concatenate([[len(c)], np.ravel(stages), b, self.error, self.second_error])


@fitting_constructor
@dataclass(frozen=True)
class ImplicitTableau:
    """A diagonally implicit Runge-Kutta method: rows of a up to the diagonal, the first row zero, the last the weights.

    Such a method is stiffly accurate and begins with the derivative at the step's start; error holds the weights of
    the error estimate, one a stage, none where the method has an estimate of its own.

    Examples
    --------
    The trapezoidal rule:

    >>> import tsdyn as ts
    >>> ts.ImplicitTableau(a=((0,), (1 / 2, 1 / 2)), c=(0, 1), order=2).order
    2
    """

    a: Sequence[Sequence[float]]
    c: Sequence[float]
    order: int
    error: Sequence[float] = ()
    embedded_order: int = 0

    def __post_init__(self) -> None:
        what = "ImplicitTableau"
        a, b, c = self.arrays
        ones, diagonal = np.ones(len(c)), np.diag(a)
        if a[0, 0] != 0.0 or np.ptp(diagonal[1:]) > 0.0 or not diagonal[1] > 0.0:
            raise InvalidArgument(f"{what}: the first row is zero, and the other diagonal entries one positive number.")
        demand(what, **{"sum a = c": a @ ones - c, **quadrature(b, c, self.order)})
        if self.error:
            demand(what, **quadrature(b - np.array(self.error), c, self.embedded_order))
        demand(what, **_trees(a, b, c, self.order))

    @property
    def arrays(self) -> tuple[Floats, ...]:
        """a (s, s), b (s,), c (s,)."""
        a = _lower(self.a, len(self.c), "ImplicitTableau")
        return a, a[-1], _weights(self.c, len(self.c), "ImplicitTableau")

    @cached_property
    def numbers(self) -> Floats:
        """As `RungeKuttaTableau.numbers`."""
        a, b, c = self.arrays
        stages = [[0.0, c[i], *a[i]] for i in range(len(c))]
        error = [*(self.error or np.zeros(len(c))), 0.0]
        return np.concatenate([[len(c)], np.ravel(stages), b, error])


@fitting_constructor
@dataclass(frozen=True)
class NystromTableau:
    """An explicit Nystrom method for vdd = f(t, v, vd), with the velocity among f's arguments.

    Stage i:  v_i  = v + c_i h vd + h^2 sum_j abar_ij k_j,   vd_i = vd + h sum_j a_ij k_j
    Step:     v   += h vd + h^2 sum_i bbar_i k_i,            vd  += h sum_i b_i k_i

    Conditions up to order 4 are those of Hairer, Norsett, Wanner, Solving ODEs I, 2nd ed., II.14.

    Examples
    --------
    The midpoint rule:

    >>> import tsdyn as ts
    >>> midpoint = ts.NystromTableau(
    ...     a=((), (1 / 2,)), abar=((), (1 / 8,)), b=(0, 1), bbar=(0, 1 / 2), c=(0, 1 / 2), order=2
    ... )
    >>> midpoint.order
    2
    """

    a: Sequence[Sequence[float]]
    abar: Sequence[Sequence[float]]
    b: Sequence[float]
    bbar: Sequence[float]
    c: Sequence[float]
    order: int

    def __post_init__(self) -> None:
        a, abar, b, bbar, c = self.arrays
        ones = np.ones(len(c))
        what = "NystromTableau"
        if not a.any():
            raise InvalidArgument(
                f"{what}: this method ignores the velocity at its stages, but the reduced equations always depend on "
                "it (gamma, S): it would be of order one. Use a tableau with coefficients a."
            )
        demand(what, **{"sum a = c": a @ ones - c, **quadrature(b, c, self.order)})
        demand(what, **{"bbar 1 = 1/2": bbar @ ones - 1 / 2}, **_trees(a, b, c, min(self.order, 4)))
        if self.order >= 3:
            demand(what, **{"b abar 1 = 1/6": b @ abar @ ones - 1 / 6, "bbar c = 1/6": bbar @ c - 1 / 6})
        if self.order >= 4:
            demand(
                what,
                **{"b abar c = 1/24": b @ abar @ c - 1 / 24},
                **{"bbar c^2 = 1/12": bbar @ c**2 - 1 / 12, "bbar a c = 1/24": bbar @ a @ c - 1 / 24},
                **{"bbar abar 1 = 1/24": bbar @ abar @ ones - 1 / 24},
                **{
                    "b c abar 1 = 1/8": (b * c) @ abar @ ones - 1 / 8,
                    "b a abar 1 = 1/24": b @ a @ abar @ ones - 1 / 24,
                },
            )

    @property
    def arrays(self) -> tuple[Floats, ...]:
        """a (s, s), abar (s, s), b (s,), bbar (s,), c (s,)."""
        s, what = len(self.c), "NystromTableau"
        weights = (_weights(values, s, what) for values in (self.b, self.bbar, self.c))
        return _rows(self.a, s, f"{what} a"), _rows(self.abar, s, f"{what} abar"), *weights

    @cached_property
    def numbers(self) -> Floats:
        """The numbers as the step kernel reads them: s; a stage's same-place flag, c, rows of abar and a; bbar; b."""
        a, abar, b, bbar, c = self.arrays
        stages = []
        for i in range(len(c)):
            same = i > 1 and c[i] == c[i - 1] and (abar[i] == abar[i - 1]).all()
            stages += [float(same), c[i], *abar[i], *a[i]]
        return np.concatenate([[len(c)], stages, bbar, b])


def quadrature(b, c, order):
    """The conditions that quadratures meet up to an order."""
    return {f"b c^{j} = 1/{j + 1}": b @ c**j - 1 / (j + 1) for j in range(order)}


def _trees(a, b, c, order):
    """The conditions of orders 3 to 5 that are no quadratures (Hairer, Norsett, Wanner, II.2), up to an order."""
    ac, aac = a @ c, a @ a @ c
    conditions = {
        3: {"b a c = 1/6": b @ ac - 1 / 6},
        4: {
            "b c a c = 1/8": (b * c) @ ac - 1 / 8,
            "b a c^2 = 1/12": b @ a @ c**2 - 1 / 12,
            "b a a c = 1/24": b @ aac - 1 / 24,
        },
        5: {
            "b c^2 a c = 1/10": (b * c**2) @ ac - 1 / 10,
            "b (a c)^2 = 1/20": b @ ac**2 - 1 / 20,
            "b c a c^2 = 1/15": (b * c) @ a @ c**2 - 1 / 15,
            "b a c^3 = 1/20": b @ a @ c**3 - 1 / 20,
            "b c a a c = 1/30": (b * c) @ aac - 1 / 30,
            "b a c a c = 1/40": b @ a @ (c * ac) - 1 / 40,
            "b a a c^2 = 1/60": b @ a @ a @ c**2 - 1 / 60,
            "b a a a c = 1/120": b @ a @ aac - 1 / 120,
        },
    }
    return {name: value for at, some in conditions.items() if at <= order for name, value in some.items()}
