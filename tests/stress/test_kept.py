"""Faults that random scenes have shown, each by its seed; all are mended."""

import numpy as np
import pytest

from tsdyn.errors import Status
from tsdyn.runs import driver
from tsdyn.stress import judgement
from tsdyn.stress.judgement import judge_case, run_case
from tsdyn.stress.laws import phases, same_bits
from tsdyn.stress.random_scenes import CONTACTS, drawn, generate

KEPT = {
    2002342: "fixed steps across a spin that diverges",
    2003177: "a flat start: dense output beside outputs",
    2000265: "rows that were redundant at the start become independent",
    2010485: "the same by a step method",
    2015426: "a redundant row at the limit",
    2201275: "accelerations at a mass ratio of 2e8",
    2201795: "the same, default method",
    2200838: "a conflict among many constraints: the search for the fewest ends",
    2012861: "dense output of a row of four-bars of 1e-6 m",
    2011212: "dense output of a scene of 1e-6 m",
    2011079: "two methods past singular configurations, mass ratio 5e8",
    2200503: "links of 1e-6 m on joints with axes",
    3202253: "the same far away",
    3201248: "output times next to a singular configuration: the selection of rows outlived them",
    4000223: "dense output of velocities next to a singular configuration",
    2002207: "far from the origin: balance of torques",
    8004851: "dense output of the null-space form on another branch",
    9005411: "velocities of the null-space form: 9e-11 off rows that nearly depend on others",
    9009872: "fixed steps at a mass ratio of 6e10: accelerations 2e-8 off",
    6004833: "a spring of 1e8 1/s^2 between distant points: one rounding of positions is 1e-7 of the torques",
}


def made(seed):
    case = generate(seed)
    if case.assembled:
        case.scene.assemble()
    return case


def test_joint_friction_starts_from_the_same_loads_with_output_times():
    """Loads of friction at output times are not where the next step starts from."""
    case = made(2000326)
    one, two = run_case(case), run_case(case, t_eval=np.linspace(*case.span, 7))
    np.testing.assert_array_equal(one.steps.h, two.steps.h)
    np.testing.assert_array_equal(one.q[-1], two.q[-1])


def test_a_step_that_rounding_repeats_ends_the_run():
    """The end of the shortest step is rounded to where the rejected step before it had ended."""
    case = made(2001057)
    solution = run_case(case)
    assert solution.status == Status.STEP_COLLAPSED
    assert solution.stats.rejected < 1000
    assert "diverges" in solution.message


def test_light_links_between_heavy_bodies_keep_their_accelerations_on_the_constraints():
    """Masses from 3e-5 kg to 2e3 kg: a last place of the multipliers accelerated the lightest by 1.5e-8 m/s^2."""
    assert run_case(made(4004998)).constraint_error.acceleration.max() < 1e-12


@pytest.mark.slow_for("*")
@pytest.mark.parametrize("seed", KEPT, ids=KEPT.values())
def test_a_kept_scene(seed):
    found = judge_case(generate(seed), judgement.ALL)
    assert not found.fault, f"{found.name}: {found.word}: {found.said}"


KEPT_CONTACTS = {
    ("stops", 600093): "a stop leaves where its reaction vanishes, though hinges carry weight of 1e20 N",
    ("stops", 600011): "the angle of a stop in a scene of kilometres closes to rounding of angles",
    (
        "chain_over_floor",
        700140,
    ): "rows of contacts that stick lose rank: the run ends with an account",
    ("stack", 600024): "all corners of a box leave at one instant",
    ("stack", 910030): "velocities of 1e8 m/s end at an impact",
    ("stack", 3000376): "at velocities of 1e8 m/s slips of 1e-6 m/s are rounding",
    ("ropes", 500014): "reactions of rounding, in free fall",
}


KEPT_SMALL = {
    ("rough_ropes", 6000020): "velocities of 1e6 m/s end at an impact beside frictions",
    ("rough_ropes", 6000021): "a friction that others hold without a force goes on to",
    ("rough_ropes", 6000258): "a taut rope turns a joint with friction back at its dead centre",
    ("rough_ropes", 6000263): "the same, where loads of the joint that would stick have no limit",
    ("shaken", 6000183): "two rows of slips that nearly depend on each other don't hold a box",
    ("stack", 9000148): "a corner that others press, where one that carried has let go, stays closed",
    ("shaken", 8000100): "an output where a table jumps has the reaction before",
    ("chain_over_floor", 9000211): "the turns of a joint at an impact, in dense output",
    ("hybrid", 7000058): "an impulse at an action, where inertias differ by 1e10",
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed", "most"),
    [(*key, 5) for key in KEPT_CONTACTS] + [(*key, 3) for key in KEPT_SMALL],
    ids=[*KEPT_CONTACTS.values(), *KEPT_SMALL.values()],
)
def test_a_kept_scene_with_contacts(kind, seed, most):
    found = judge_case(drawn(np.random.default_rng(seed), 1, most, {kind: CONTACTS[kind]}), ())
    assert found.word == str(Status.SUCCESS) or (kind, seed) in KEPT_CONTACTS
    assert not found.fault, f"{found.name}: {found.word}: {found.said}"


@pytest.mark.slow
def test_a_coin_that_becomes_stiff_turns_where_it_did_whatever_the_slices(monkeypatch):
    """Its work counts from the start: slices end by the clock."""
    case = drawn(np.random.default_rng(6000272), 1, 3, {"coins": CONTACTS["coins"]})
    one = run_case(case)
    assert "Radau" in str(one)
    assert same_bits(one, run_case(case, dense_output=False))  # longer slices
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    assert same_bits(one, run_case(case))


@pytest.mark.slow
def test_a_phase_that_a_checkpoint_begins_knows_no_slips_of_the_one_before():
    """Those that had been fast by then had ended: the first turn of a slip from rest came 0.13 s early."""
    case = drawn(np.random.default_rng(6000008), 1, 3, {"shaken": CONTACTS["shaken"]})
    assert judge_case(case, (judgement.stopped,)).word == str(Status.SUCCESS)


@pytest.mark.slow
def test_a_phase_that_ends_before_its_last_flights_would_has_no_negative_length():
    """Corners of two boxes hit each other some hundred times; phases of the list begin where flights end."""
    case = drawn(np.random.default_rng(6000450), 1, 3, {"stack": CONTACTS["stack"]})
    solution = run_case(case, max_steps=1500)
    assert len(solution.phases) > 400
    assert not any(found.broken for found in phases(solution))
