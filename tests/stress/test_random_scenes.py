"""A small sample of the random scenes of `tsdyn stress --fuzz`: each runs within the laws, is refused, or says why."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.helpers.drawn_numbers import DrawnNumbers
from tsdyn.errors import TsdynError
from tsdyn.stress.judgement import comparison, judge_case, judge_scene
from tsdyn.stress.random_scenes import CONTACTS, KINDS, Draw, drawn, generate


@pytest.mark.slow
def test_every_kind_is_drawn():
    assert {generate(seed, 2, 6).name.partition(",")[0] for seed in range(800)} == set(KINDS)


def test_a_seed_is_a_scene():
    one, two = (generate(18) for _ in range(2))
    assert (one.name, one.span, repr(one.options)) == (two.name, two.span, repr(two.options))
    assert (one.scene.start[0] == two.scene.start[0]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_is_drawn_of_one_body(kind):
    for seed in range(10):
        d = Draw(np.random.default_rng(seed))
        KINDS[kind](d, 1)
        assert d.scene.bodies


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=5)
@given(data=st.data())
def test_hypothesis_draws_a_kind(kind, data):
    d = Draw(DrawnNumbers(data))
    with suppress(TsdynError):  # equal numbers may make points coincide: such scenes are refused
        KINDS[kind](d, 3)
    assert d.scene.bodies


@pytest.mark.slow_for("*")
@pytest.mark.parametrize("seed", range(40))
def test_a_random_scene(seed):
    found = judge_scene(seed, 2, 12)
    assert not found.fault, f"{found.name}: {found.word}: {found.said}"


CONTACT_SCENES = (
    *(("ropes", seed) for seed in (107, 110, 118)),  # a rope that comes back, after others have run
    ("ropes", 700089),  # flights of some hundred roundings
    ("cradle", 115), ("balls", 138),  # reactions that are rounding
    ("chain_over_floor", 9),  # slips and links that bilateral constraints hold
    pytest.param("chain_over_floor", 118, marks=pytest.mark.slow),
    # A chain on its side that tips over the line between two of its points: the other reactions are rounding of zero
    pytest.param("chain_over_floor", 700140, marks=pytest.mark.slow),
    pytest.param("stack", 11, marks=pytest.mark.slow),  # low flights within long steps
)  # fmt: skip


@pytest.mark.parametrize(("kind", "seed"), CONTACT_SCENES)
def test_a_scene_with_contacts_runs_to_its_end(kind, seed):
    found = judge_case(drawn(np.random.default_rng(seed), 2, 8, {kind: CONTACTS[kind]}), ())
    assert found.word == "success", f"{found.word}: {found.said}"


@pytest.mark.slow
@settings(max_examples=100)
@given(st.data())
def test_a_scene_that_hypothesis_draws(data):
    numbers = DrawnNumbers(data)
    try:
        case = drawn(numbers, 2, 8)
    except TsdynError:  # a refusal: points of a scene of equal numbers may coincide
        return
    found = judge_case(case, comparison(numbers, case))
    assert not found.fault, f"{found.name}: {found.word}: {found.said}"


@pytest.mark.parametrize("seed", [3, 7, 11, 15, 19, 23])
def test_scenes_that_pass_places_where_series_end_are_judged(seed):
    outcome = judge_scene(seed)
    assert outcome.name.endswith("by series")
    assert outcome.word == "success", outcome.said
