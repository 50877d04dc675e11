"""Every example passes its own check; the README's example runs."""

import re
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from examples import (
    bead_on_surface,
    door,
    drive_train,
    driven_pivot,
    four_bar,
    geared_pair,
    hooke_joint,
    inverse_dynamics,
    parallel_runs,
    pendulum_chain,
    plug_in_integrator,
    sarrus,
    screw_press,
    slider_crank,
    stability_map,
    stick_slip,
    tolerance_analysis,
    top,
    two_body_pendulum,
)
from tests.helpers.tolerances import CLOSE, NEAR

ROOT = Path(__file__).parents[2]
RUNS = {
    "top": (top, top.build, 10.0, 1e-3),
    "two_body_pendulum": (two_body_pendulum, two_body_pendulum.build, 10.0, 1e-3),
    "spatial": (two_body_pendulum, lambda: two_body_pendulum.build(((0.3, 0, 0), (1, 5, 2))), 10.0, 1e-3),
    "chain": (pendulum_chain, pendulum_chain.build, 1.0, 5e-4),
    "bead_on_surface": (bead_on_surface, bead_on_surface.build, 5.0, 1e-3),
    "driven_pivot": (driven_pivot, driven_pivot.build, 3.0, 2e-4),
}
MECHANISMS = {
    "slider_crank": (slider_crank, 2.0),
    "hooke_joint": (hooke_joint, 3.0),
    "four_bar": (four_bar, 2.0),
    "door": (door, 10.0),
    "sarrus": (sarrus, 3.0),
    "screw_press": (screw_press, 1.5),
    "geared_pair": (geared_pair, 1.5),
}


@pytest.mark.slow_for("driven_pivot")
@pytest.mark.parametrize(("module", "build", "end", "step"), RUNS.values(), ids=RUNS.keys())
def test_example(module, build, end, step):
    solution = ts.simulate(build(), (0.0, end), integrator=ts.integrators.Nystrom4(step=step))
    module.check(solution)


@pytest.mark.parametrize(("module", "end"), MECHANISMS.values(), ids=MECHANISMS.keys())
def test_mechanism(module, end):
    """To 1e-9 by DOP853 at 1e-11, and by Taylor, which serves all joints."""
    method = ts.integrators.DOP853(rtol=1e-11, atol=1e-11)
    module.check(ts.simulate(module.build(), (0.0, end), integrator=method))
    module.check(ts.simulate(module.build(), (0.0, end), integrator=ts.integrators.Taylor(tol=1e-15)))
    rough = ts.simulate(module.build(), (0.0, end), integrator=ts.integrators.RK45(rtol=1e-4, atol=1e-4))
    with pytest.raises(AssertionError):
        module.check(rough)


@pytest.mark.slow
def test_a_rheonomic_pendulum():
    """As a plug-in and built in: to 1e-9 by DOP853 at 1e-11; by Taylor what is built in."""
    method = ts.integrators.DOP853(rtol=1e-11, atol=1e-11)
    for build in (driven_pivot.build, driven_pivot.build_driven):
        driven_pivot.check(ts.simulate(build(), (0.0, 1.0), integrator=method), tol=1e-9)
    solution = ts.simulate(driven_pivot.build_driven(), (0.0, 1.0), integrator=ts.integrators.Taylor(tol=1e-15))
    driven_pivot.check(solution, tol=1e-9)


def test_inverse_dynamics(capsys):
    inverse_dynamics.main()
    assert "right motor.angle" in capsys.readouterr().out
    found = inverse_dynamics.solve(np.linspace(0.0, 1.0, 11))
    with pytest.raises(AssertionError):  # too few times for a spline
        inverse_dynamics.check(found, inverse_dynamics.drive(found))


@pytest.mark.slow
def test_stick_slip():
    """To 1e-9 by DOP853 at 1e-11, in both forms, and by SDIRK54; energy less work stays."""
    for given in ({}, {"formulation": "null-space"}):
        method = ts.integrators.DOP853(rtol=1e-11, atol=1e-11)
        solution = ts.simulate(stick_slip.build(), (0.0, 1.0), integrator=method, dense_output=True, **given)
        stick_slip.check(solution)
        assert np.abs(solution.energy - solution.work - solution.energy[0]).max() < CLOSE
    stick_slip.check(
        ts.simulate(stick_slip.build(), (0.0, 1.0), integrator=ts.integrators.SDIRK54(1e-8, 1e-8)), tol=1e-6
    )


@pytest.mark.slow_for("driven_pivot")
@pytest.mark.parametrize(
    ("build", "end"),
    [(build, end) for _, build, end, _ in RUNS.values()]
    + [(driven_pivot.build_driven, 3.0)]
    + [(drive_train.build, 4.0), (plug_in_integrator.build, 2.0)]
    + [(module.build, end) for module, end in MECHANISMS.values()],
    ids=[*RUNS, "driven_pivot, built in", "drive_train", "plug_in_integrator", *MECHANISMS],
)
def test_energy_less_work_is_constant(build, end):
    """To the tolerance, relative to what the energy's parts are."""
    solution = ts.simulate(build(), (0.0, end), rtol=1e-9, atol=1e-9, dense_output=True).raise_if_failed()
    size = np.abs(solution.kinetic_energy).max() + np.ptp(solution.potential_energy)
    assert np.ptp(solution.energy - solution.work) < NEAR * size


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["tangent", "maggi-kane"])
def test_plug_in_integrator(formulation):
    for method in plug_in_integrator.METHODS:
        solution = ts.simulate(
            plug_in_integrator.build(), (0.0, 2.0), integrator=method(1e-8, 1e-8), formulation=formulation
        )
        if formulation == "tangent":
            plug_in_integrator.check(solution)
        assert solution.raise_if_failed().stats.steps > 50


def test_readme_example(capsys):
    code, shown = re.search(
        r"```python\n(.*?)```\n+```\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL
    ).groups()
    exec(code, {})
    assert capsys.readouterr().out == shown


def test_check_can_fail():
    solution = ts.simulate(top.build(), (0.0, 1.0), formulation="maggi-kane", integrator=ts.integrators.Nystrom4(0.01))
    with pytest.raises(AssertionError):
        top.check(solution)


def test_parallel_runs():
    parallel_runs.check(parallel_runs.SPINS[:3])


def test_stability_map(tmp_path):
    a, b, ensemble = stability_map.run(8, 2.0)
    stability_map.check(a, b, ensemble)
    stability_map.draw(a, b, ensemble.kept, 2.0, tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_tolerance_analysis():
    ensemble, lengths = tolerance_analysis.run(4)
    tolerance_analysis.check(ensemble, lengths)
    with pytest.raises(AssertionError):
        tolerance_analysis.check(ensemble, lengths + 1e-3)
