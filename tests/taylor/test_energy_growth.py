"""Errors at the limit of rounding grow as the square root of the steps (Brouwer's law); time does not drift."""

from fractions import Fraction

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.energy_growth import SCENES, grow
from tests.helpers.tolerances import EPS

I = ts.integrators


@pytest.mark.slow_for("pendulum", "bricard")
@pytest.mark.parametrize("name", SCENES)
def test_errors_of_energy_and_momenta_stay_below_one_rounding_a_step(name):
    """Over eps sqrt(steps): without compensated sums 0.3 to 0.8, with truncation errors of one sign up to 5.

    Bricard's loop has redundant rows and reactions that are large against its kinetic energy.
    """
    one = grow(name, 5e3, 4)
    walk = EPS * np.sqrt(one.steps[-1])
    assert one.steps[-1] > 4000
    assert one.rms[-1] < (3.0 if name == "bricard" else 0.25) * walk
    assert np.sqrt((one.momentum[:, -1] ** 2).mean()) < 0.5 * walk


@pytest.mark.slow
@pytest.mark.parametrize(("name", "mean"), [("top", 0.3), ("chain", 0.15), ("disc", 0.3)])
def test_errors_of_many_starts_are_a_random_walk(name, mean):
    """The mean of the energy error is small against its scatter; constraint errors don't grow.

    With gravity rounded to the last place of larger accelerations the mean of the chain is 0.26. A disc rolls with rows
    on velocities: a drift of 0.001 eps a step would be twice what is allowed.
    """
    one = grow(name, 5e4, 16)
    end = one.energy[:, -1]
    assert abs(end.mean()) < mean * EPS * np.sqrt(one.steps[-1] / end.size)
    assert one.rms[-1] < 0.25 * EPS * np.sqrt(one.steps[-1])
    assert one.constraints < 2.0


@pytest.mark.parametrize(
    "method", [I.Taylor(1e-8), I.DOP853(1e-6, 1e-6), I.Nystrom4(step=0.013), I.Taylor(step=0.13, order=20)], ids=repr
)
@pytest.mark.parametrize("start", [0.0, 1e5])
def test_time_is_the_sum_of_all_steps_to_rounding(method, start):
    """Each step is integrated over the difference of two floats, which is exact: nothing adds up."""
    span = start, start + 40.0
    run = ts.simulate(SCENES["top"](), span, integrator=method)
    total = sum(map(Fraction, run.steps.h[run.steps.accepted]))
    assert run.stats.steps > 100
    assert abs(float(total - Fraction(span[1]) + Fraction(span[0]))) <= EPS * span[1]
