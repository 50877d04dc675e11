"""The laws that judge runs: a sound run keeps them, and each finds the fault that it is for."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tsdyn.stress import judgement, laws
from tsdyn.stress.contact_scenes import Intervention
from tsdyn.stress.random_scenes import CONTACTS, DrawnCase, drawn

C = ts.constraints


def scene(gravity=(0.0, 0.0, -9.81), held=True):
    """A double pendulum in space, or the same two bodies in free fall."""
    made = ts.Scene(gravity=gravity)
    one = made.add_body(1.0, (0.1, 0.2, 0.25), position=(0.5, 0.0, 0.0), angular_velocity=(0.0, 0.0, 0.0), name="one")
    two = made.add_body(2.0, (0.1, 0.2, 0.25), position=(1.5, 0.0, 0.0), name="two")
    if held:
        made.add(C.Revolute.at(made.ground, one, point=(0, 0, 0), axis=(0, 1, 0)))
    else:
        two.angular_velocity = (0.0, 0.0, 2.0)
        two.velocity = (0.0, 1.0, 0.0)
    made.add(C.Spherical.at(one, two, point=(1, 0, 0)))
    return made


def run(**options):
    return ts.simulate(scene(**options), (0.0, 0.5), dense_output=True).raise_if_failed()


def broken(solution):
    return {found.law for found in laws.findings(solution) if found.broken}


def test_a_sound_run_keeps_all_laws():
    assert not broken(run())
    assert not broken(run(held=False))


@pytest.mark.parametrize(
    ("name", "where", "by", "law"),
    [
        ("q", 0, 1e-7, "constraints, position"),
        ("qd", 2, 1e-6, "constraints, velocity"),
        ("qdd", 2, 1e-5, "constraints, acceleration"),
        ("q", 9, np.nan, "finite numbers"),
        ("qdd", 12, 1e-4, "torque balance"),
        ("qdd", 8, 1e-4, "force balance"),
        ("qd", 9, 1e-6, "dense output, qd"),
    ],
)
def test_a_fault_is_found(name, where, by, law):
    solution = run()
    getattr(solution, name)[-1, where] += by
    assert law in broken(solution)


def test_a_motor_that_is_a_turn_off_is_found():
    """No row tells whole turns."""
    scene = ts.Scene(gravity=(0, 0, 0))
    wheel = scene.add_body(1.0, (1, 1, 1), angular_velocity=(0, 0, 2))
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    motor = scene.add(C.RotationMotor.of(hinge, angle=ts.motions.Ramp(0.0, 2.0)))
    solution = ts.simulate(scene, (0.0, 5.0))
    found = list(laws.motors(solution))
    assert len(found) == 2
    assert not any(each.broken for each in found)
    motor.angle = ts.motions.Ramp(2.0 * np.pi, 2.0)
    assert all(each.broken for each in laws.motors(solution))


def test_energy_that_is_lost_is_found():
    solution = run()
    sound, size = laws.energy_left(solution)
    assert sound < 1e-7 * size
    solution.qd[-1] *= 1.0 + 1e-4
    del solution.kinetic_energy
    assert laws.energy_left(solution)[0] > 1e-5 * size


def bounces():
    """A ball on a floor, with e = 0.5, and a rod between stops: closed and open contacts, impacts."""
    scene = ts.Scene()
    ball = scene.add_point_mass(1.0, position=(0, 0, 0.3), name="ball")
    scene.add(C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), unilateral=True, restitution=0.5, name="floor"))
    rod = scene.add_body(1.0, (0.1, 0.1, 0.01), position=(2, 0, -1), name="rod")
    hinge = scene.add(C.Revolute.at(scene.ground, rod, point=(2, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.set(hinge, angle=0.5)
    scene.add(C.Stop(hinge, lower=-0.2, restitution=0.0, name="stop"))
    return scene


def bounced():
    return ts.simulate(bounces(), (0.0, 1.0), dense_output=True).raise_if_failed()


def test_a_sound_run_with_contacts_keeps_all_laws():
    solution = bounced()
    assert {found.law for found in laws.findings(solution)} >= {
        "penetration", "reactions that pull", "reactions of open contacts", "momenta at an impact",
    }  # fmt: skip
    assert not broken(solution)


def test_impulses_of_friction_are_judged():
    """Those of a run are sound; where one is off, it is found."""
    scene = ts.Scene()
    box = scene.add_body(**ts.shapes.box((0.4, 0.3, 0.2), mass=2.0), position=(0, 0, 0.5), velocity=(1, 0.5, 0))
    box.orientation = Rotation.from_euler("xyz", (0.3, 0.2, 0.1))
    for i, x in enumerate((-0.2, 0.2)):
        law = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": 0.3, "kinetic": 0.2}
        scene.add(C.PlaneContact(box, scene.ground, point_a=(x, -0.15, -0.1), **law, name=f"{i}"))
    solution = ts.simulate(scene, (0.0, 0.4), dense_output=True).raise_if_failed()
    assert "momenta at an impact" not in broken(solution)
    t, name, p = solution.impulses[0]
    solution._phases.impulses[0] = t, name, type(p)(p, 0.9 * p.tangential)
    assert "momenta at an impact" in broken(solution)


def test_faults_of_contacts_are_found():
    """A floor that is too high, reactions of open contacts, impulses that are off, energy gained at an impact."""
    solution = bounced()
    solution.packed.members[0].constraint.point_b = (0, 0, 1e-3)
    assert "penetration" in broken(solution)
    solution = bounced()
    solution.multipliers[1, 0] = 1.0  # in flight: it pulls
    assert broken(solution) == {"reactions that pull", "reactions of open contacts"}
    solution = bounced()
    t, name, impulse = solution._phases.impulses[0]
    solution._phases.impulses[0] = t, name, 1.001 * impulse
    assert broken(solution) == {"momenta at an impact"}
    solution = bounced()
    sound, size = laws.energy_left(solution)
    assert sound < 1e-8 * size
    after = np.flatnonzero(np.diff(solution.t) == 0.0)[0] + 1
    solution.qd[after, 2] *= 2.1  # more than it came with
    del solution.kinetic_energy
    assert laws.energy_left(solution)[0] > 1e-2 * size


def sliding():
    """A box that slides and turns on the floor, after a fall."""
    scene = ts.Scene()
    box = scene.add_body(**ts.shapes.box((0.4, 0.3, 0.2), mass=2.0), position=(0, 0, 0.1), velocity=(1, 0.5, 0))
    box.angular_velocity = (0, 0, 2)
    for i, (x, y) in enumerate(((-0.2, -0.15), (0.2, -0.15), (0, 0.15))):
        law = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.2}
        scene.add(C.PlaneContact(box, scene.ground, point_a=(x, y, -0.1), **law, name=f"{i}"))
    return scene


def test_friction_that_is_off_is_found():
    """Outside its cone, where it sticks; along the slip, where it slides."""
    solution = ts.simulate(sliding(), (0.0, 1.0), dense_output=True).raise_if_failed()
    assert {found.law for found in laws.rubbing(solution)} == {"friction in its cone", "friction against the slip"}
    assert not broken(solution)
    assert solution.sticking("0")[-1]
    solution.multipliers[-1, 1] = 0.21 * solution.multipliers[-1, 0]
    assert "friction in its cone" in broken(solution)
    solution = ts.simulate(sliding(), (0.0, 1.0), dense_output=True)
    solution.multipliers[0, 1:3] *= -1.0
    assert "friction against the slip" in broken(solution)


def test_phases_that_overlap_are_found():
    solution = bounced()
    assert not any(found.broken for found in laws.phases(solution))
    begin, _, names = solution._phases.list[0]
    solution._phases.list[0] = begin, begin + 1e-9, names
    assert "phases in a row" in broken(solution)


def with_tilted_image(case, x):
    """A function like `run_case`, with a gravity that the image has alone; its bodies are in reverse order."""

    def run(one, **options):
        if one.scene.bodies[0].name != case.scene.bodies[0].name:
            one = one._replace(scene=one.scene.with_parameters({"gravity": (x, 0, -9.81)}))
        return judgement.run_case(one, **options)

    return run


def test_a_motion_that_the_mirror_changes_is_found():
    """Of a box that slides, a chain of hinges with stops, and ropes; then with a gravity that the image has alone."""
    seeds = ("stops", 5000003), ("ropes", 5000003), ("cradle", 5000001)
    cases = [drawn(np.random.default_rng(seed), 2, 3, {kind: CONTACTS[kind]}) for kind, seed in seeds]
    for case in [DrawnCase("sliding", sliding(), (0.0, 1.0), {"rtol": 1e-8, "atol": 1e-8}), *cases]:
        found = judgement.mirrored(case, judgement.run_case(case), judgement.run_case)
        assert [each.law for each in found] == ["motion of the mirrored scene"]
        assert not found[0].broken

    [found] = judgement.mirrored(cases[0], judgement.run_case(cases[0]), with_tilted_image(cases[0], 0.01))
    assert found.broken


@pytest.mark.slow
def test_an_image_may_leave_a_motion_that_amplifies_rounding_and_no_other():
    """A body hangs from a pin with a play of 4 mm, along which it runs to and fro: 1e-14 of its start grow to 1e-3."""
    case = drawn(np.random.default_rng(6000209), 1, 3, {"play": CONTACTS["play"]})
    solution = judgement.run_case(case)
    [found] = judgement.mirrored(case, solution, judgement.run_case)
    assert found.size > 1e-4
    assert not found.broken

    [found] = judgement.mirrored(case, solution, with_tilted_image(case, 1e-4))
    assert found.broken


@pytest.mark.slow
def test_fixed_steps_are_judged_where_the_shortest_of_them_follow_the_motion():
    """Slips of a small coin turn within 1e-6 s, where DOP853 makes most of its steps."""
    coin = drawn(np.random.default_rng(6000308), 1, 3, {"coins": CONTACTS["coins"]})
    assert not judgement._is_resolved(coin, judgement.run_case)
    box = DrawnCase("sliding", sliding(), (0.0, 1.0), {"integrator": ts.integrators.Nystrom4(step=0.01)})
    assert judgement._is_resolved(box, judgement.run_case)


def test_reactions_of_rounding_do_not_pull():
    """Two particles touch while they fall: their reaction is rounding of their weights."""
    scene, apart = ts.Scene(), np.array([0.3, 0.1, 0.2]) / np.sqrt(0.14)
    falling = [scene.add_point_mass(m, 0.2 * i * apart, (0.1, 0.2, 0.3)) for i, m in enumerate((1.0, 1.7))]
    scene.add(C.SphereContact(*falling, radius_a=0.1, radius_b=0.1, name="touch"))
    solution = ts.simulate(scene, (0, 1), dense_output=True)
    assert np.abs(solution.multipliers).max() > 0.0
    assert not broken(solution)


def test_momenta_of_a_fall():
    assert max(laws.momentum_left(run(held=False))) < 1e-9
    assert max(laws.momentum_left(run())) > 1e-2  # the ground pushes


def test_momenta_of_a_loaded_scene_are_not_judged():
    made = ts.Scene(gravity=(0, 0, 0))
    body = made.add_body(1.0, (0.1, 0.2, 0.25))
    made.add(ts.forces.PointForce(body, force=(1, 0, 0), point_a=(0, 0.1, 0)))
    case = DrawnCase("loaded", made, (0.0, 0.5), {})
    assert judgement.momenta(case, ts.simulate(made, case.span, dense_output=True), None) == []


def test_an_error_that_does_not_fall_with_the_tolerance_is_found():
    """A method that is wrong whatever its tolerance: its runs end with the velocities of another scene."""
    made, other = scene(), scene(gravity=(0.0, 0.0, -9.80))
    case = DrawnCase("double pendulum", made, (0.0, 0.5), {"rtol": 1e-8, "atol": 1e-8})

    def right(case, **options):
        return ts.simulate(made, case.span, **{"dense_output": True} | case.options | options)

    def wrong(case, **options):
        return ts.simulate(other, case.span, **{"dense_output": True} | case.options | options)

    [found] = judgement.another_method(case, right(case), right)
    assert not found.broken
    [found] = judgement.another_method(
        case, right(case), lambda case, **o: (wrong if "integrator" in o else right)(case, **o)
    )
    assert found.broken


@pytest.mark.parametrize(("share", "sound"), [(1.0, True), (1.0 + 1e-6, False)])
def test_impulses_of_actions_are_judged(share, sound):
    """A kick of the user's at an instant of its own."""
    scene, kick = bounces(), np.array((0.3, 0.0, 2.0))
    events = [Intervention(("impulse", "ball", kick), t=0.1)]
    solution = ts.simulate(scene, (0.0, 0.2), events=events, dense_output=True).raise_if_failed()
    given = [(solution.t_events[0], scene["ball"], share * kick)]
    found = {found.law for found in laws.findings(solution, given) if found.broken}
    assert found == (set() if sound else {"momenta at an impact"})


@pytest.mark.slow
def test_a_hybrid_scene_is_judged():
    case = drawn(np.random.default_rng(7000003), 1, 3, {"hybrid": CONTACTS["hybrid"]})
    assert judgement.judge_case(case, (judgement.once_more,)).word == "success"
