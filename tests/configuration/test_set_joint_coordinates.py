"""`scene.set`: coordinates and rates of joints at the start, and the rest of the scene assembled around them."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import CLOSE, FINE, HELD, TIGHT
from tsdyn import constraints as c


def arms(lengths=(1.0, 1.0, 1.0), moving_base=False):
    """A chain of arms on hinges; on a base that moves, where asked for."""
    scene = ts.Scene()
    before, at = scene.ground, 0.0
    if moving_base:
        before = scene.add_body(5.0, (1, 1, 1), velocity=(0.3, 0, 0.1), angular_velocity=(0, 0.4, 0.2), name="base")
    for i, length in enumerate(lengths):
        arm = scene.add_body(1.0, (0.1, 0.2, 0.1), (at + length / 2, 0, 0), name=f"arm{i}")
        scene.add(c.Revolute.at(before, arm, point=(at, 0, 0), axis=(0, 1, 0.2 * i), name=f"hinge{i}"))
        before, at = arm, at + length
    if moving_base:
        scene.assemble()
    return scene


def four_bar():
    """A crank of 1 m, a coupler, a rocker of 2 m: the crank can turn all the way round."""
    scene = ts.Scene()
    corners = np.array([(0, 0, 0), (0, 0, 1), (2, 0, 2), (2, 0, 0)], float)
    links = [scene.add_body(1.0, (0.1, 0.2, 0.1), (corners[i] + corners[i + 1]) / 2) for i in range(3)]
    bodies = [scene.ground, *links, scene.ground]
    for i, point in enumerate(corners):
        scene.add(c.Revolute.at(bodies[i], bodies[i + 1], point=point, axis=(0, 1, 0), name=f"hinge{i}"))
    return scene


def start(scene):
    """A solution with one output, the start."""
    return ts.simulate(scene, (0, 1e-3), t_eval=[0.0])


def coordinates(scene):
    """Angles and rates of all hinges at the start."""
    solution, hinges = start(scene), [item.name for item in scene.constraints if isinstance(item, c.Revolute)]
    return np.array([[solution.angle(name)[0], solution.angle_rate(name)[0]] for name in hinges])


@pytest.mark.parametrize("moving_base", [False, True])
def test_the_other_joints_of_a_tree_stay_as_they_are(moving_base):
    scene = arms(moving_base=moving_base)
    scene.set("hinge1", angle=0.3, rate=2.0)
    scene.set("hinge2", angle=-0.4, rate=0.5)
    before = coordinates(scene)
    scene.set("hinge1", angle=-1.2, rate=-3.0)
    assert coordinates(scene) == pytest.approx(np.vstack((before[0], [-1.2, -3.0], before[2])), abs=HELD)
    scene.set("hinge0", rate=7.0)
    assert coordinates(scene)[:, 1] == pytest.approx([7.0, -3.0, 0.5], abs=HELD)


def test_angles_of_any_number_of_turns_are_counted_on_from():
    scene = arms()
    scene.set("hinge0", angle=20.0)
    assert coordinates(scene)[0, 0] == pytest.approx(20.0, abs=HELD)
    turned = scene.body("arm0").position
    scene.set("hinge0", angle=20.0 - 6.0 * np.pi)
    assert scene.body("arm0").position == pytest.approx(turned, abs=HELD)


def test_a_joint_whose_first_body_hangs_on_the_second():
    scene = ts.Scene()
    arm = scene.add_body(1.0, (1, 1, 1), (1, 0, 0))
    hinge = scene.add(c.Revolute.at(arm, scene.ground, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.set(hinge, angle=0.5, rate=2.0)
    assert arm.position == pytest.approx([np.cos(0.5), -np.sin(0.5), 0])
    assert arm.angular_velocity == pytest.approx([0, 0, -2])
    assert start(scene).angle(hinge)[0] == pytest.approx(0.5)


def test_a_loop_goes_round_on_its_branch():
    scene = four_bar()
    for angle in (0.5, 3.0, 6.0):
        scene.set("hinge0", angle=angle, rate=2.0)
        assert coordinates(scene)[0] == pytest.approx([angle, 2.0], abs=FINE)
    scene.set("hinge0", angle=2.0 * np.pi, rate=0.0)
    assert coordinates(scene)[1:, 0] == pytest.approx([0, 0, 0], abs=CLOSE)  # back where it was built


def test_joints_of_a_loop_are_kept_where_asked_for():
    scene = ts.Scene()
    corners = [(0, 0, 0), (-0.3, 0, 1), (1, 0, 1.8), (2.3, 0, 1), (2, 0, 0)]
    links = [scene.add_body(1.0, (0.1, 0.2, 0.1), np.mean(corners[i : i + 2], axis=0)) for i in range(4)]
    bodies = [scene.ground, *links, scene.ground]
    for i, point in enumerate(corners):
        scene.add(c.Revolute.at(bodies[i], bodies[i + 1], point=point, axis=(0, 1, 0), name=f"hinge{i}"))
    scene.set("hinge0", angle=0.2, rate=1.0)
    scene.set("hinge4", angle=-0.1, rate=0.5, keep=["hinge0"])
    assert coordinates(scene)[[0, 4]] == pytest.approx(np.array([[0.2, 1.0], [-0.1, 0.5]]), abs=FINE)


@pytest.mark.slow
def test_a_goal_out_of_reach_leaves_the_bodies_as_they_were():
    scene = four_bar()
    before = scene.start
    with pytest.raises(ts.InconsistentState, match=r"'hinge3' can't be set so: .* of the way"):
        scene.set("hinge3", angle=3.0)  # a rocker
    assert np.array_equal(scene.start, before)
    assert len(scene.constraints) == 4 + 3


def test_angle_and_displacement_of_one_joint():
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1, 1, 1), (1, 0, 0))
    nut = scene.add_body(1.0, (1, 1, 1), (2, 0, 0))
    guide = scene.add(c.Cylindrical.at(scene.ground, rod, point=(0, 0, 0), axis=(1, 0, 0)))
    thread = scene.add(c.Screw.at(rod, nut, point=(2, 0, 0), axis=(1, 0, 0), lead=0.1))
    scene.set(guide, angle=1.0, displacement=2.0, angle_rate=3.0, displacement_rate=4.0)
    scene.set(thread, angle=20.0, rate=1.0)
    solution = start(scene)
    for joint, values in ((guide, (1.0, 3.0, 2.0, 4.0)), (thread, (20.0, 1.0, 2.0, 0.1))):
        found = [getattr(solution, x)(joint)[0] for x in ("angle", "angle_rate", "displacement", "displacement_rate")]
        assert found == pytest.approx(values, abs=TIGHT)


def test_two_angles_of_a_universal_joint():
    scene = ts.Scene()
    shaft = scene.add_body(1.0, (1, 1, 1), (1, 0, 0))
    joint = scene.add(c.Universal.at(scene.ground, shaft, point=(0, 0, 0), axis=(0, 1, 0), axis_b=(0, 0, 1)))
    scene.set(joint, angle=(0.3, 7.0), rate=(1.0, 2.0))
    solution = start(scene)
    assert solution.angle(joint) == pytest.approx(np.array([[0.3, 7.0]]))
    assert solution.angle_rate(joint) == pytest.approx(np.array([[1.0, 2.0]]))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({}, "no value is given"),
        ({"angle": (1, 2)}, "must be a finite number"),
        ({"angle": "right"}, "must be a finite number"),
        ({"angle": np.nan}, "must be a finite number"),
        ({"displacement": 1.0}, "it has an angle"),
        ({"rate": 1.0, "angle_rate": 1.0}, "not both"),
        ({"angle": 1.0, "keep": ["hing"]}, "did you mean"),
        ({"angle": 1.0, "keep": "hinge1"}, "sequence of joints"),
        ({"angle": 1.0, "t": "soon"}, "finite time"),
    ],
)
def test_wrong_values_are_refused(wrong, message):
    with pytest.raises(ts.TsdynError, match=message):
        arms().set("hinge0", **wrong)


def test_a_joint_leaves_its_stop():
    """Closed contacts don't hold a joint to which a value is given; a run names one that penetrates."""
    scene = ts.Scene()
    bar = scene.add_body(2.0, (0.2, 0.2, 0.01), (0, 0, -1), name="bar")
    hinge = scene.add(c.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.add(c.Stop(hinge, lower=0.0, name="stop"))
    scene.set(hinge, angle=0.5, rate=-1.0)
    np.testing.assert_allclose(bar.position, [-np.sin(0.5), 0, -np.cos(0.5)], atol=1e-15)
    assert ts.simulate(scene, (0, 0.1)).phases == [(0.0, 0.1, ())]
    scene.set(hinge, angle=0.0)
    assert scene.set(hinge, rate=0.0).moved == 0.0  # it stands
    scene.set(hinge, angle=-0.2)
    with pytest.raises(ts.InconsistentState, match=r"stop is passed by 0\.2"):
        ts.simulate(scene, (0, 0.1))


def test_contacts_that_can_hold_do():
    """A bar stands on its end, which is closed: its slide is moved, and the end stays on the floor."""
    scene = ts.Scene()
    bar = scene.add_body(1.0, (0.1, 0.1, 0.1), (0.3, 0, 0.4), name="bar")
    scene.add(c.Planar.at(scene.ground, bar, point=bar.position, axis=(0, 1, 0)))
    cart = scene.add_body(1.0, (0.1, 0.1, 0.1), (0.3, 0, 0.4), name="cart")
    slide = scene.add(c.Translational.at(scene.ground, cart, point=cart.position, axis=(0, 0, 1), name="slide"))
    scene.add(c.Revolute.at(cart, bar, point=cart.position, axis=(0, 1, 0)))
    floor = {"point_a": (-0.3, 0, -0.4), "normal_b": (0, 0, 1), "unilateral": True, "name": "floor"}
    scene.add(c.PlaneContact(bar, scene.ground, **floor))
    scene.set(slide, displacement=0.05)
    solution = ts.simulate(scene, (0, 1e-3))
    assert abs(solution.position("bar", point=(-0.3, 0, -0.4))[0, 2]) < 1e-12
    assert solution.phases[0][2] == ("floor",)
