"""Tableaus of diagonally implicit methods: wrong ones are refused, stability, first guesses."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import COARSE, EPS, HELD, LOOSE
from tsdyn.methods.diagonally_implicit import begin_prediction, predict, prediction_memory
from tsdyn.methods.tableau import ImplicitTableau

I = ts.integrators
by_name = {"ids": lambda x: getattr(x, "__name__", str(x))}
SDIRK54, ImplicitTrapezoid, RK45 = I.SDIRK54, I.ImplicitTrapezoid, I.RK45
METHODS = (ImplicitTrapezoid, SDIRK54)


def numbers(method):
    tableau = method.tableau
    return {name: getattr(tableau, name) for name in ("a", "c", "order", "error", "embedded_order")}


def spoilt(method):
    """The tableau with one coefficient after the other off by a millionth, the row sums kept or not."""
    given = numbers(method)
    for i, row in enumerate(given["a"]):
        for j in range(len(row)):
            for kept in (False, True)[: 1 + (i > 1 and 0 < j < len(row) - 1)]:
                new = [list(r) for r in given["a"]]
                new[i][j] += 1e-6
                new[i][0] -= 1e-6 * kept
                yield given | {"a": tuple(map(tuple, new))}
    for i, c in enumerate(given["c"]):
        yield given | {"c": (*given["c"][:i], c + 1e-6, *given["c"][i + 1 :])}
    for i, e in enumerate(given["error"]):
        yield given | {"error": (*given["error"][:i], e + 1e-6, *given["error"][i + 1 :])}


@pytest.mark.parametrize("method", METHODS, **by_name)
def test_every_wrong_coefficient_is_refused(method):
    ImplicitTableau(**numbers(method))
    for wrong in spoilt(method):
        with pytest.raises(ts.InvalidArgument, match=r"ImplicitTableau: the (condition|first row)"):
            ImplicitTableau(**wrong)
    with pytest.raises(ts.InvalidArgument, match="condition"):
        ImplicitTableau(**numbers(method) | {"order": method.order + 1})


@pytest.mark.parametrize(
    ("a", "c", "words"),
    [
        (((1 / 2,), (0, 1)), (1 / 2, 1), "first row"),  # no explicit first stage
        (((0,), (1, 0)), (0, 1), "first row"),  # explicit throughout
        (((0,), (2, -1)), (0, 1), "first row"),  # a negative diagonal
        (((0,), (1 / 4, 1 / 4), (1 / 3, 1 / 3, 1 / 3)), (0, 1 / 2, 1), "first row"),  # two diagonals
        (((0,), (1 / 4, 1 / 4, 0)), (0, 1 / 2), "row 1"),
        (((0,), (1 / 2, 1 / 2)), (0, 1 / 2), "sum a = c"),
        (((0,), (0, 1)), (0, 1), "b c"),  # backward Euler is of order one
    ],
)
def test_bad_tableaus(a, c, words):
    with pytest.raises(ts.InvalidArgument, match=words):
        ImplicitTableau(a=a, c=c, order=2)


@pytest.mark.parametrize("method", METHODS, **by_name)
def test_stability(method):
    """A-stable: |R(iy)| <= 1 and all poles to the right; the trapezoid without damping, SDIRK54 L-stable."""
    a, b, _ = method.tableau.arrays
    ones = np.ones(len(b))

    def R(z):
        return 1.0 + z * b @ np.linalg.solve(np.eye(len(b)) - z * a, ones)

    sizes = np.array([abs(R(1j * y)) for y in np.logspace(-3, 6, 400)])
    assert sizes.max() <= 1.0 + HELD
    far = abs(R(-1e6))
    if method is SDIRK54:
        assert far < LOOSE
    else:
        np.testing.assert_allclose(sizes, 1.0, rtol=HELD)
        assert far == pytest.approx(1.0, abs=COARSE)


@pytest.mark.parametrize("part", [0, 1], ids=["velocities", "accelerations"])
@pytest.mark.parametrize("power", range(4))
def test_predictions_of_stages_are_exact_for_polynomials(power, part):
    """Of cubics from four stages of the step and of the one before; of those of lower order from the step's own."""
    tableau, c, before = SDIRK54.tableau.numbers, np.array(SDIRK54.tableau.c), 0.7  # h of the step before, over h
    stages, memory, k = len(c), np.zeros(2 * len(c) + 2), np.zeros(1)
    own = np.zeros(prediction_memory(stages, 2))
    memory[2 + part :: 2] = (before * c) ** power
    assert begin_prediction(memory, own, stages, 2, 0.0, before, 1.0) == 0.0
    assert begin_prediction(memory, own, stages, 2, before, 1.0, 1.0) == before
    memory[2 + part :: 2] = (before + c) ** power
    for i in range(1, stages):
        predict(tableau, memory, own, i, before, 4, 2, part, k)
        assert k[0] == pytest.approx((before + c[i]) ** power, rel=100 * EPS)
        predict(tableau, memory, own, i, 0.0, 4, 2, part, k)
        if power < min(i, 4):
            assert k[0] == pytest.approx((before + c[i]) ** power, rel=100 * EPS)
    assert begin_prediction(memory, own, stages, 2, before, 0.5, 1.0) == 2.0 * before  # the step was rejected
    assert begin_prediction(memory, own, stages, 2, before + 0.5, 1.0, 2.0) == 0.0  # another chart
