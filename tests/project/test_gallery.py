"""The gallery: every example is in it, has a small picture, and checks itself; wrong runs fail the checks."""

import numpy as np
import pytest

import tsdyn as ts
from docs.gallery import ENTRIES
from docs.gallery_pages import IMAGES, ROOT, index, page
from examples import (
    andrews_squeezer,
    bricard,
    cardan_shaft,
    chebyshev_linkage,
    delta_robot,
    double_pendulum,
    flyball_governor,
    gyroscope,
    leg_with_rods,
    peaucellier,
    planetary_gear,
    scotch_yoke,
    stewart_platform,
    suspension,
)

SMALL = 60_000  # bytes
ROUGH = {  # an end that shows what a run at 1e-3 does wrong
    andrews_squeezer: 0.03,
    bricard: 1.0,
    double_pendulum: 1.0,
    gyroscope: 1.0,
    peaucellier: 2.0,
    planetary_gear: 0.5,
    scotch_yoke: 1.0,
}


LONG = "parallel_runs", "stability_map", "tolerance_analysis"  # test_examples.py runs fewer of their cases
QUICK = "top", "slider_crank", "chebyshev_linkage", "delta_robot", "double_pendulum", "peaucellier"


@pytest.mark.slow_but(*QUICK)
@pytest.mark.parametrize("entry", [each for each in ENTRIES if each.name not in LONG], ids=lambda entry: entry.name)
def test_examples_check_themselves(entry, capsys):
    entry.module.main()
    assert capsys.readouterr().out


def test_every_example_is_in_the_gallery():
    scripts = {file.stem for file in (ROOT / "examples").glob("*.py")} - {"__init__"}
    assert {entry.name for entry in ENTRIES} == scripts
    assert len(ENTRIES) >= 25


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.name)
def test_pictures_are_small(entry):
    """Draw a missing one by python -m docs.draw NAME."""
    size = (IMAGES / f"{entry.name}.png").stat().st_size
    assert 1000 < size < SMALL
    assert f"images/gallery/{entry.name}.png" in page(entry)
    assert f"]({entry.name}.md)" in index()


@pytest.mark.parametrize("name", ["coin", "cradle"])
def test_pages_of_animated_examples_show_the_run(name):
    entry = next(each for each in ENTRIES if each.name == name)
    assert f'<iframe src="../animations/{name}.html"' in page(entry)
    assert "<iframe" not in page(next(each for each in ENTRIES if each.name == "bricard"))


@pytest.mark.slow
@pytest.mark.parametrize(("module", "end"), ROUGH.items(), ids=lambda each: getattr(each, "__name__", ""))
def test_a_rough_run_fails_the_check(module, end):
    rough = ts.simulate(module.build(), (0.0, end), integrator=ts.integrators.RK45(rtol=1e-3, atol=1e-3))
    with pytest.raises(AssertionError):
        module.check(rough)


@pytest.mark.slow
def test_a_governor_that_has_not_settled_fails_the_check():
    with pytest.raises(AssertionError):
        flyball_governor.check(ts.simulate(flyball_governor.build(), (0.0, 1.5)))


@pytest.mark.slow
def test_forces_of_another_plate_fail_the_check(monkeypatch):
    solution = ts.simulate(stewart_platform.build(), (0.0, 0.5))
    monkeypatch.setattr(stewart_platform, "MASS", 1.001 * stewart_platform.MASS)
    with pytest.raises(AssertionError):
        stewart_platform.check(solution)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "name"),
    [(cardan_shaft, "BEND"), (suspension, "LOWER_OUT"), (delta_robot, "ARM"), (leg_with_rods, "BACK")],
)
def test_another_geometry_fails_the_check(module, name, monkeypatch):
    times = np.linspace(0.0, 2.0, 401)
    solution = ts.simulate(module.build(), (0.0, 2.0), t_eval=times)
    monkeypatch.setattr(module, name, 1.0001 * getattr(module, name))
    with pytest.raises(AssertionError):
        module.check(solution)


def test_a_part_of_a_turn_is_not_straight_enough():
    late = chebyshev_linkage.build().kinematics(np.linspace(0.0, 0.3, 20))
    with pytest.raises(AssertionError):
        chebyshev_linkage.check(late)
