"""States between steps: those of other output times to the bit, on the constraints, of the run's own branch."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import CLOSE

C = ts.constraints
CORNERS = np.array(((0.0, 0.0, 0.0), (0.36, 0.93, 0.0), (1.95, 1.4, 0.0), (3.0, 0.0, 0.0)))


def four_bar():
    """With three redundant rows, of which others are kept from chart to chart."""
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    places = 0.5 * (CORNERS[1:] + CORNERS[:-1])
    rods = [scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=place) for place in places]
    ends = scene.ground, *rods, scene.ground
    for i, corner in enumerate(CORNERS):
        scene.add(C.Revolute.at(ends[i], ends[i + 1], point=corner, axis=(0, 0, 1), name=f"joint{i}"))
    scene.set("joint0", rate=5.0)
    return scene


def chain(*masses):
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    last = scene.ground
    for i, mass in enumerate(masses):
        body = scene.add_body(mass=mass, inertia=mass * np.array((0.02, 0.09, 0.1)), position=(i + 0.5, 0, 0))
        hinge = {"axis": (0, 0.6, 0.8)} if i % 2 == 0 else {}
        scene.add((C.Spherical if i % 2 else C.Revolute).at(last, body, point=(i, 0, 0), **hinge))
        last = body
    return scene


@pytest.mark.slow_for("sdirk54-null-space")
@pytest.mark.parametrize("form", ["tangent", "null-space"])
@pytest.mark.parametrize("method", ["dop853", "sdirk54"])
def test_redundant_rows(method, form):
    """Asked for one by one, all at once and as outputs."""
    options = {"integrator": method, "rtol": 1e-6, "atol": 1e-6, "formulation": form}
    run, t = ts.simulate(four_bar(), (0.0, 2.0), dense_output=True, **options), np.linspace(0.0, 2.0, 31)
    every = run.at(t).q
    np.testing.assert_array_equal([run.at(one).q for one in t[::-1]], every[::-1])
    np.testing.assert_allclose(every, ts.simulate(four_bar(), (0.0, 2.0), t_eval=t, **options).q, atol=CLOSE)


@pytest.mark.parametrize("masses", [(1.0, 1e6, 1.0), (1.0, 1e8, 1e-2), (1.0, 1e10, 1.0)])
def test_accelerations_of_series_at_mass_ratios(masses):
    t = np.linspace(0.0113, 0.69, 20)
    asked = ts.simulate(chain(*masses), (0.0, 0.7), integrator="taylor", t_eval=t)
    assert asked.constraint_error.acceleration.max() < 1e-11
    read = ts.simulate(chain(*masses), (0.0, 0.7), integrator="taylor", dense_output=True).at(t)
    np.testing.assert_allclose(read.qdd, asked.qdd, atol=1e-10)


def test_output_times_end_no_run_at_a_mass_ratio():
    """Residuals of the null-space form that fall no more are rounding."""
    options = {"integrator": "dop853", "formulation": "null-space", "rtol": 1e-7, "atol": 1e-7}
    every = ts.simulate(chain(1.0, 1e6, 1.0), (0.0, 0.7), **options).raise_if_failed()
    asked = ts.simulate(chain(1.0, 1e6, 1.0), (0.0, 0.7), t_eval=np.linspace(0.0113, 0.69, 40), **options)
    assert asked.success
    assert asked.stats.steps == every.stats.steps


def test_work_over_long_steps_of_series():
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(mass=1.0, position=(0, 0, 0), velocity=(0, 0, 1))
    scene.add(ts.forces.Spring(mass, scene.ground, point_b=(0, 0, -5), stiffness=100.0, damping=20.0, name="damper"))
    run = ts.simulate(scene, (0.0, 0.5), dense_output=True, rtol=1e-12, atol=1e-12)
    assert abs(np.ptp(run.energy[[0, -1]]) + run.work_of("damper")[-1]) < 1e-13


def test_a_motor_by_data_that_begin_late():
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(mass=1.0, inertia=(0.2, 0.3, 0.4))
    hinge = scene.add(C.Revolute.at(scene.ground, body, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    table = ts.Table([5.0, 5.5, 6.0, 7.0], [0.0, 0.1, 0.3, 0.2])
    scene.add(C.RotationMotor.of(hinge, angle=table))
    scene.set("hinge", rate=float(ts.motions.Piecewise(table).rate(5.0)), t=5.0)
    run = ts.simulate(scene, (5.0, 7.0))
    np.testing.assert_allclose(run.angle("hinge")[-1], 0.2, atol=CLOSE)
