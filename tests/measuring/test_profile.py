"""Where a scene's time goes: phases against counts, what is said to change."""

import sys

import numpy as np
import pytest

import tsdyn as ts
from benchmarks import stiff
from examples import drive_train, pendulum_chain, top, two_body_pendulum
from tests.helpers.processes import REPORT, run
from tests.helpers.scenes import build, random_chain
from tsdyn.measuring.phase_times import TIMERS
from tsdyn.simulation.scene_cache import prepared

I = ts.integrators
OUTSIDE = ("Python", "outputs", "choice of the method")


def calls(profile, group, part):
    return sum(phase.calls for phase in profile.phases if (phase.group, phase.part) == (group, part))


@pytest.fixture(scope="module")
def by_steps():
    return ts.profile(drive_train.build(), (0.0, 1.0), integrator="dop853", rtol=1e-6, atol=1e-6, advice=False)


@pytest.fixture(scope="module")
def by_series():
    return ts.profile(pendulum_chain.build(), (0.0, 1.0), advice=False)


@pytest.fixture(scope="module")
def by_stages():
    scene = build(random_chain(np.random.default_rng(1), 2))
    return ts.profile(scene, (0.0, 0.2), integrator=I.SDIRK54(1e-5, 1e-5), t_eval=(0.0, 0.2), advice=False)


# what is measured


@pytest.mark.slow
@pytest.mark.parametrize("name", ["by_steps", "by_series", "by_stages"])
def test_phases_add_up(name, request):
    found = request.getfixturevalue(name)
    assert found.accounted > 0.0
    compiled = sum(phase.seconds for phase in found.phases if phase.group not in OUTSIDE)
    assert found.accounted == pytest.approx(compiled / found.driver)
    assert all(phase.seconds >= 0.0 and phase.calls > 0 for phase in found.phases)
    assert sum(found.groups().values()) == pytest.approx(sum(phase.seconds for phase in found.phases))
    assert sum(map(found.share, found.groups())) == pytest.approx(1.0)


@pytest.mark.slow
def test_shares_of_a_run_that_turns_add_up():
    scene = ts.Scene()
    cart = scene.add_body(1.0, (0.1, 0.1, 0.1), (0.5, 0, 0), name="cart")
    scene.add(ts.constraints.Translational.at(scene.ground, cart, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(ts.forces.Spring(scene.ground, cart, stiffness=1e8, damping=1e4, free_length=0.6))
    found = ts.profile(scene, (0.0, 1.0), advice=False)
    assert found.solution.method.startswith("Radau")
    assert sum(map(found.share, found.groups())) == pytest.approx(1.0)
    groups = [line for line in str(found).split("\n\n")[1].splitlines()[1:] if not line.startswith(" ")]
    shares = [float(line.split(" %")[0].split()[-1]) for line in groups]
    assert sum(shares) == pytest.approx(100.0, abs=0.5)
    assert "calls and phases are those of Radau alone" in str(found)


@pytest.mark.slow
def test_calls_of_steps_are_those_counted(by_steps):
    stats = by_steps.solution.stats
    assert calls(by_steps, "positions", "corrections") == stats.placements
    assert calls(by_steps, "accelerations", "bodies and solves") == stats.evaluations
    assert calls(by_steps, "accelerations", "factors of Phi_q W Phi_q^T") == stats.placements
    assert calls(by_steps, "charts", "made") == stats.charts
    assert calls(by_steps, "charts", "looked at") == stats.steps + stats.rejected + 1
    assert calls(by_steps, "steps", "sums over stages") == stats.steps + stats.rejected
    for force in ("motor", "shaft", "brake", "cord"):
        assert calls(by_steps, "accelerations", f"force: {force}") == stats.evaluations
    assert calls(by_steps, "steps", "force: shaft") == stats.steps + 1  # which remembers its turns
    assert calls(by_steps, "outputs", "every step") == stats.steps + 1
    kinds = {"Spherical", "Dot1"}
    sweeps = stats.placements + stats.newton_iterations
    assert calls(by_steps, "positions", "constraint rows") == len(kinds) * sweeps
    assert calls(by_steps, "accelerations", "constraint rows") == len(kinds) * stats.evaluations


@pytest.mark.slow
def test_calls_of_a_series_are_those_counted(by_series):
    stats = by_series.solution.stats
    orders = stats.steps + 1  # order zero
    assert calls(by_series, "coefficients", "bodies and solves") == stats.evaluations - stats.steps + orders
    assert calls(by_series, "coefficients", "constraint rows") == 2 * (stats.evaluations - stats.steps + orders)
    assert calls(by_series, "landing", "factors") == stats.factorizations
    assert by_series.orders[0][0] == orders
    assert sum(count for count, _ in by_series.orders) == calls(by_series, "coefficients", "bodies and solves")
    assert sum(seconds for _, seconds in by_series.orders) == pytest.approx(by_series.groups()["coefficients"])


@pytest.mark.slow
def test_calls_of_stages_are_those_counted(by_stages):
    stats = by_stages.solution.stats
    assert calls(by_stages, "stage equations", "Jacobians") == stats.jacobians
    assert calls(by_stages, "stage equations", "iteration matrices") == stats.iteration_matrices
    assert calls(by_stages, "stage equations", "solves") == stats.stage_iterations
    assert calls(by_stages, "accelerations", "factors of Phi_q W Phi_q^T") == stats.placements


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["null-space", "maggi-kane"])
def test_other_forms(formulation):
    found = ts.profile(top.build(), (0.0, 0.5), integrator="rk45", formulation=formulation, advice=False)
    stats = found.solution.stats
    assert calls(found, "positions", "corrections, B and D") == stats.placements
    assert calls(found, "velocities", "qd = D vd") == stats.evaluations
    assert found.solution.formulation == formulation


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "formulation"), [("dop853", "tangent"), ("dop853", "null-space"), ("sdirk54", "tangent")]
)
def test_a_force_in_every_form(method, formulation):
    scene = two_body_pendulum.build()
    scene.add(ts.forces.Spring(*scene.bodies, point_a=(0, 0, 1), stiffness=30.0, damping=1.0, name="spring"))
    found = ts.profile(scene, (0.0, 0.5), integrator=method, formulation=formulation, advice=False)
    phases = [phase for phase in found.phases if phase.part == "force: spring"]
    assert {phase.group for phase in phases} == {"accelerations", *(["stage equations"] * (method == "sdirk54"))}
    assert sum(phase.calls for phase in phases) == found.solution.stats.evaluations


