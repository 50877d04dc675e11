"""A small sample of the random scenes of tests/fuzz: each runs, or is refused or ends with a message."""

import pytest

from tests.fuzz.scenes import KINDS, generate, outcome


def test_every_kind_is_drawn():
    assert {generate(seed, 2, 6).name.partition(",")[0] for seed in range(40)} == set(KINDS)


@pytest.mark.slow_for("14")  # friction of joints
@pytest.mark.parametrize("seed", range(16))
def test_a_random_scene(seed):
    case = generate(seed, 3, 12)
    word, said = outcome(case)
    assert not word.startswith("FAULT"), f"{case.name}: {word}: {said}"