@pytest.mark.slow
def test_scenes_without_constraints_or_of_point_masses():
    scene = ts.Scene()
    scene.add_point_mass(1.0)
    for method in ("nystrom4", "taylor"):
        found = ts.profile(scene, (0.0, 0.1), integrator=method, advice=False)
        assert found.solution.success
        assert not any(phase.part == "constraint rows" for phase in found.phases)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["of a joint", "of the scene"])
def test_series_of_traced_functions(law):
    scene = ts.Scene()
    rod = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=1.0), position=(0.5, 0, 0))
    joint = scene.add(ts.constraints.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0)))
    if law == "of a joint":
        scene.add(ts.forces.JointTorque(joint, function=lambda t, angle, rate: -0.1 * angle * rate))
    else:
        scene.add(ts.forces.Control(lambda t, state: -0.1 * state.angle(joint), [joint]))
    found = ts.profile(scene, (0.0, 0.2), integrator="taylor", advice=False)
    assert calls(found, "coefficients", f"force: {scene.forces[0].name}") > 0


def test_what_is_asked_for_besides_is_told_apart():
    times = np.linspace(0.0, 1.0, 300)
    found = ts.profile(
        top.build(), (0.0, 1.0), t_eval=times, dense_output=True, events=lambda t, state: state.q[0] - 9.0, advice=False
    )
    parts = {phase.part: phase for phase in found.phases if phase.group == "outputs"}
    assert {name: phase.calls for name, phase in parts.items()} == {
        "times of t_eval": 300,
        "dense output": found.solution.stats.steps,
        "events": found.solution.stats.steps,
    }
    assert found.share("outputs") > 0.0


@pytest.mark.slow
def test_choosing_the_method_is_a_phase():
    found = ts.profile(stiff.hung(), (0.0, 1.0), rtol=1e-5, atol=1e-5, advice=False)
    assert found.solution.method.startswith("Radau")
    assert found.solution.method.startswith(repr(found.method))
    assert "choice of the method" in found.groups()


# the run itself is left alone


@pytest.mark.slow
def test_timers_change_no_number_and_stay_in_no_memory():
    scene = drive_train.build()
    before = ts.simulate(scene, (0.0, 0.5), integrator="dop853")
    found = ts.profile(scene, (0.0, 0.5), integrator="dop853", advice=False)
    after = ts.simulate(scene, (0.0, 0.5), integrator="dop853")
    for solution in (found.solution, after):
        np.testing.assert_array_equal(solution.q, before.q)
        assert solution.stats.evaluations == before.stats.evaluations
    timers = {timer.address for timer in TIMERS.values() if timer._address}
    spare = [memory for some in prepared(scene)._spare.values() for memory in some]
    assert spare
    assert not any(timers & set(memory.run.kernels.as_dict().values()) for memory in spare)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="its clock doesn't count nanoseconds")
def test_the_unit_of_the_clock_in_a_process_that_has_loaded_nothing():
    code = (
        REPORT
        + """
import tsdyn.measuring.phase_times as timers
timers.HAS_CYCLES = False
report(unit=timers.calibrate()[0])
"""
    )
    assert run(code, {})[0]["unit"] == pytest.approx(1e-9, rel=0.01)


# what to change


def advice(scene, span=(0.0, 1.0), **options):
    return "\n".join(ts.profile(scene, span, **options).advice)


@pytest.mark.slow
def test_a_method_that_is_slower_than_the_default():
    said = advice(top.build(), (0.0, 10.0), integrator="rk45", rtol=1e-9, atol=1e-9)
    assert "The default method, Taylor(rtol=1e-09, atol=1e-09) at" in said
    assert "times as quick" in said
    assert "the ends differ by" in said


@pytest.mark.slow
def test_what_refuses_series_and_what_it_costs():
    scene = drive_train.build()
    scene["motor"].torque = lambda t: (0.0, 0.0, 40.0 if t < 9.0 else 0.0)
    assert "Torque 'motor': its torque is a function of time that can't be traced" in advice(scene)
    prepared(scene)
    assert len(scene.forces) == 4


@pytest.mark.slow
def test_no_advice_ruins_the_answer():
    """The end of a chaotic motion to few digits is metres away by any other method or tolerance."""
    said = advice(
        two_body_pendulum.build(), (0.0, 60.0), integrator="rk45", rtol=1e-3, atol=1e-3, formulation="null-space"
    )
    assert "times as quick" not in said
    assert "Faster alternatives end elsewhere" in said


@pytest.mark.slow
def test_outputs_that_cost():
    assert "t_eval with 20001 outputs costs" in advice(top.build(), t_eval=np.linspace(0.0, 1.0, 20001))


@pytest.mark.slow
def test_steps_held_back():
    said = advice(top.build(), integrator=I.DOP853(1e-6, 1e-6, max_step=1e-3))
    assert "Without max_step, which sets most of the steps, it is" in said


@pytest.mark.slow
def test_a_costly_form():
    assert "formulation='tangent' is" in advice(pendulum_chain.build(6), (0.0, 0.3), formulation="null-space")


@pytest.mark.slow
def test_a_stiff_motion_by_an_explicit_method():
    said = advice(stiff.hung(), (0.0, 2.0), integrator=I.DOP853(1e-4, 1e-4))
    assert "The motion is stiff: Radau(rtol=0.0001, atol=0.0001, order=9) is" in said


@pytest.mark.slow
def test_a_run_that_ends_early():
    said = advice(top.build(), (0.0, 10.0), integrator="dop853", max_steps=20)
    assert said.startswith("The run ended early: The run reached max_steps.")


# runs with phases: contacts, exact friction, actions of events


def bouncing():
    scene = ts.Scene()
    ball = scene.add_point_mass(1.0, position=(0, 0, 1.0), velocity=(1, 0, 0), name="ball")
    floor = {"normal_b": (0, 0, 1), "restitution": 0.8, "kinetic": 0.2, "name": "floor"}
    scene.add(ts.constraints.PlaneContact(ball, scene.ground, unilateral=True, **floor))
    return scene


def braked():
    scene = ts.Scene()
    block = scene.add_point_mass(1.0, velocity=(1, 0, 0), name="block")
    scene.add(ts.constraints.PlaneContact(block, scene.ground, normal_b=(0, 0, 1), name="floor"))
    scene.add(ts.forces.ContactFriction(scene["floor"], kinetic=0.2, name="brake"))
    return scene


def kicked():
    """A stone that an event throws up again whenever it is at rest above the ground."""
    scene = ts.Scene()
    scene.add_point_mass(1.0, velocity=(0, 0, 1), name="stone")

    def top(t, state):
        return state.velocity("stone")[2]

    top.direction, top.action = -1, lambda change: change.impulse("stone", (0, 0, 2.0))
    return scene, top


@pytest.mark.slow
def test_phases_of_a_run_with_impacts():
    scene = bouncing()
    found = ts.profile(scene, (0.0, 6.0))
    solution = found.solution
    flights = calls(found, "steps", "flights, with searches and impacts")  # the kernel leaves the step of each event
    assert len(solution.impulses) <= calls(found, "events", "searches of steps") <= flights
    assert calls(found, "events", "impacts") == len(solution.impulses) > 30
    assert calls(found, "phases", "packed") == 2  # it flies, and rests: impacts end the slip
    assert sum(map(found.share, found.groups())) == pytest.approx(1.0)
    assert found.accounted == pytest.approx(1.0)
    assert all(phase.seconds > 0.0 and phase.calls > 0 for phase in found.phases)
    assert f"{len(solution.phases)} phases, {len(solution.impulses)} impulses" in str(found)
    assert found._repr_html_().count("<tr>") == 1 + len(list(found._rows()))
    assert any(item.startswith(f"Half of the {len(solution.impulses)} impulses lie between") for item in found.advice)
    again = ts.simulate(scene, (0.0, 6.0))
    assert again.q.tobytes() == solution.q.tobytes()


@pytest.mark.slow
def test_flights_of_a_run_with_impacts():
    """Without friction: one kernel call makes steps and impacts."""
    scene = ts.Scene()
    ball = scene.add_point_mass(1.0, position=(0, 0, 1.0))
    floor = {"normal_b": (0, 0, 1), "restitution": 0.99}
    scene.add(ts.constraints.PlaneContact(ball, scene.ground, unilateral=True, **floor))
    found = ts.profile(scene, (0.0, 30.0), advice=False)
    assert calls(found, "steps", "flights, with searches and impacts") < 5 < 30 < len(found.solution.impulses)
    assert found.accounted == pytest.approx(1.0)
    assert calls(found, "events", "searches of steps") == 0


@pytest.mark.slow
def test_phases_of_a_run_with_exact_friction():
    found = ts.profile(braked(), (0.0, 1.0), integrator="radau", advice=False)
    assert found.solution.sticking("brake")[-1]
    assert isinstance(found.method, I.Radau)
    assert calls(found, "events", "contacts and frictions that hold afterwards") == 2
    assert not any(phase.part == "impacts" for phase in found.phases)


@pytest.mark.slow
def test_phases_of_a_run_with_actions():
    scene, top = kicked()
    found = ts.profile(scene, (0.0, 1.0), events=top)
    assert calls(found, "events", "actions carried out") == len(found.solution.t_events[0]) == 5


@pytest.mark.slow
def test_plot_of_phases(tmp_path):
    pytest.importorskip("matplotlib")
    found = ts.profile(bouncing(), (0.0, 1.0), advice=False)
    assert len(found.plot(tmp_path / "figure.png").axes[0].patches) == len(found.phases)


# what it looks like, and what it refuses


@pytest.mark.slow
def test_text_notebook_and_one_line(by_steps, by_series):
    text = str(by_series)
    assert "coefficients" in text
    assert "Taylor(rtol=1e-08, atol=1e-08), formulation tangent" in text
    assert "series of constant columns of Phi_q" in text
    assert "Each order, from 0" in text
    assert "What to change:\n- nothing stands out" in text
    assert "force: shaft" in str(by_steps)
    shown = by_steps._repr_html_()
    assert shown.count("<tr>") == 1 + len(list(by_steps._rows()))
    assert "DOP853" in shown
    assert repr(by_steps).startswith("<Profile: ")
    assert by_series.skipped["forces_skipped"] == by_series.solution.stats.evaluations


@pytest.mark.slow
def test_plot(by_steps, tmp_path):
    pytest.importorskip("matplotlib")
    figure = by_steps.plot(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert len(figure.axes[0].patches) == len(by_steps.phases)


@pytest.mark.slow
def test_plot_without_matplotlib(by_steps, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ts.MissingDependency, match="pip install"):
        by_steps.plot()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"progress": True}, "progress"),
        ({"store": "run.zarr"}, "leave store out"),
        ({"store": "run.zarr", "checkpoint": 1.0}, "leave store out"),
        ({"advice": 1.0}, "advice"),
        ({"integrator": "rk4"}, "unknown integrator"),
        ({"formulation": "other"}, "unknown formulation"),
        ({"t_eval": (0.0, 2.0)}, "t_eval"),
    ],
)
def test_bad_input(options, words):
    with pytest.raises(ts.InvalidArgument, match=words):
        ts.profile(top.build(), (0.0, 1.0), **options)


def test_what_is_no_scene():
    with pytest.raises(ts.InvalidArgument, match=r"ts\.Scene"):
        ts.profile("top", (0.0, 1.0))


@pytest.mark.slow
def test_debug_mode_has_no_kernels_to_time():
    code = (
        REPORT
        + """
import tsdyn as ts
from examples import top
try:
    ts.profile(top.build(), (0.0, 0.01))
except ts.InvalidArgument as error:
    report(said=str(error))
"""
    )
    assert "TSDYN_DEBUG=1" in run(code, {"TSDYN_DEBUG": "1"})[0]["said"]
