"""Trees of joints with open loops assemble from far away; what isn't assembled claims no conflict."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.closed_trees import closed_tree
from tests.helpers.sketches import Builder
from tests.helpers.tolerances import ALGEBRA, HELD, NEAR

C = ts.constraints
X, Y, Z = np.eye(3)
CRANK, COUPLER, ROCKER, BASE = 0.3, 0.9, 0.7, 0.8  # m


@pytest.mark.slow_but("2", "35")
@pytest.mark.parametrize("seed", [2, 8, 24, 26, 31, 35, 38, 51, 56, 101])
def test_random_trees_close_from_far_away(seed):
    """They are known to close: their loops were built closed, then the joints displaced by up to 2.5 rad."""
    rng = np.random.default_rng(seed)
    scene, loops = closed_tree(rng, int(rng.integers(6, 25)), int(rng.integers(1, 5)), 2.5)
    gap = np.abs(scene.evaluate().Phi).max()
    report = scene.assemble()
    assert gap > 0.1
    assert np.abs(scene.evaluate().Phi).max() < HELD
    assert report.residual < ALGEBRA
    assert loops


def four_bar(weld=False):
    """A four-bar as files have it: crank and coupler, and the rocker on its own, all along x; one loop is open."""
    scene = ts.Scene()
    lengths = {"crank": CRANK, "coupler": COUPLER, "rocker": ROCKER}
    starts = {"crank": 0.0, "coupler": CRANK, "rocker": BASE}
    for name, length in lengths.items():
        scene.add_body(
            **ts.shapes.rod(length, axis="x", mass=1.0), position=(starts[name] + length / 2, 0, 0), name=name
        )
    for name, a, b, x in (
        ("bearing", scene.ground, "crank", 0.0),
        ("pin", "crank", "coupler", CRANK),
        ("far", scene.ground, "rocker", BASE),
    ):
        scene.add(C.Revolute.at(scene[a] if isinstance(a, str) else a, scene[b], point=(x, 0, 0), axis=Z, name=name))
    places = {"point_a": (COUPLER / 2, 0, 0), "point_b": (ROCKER / 2, 0, 0), "axis_a": Z, "axis_b": Z}
    scene.add(C.Revolute(scene["coupler"], scene["rocker"], **places, name="close"))
    return scene


def rocker_angle(crank, side):
    """Of the rocker from x, by the law of cosines, its pin on one side of the diagonal."""
    x, y = CRANK * np.cos(crank) - BASE, CRANK * np.sin(crank)
    d = np.hypot(x, y)
    return np.arctan2(y, x) - side * np.arccos((ROCKER**2 + d**2 - COUPLER**2) / (2.0 * ROCKER * d))


@pytest.mark.parametrize("crank", [-2.0, 0.4, 1.1, 3.0])
def test_joints_take_the_values_given(crank):
    scene = four_bar()
    report = scene.assemble(joints={"bearing": crank})
    solution = ts.simulate(scene, (0.0, 1e-9))
    assert report.released == ()
    assert solution.angle("bearing")[0] == pytest.approx(crank, abs=HELD)
    found = solution.angle("far")[0]
    assert min(abs(np.angle(np.exp(1j * (found - rocker_angle(crank, side))))) for side in (1, -1)) < HELD
    assert report.residual < ALGEBRA


def test_values_that_the_loop_refuses_are_a_start():
    """The rocker swings between two dead centres, where crank and coupler are in line."""
    scene = four_bar()
    report = scene.assemble(joints={"far": 3.1, scene["bearing"]: 0.5})
    assert "far" in report.released
    assert report.residual < ALGEBRA


def test_turns_of_a_value_count():
    scene = four_bar()
    scene.assemble(joints={"bearing": 0.4 + 4.0 * np.pi})
    assert ts.simulate(scene, (0.0, 1e-9)).angle("bearing")[0] == pytest.approx(0.4 + 4.0 * np.pi, abs=HELD)


def test_a_tree_is_displaced_by_its_joints_alone():
    """No loop: each joint has its value, and no other joint moves."""
    scene = ts.Scene()
    arm = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=1.0), position=(0.5, 0, 0), name="arm")
    ram = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=1.0), position=(1.5, 0, 0), name="ram")
    head = scene.add_body(1.0, (1, 1, 1), (2.0, 0, 0), name="head")
    scene.add(C.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=Z, name="hinge"))
    scene.add(C.Cylindrical.at(arm, ram, point=(1.0, 0, 0), axis=X, name="ram joint"))
    scene.add(C.Universal.at(ram, head, point=(2.0, 0, 0), axis=Y, axis_b=Z, name="wrist"))
    scene.assemble(joints={"hinge": 2.0, "ram joint": (0.5, 0.25), "wrist": (0.3, -0.4)})
    solution = ts.simulate(scene, (0.0, 1e-9))
    assert solution.angle("hinge")[0] == pytest.approx(2.0, abs=HELD)
    assert solution.angle("ram joint")[0] == pytest.approx(0.5, abs=HELD)
    assert solution.displacement("ram joint")[0] == pytest.approx(0.25, abs=HELD)
    np.testing.assert_allclose(solution.angle("wrist")[0], (0.3, -0.4), atol=HELD)
    np.testing.assert_allclose(ram.position, 1.75 * np.array([np.cos(2.0), np.sin(2.0), 0.0]), atol=HELD)


def test_a_loop_is_cut_where_it_is_said():
    """The bearing closes the loop; crank, coupler and rocker hang from the far one."""
    scene = four_bar()
    report = scene.assemble(joints={"pin": 0.9}, loops=["bearing"])
    assert report.released == ()
    assert ts.simulate(scene, (0.0, 1e-9)).angle("pin")[0] == pytest.approx(0.9, abs=HELD)


def test_welds_that_are_upside_down():
    """Rows of a weld also admit opposed axes, where continuation ends; in joint coordinates it is turned round."""
    m, reach = Builder(), 0.5
    scene, points = (
        m.scene,
        [np.array(x, float) for x in ((0, 0, 0), (reach, 0, 0), (2 * reach, 0, 0), (3 * reach, 0, 0))],
    )
    links = [m.link(f"link {i}", *points[i : i + 2]) for i in range(3)]
    for i in range(3):
        m.pin(links[i - 1] if i else None, links[i], points[i], name=f"pin {i}")
    scene.add(
        C.Fixed(
            links[2],
            scene.ground,
            point_b=(0.3, 0.2, 0),
            axis_a=Z,
            axis_b=Z,
            reference_a=X,
            reference_b=-X,
            name="weld",
        )
    )
    assert scene.assemble().residual < ALGEBRA
    np.testing.assert_allclose(links[2].position, (0.3, 0.2, 0.0), atol=HELD)
    turned = ts.simulate(scene, (0.0, 1e-9)).rotation(links[2])[0]
    np.testing.assert_allclose(turned, np.diag((-1.0, -1.0, 1.0)), atol=HELD)


def test_what_is_not_proved_is_no_conflict():
    """A bead on two parallel planes: no bound of a distance tells it, so it isn't assembled from so many starts."""
    messages = []
    for _ in range(2):
        scene = ts.Scene()
        bead = scene.add_point_mass(1.0, (0.2, 0.1, 0.3), name="bead")
        for height in (0.0, 1.0):
            scene.add(C.PlaneContact(bead, scene.ground, point_b=(0, 0, height), normal_b=Z, name=f"plane {height:g}"))
        with pytest.raises(
            ts.InconsistentState, match=r"not assembled from \d+ starts.*No conflict is proved"
        ) as caught:
            scene.assemble()
        assert {each.name for each in caught.value.constraints} == {"plane 0", "plane 1"}
        messages.append(str(caught.value))
    assert messages[0] == messages[1]
    assert "These" not in messages[0]


def test_directions_at_angles_that_contradict():
    """Two axes at 0.4 rad from a third one that are 1 rad apart; a third lean is no part of it."""
    scene = ts.Scene()
    top = scene.add_body(1.0, (1, 1, 1), orientation=(0.9, 0.3, 0.1, 0.3), name="top")
    cosine = float(np.cos(0.4))
    for name, axis in (("one", Z), ("other", (0, np.sin(1.0), np.cos(1.0)))):
        scene.add(C.Dot1(top, scene.ground, axis_a=Z, axis_b=axis, value=cosine, name=name))
    scene.add(C.Dot1(top, scene.ground, axis_a=X, axis_b=Y, value=0.1, name="third"))
    with pytest.raises(ts.InconsistentState, match=r"2 conflict: .*at least 1 rad and at most 0\.8 rad") as caught:
        scene.assemble()
    assert {each.name for each in caught.value.constraints} == {"one", "other"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"joints": {"bearng": 1.0}}, "did you mean"),
        ({"joints": [("bearing", 1.0)]}, "values by joint"),
        ({"joints": {"bearing": (1.0, 2.0)}}, "a finite number"),
        ({"joints": {"bearing": np.nan}}, "a finite number"),
        ({"joints": {"crank": 1.0}}, "no constraint or force"),
        ({"loops": "bearing"}, "sequence of joints"),
        ({"loops": ["crank"]}, "no constraint or force"),
    ],
)
def test_wrong_values_are_refused(arguments, said):
    scene = four_bar()
    before = scene.start[0]
    with pytest.raises(ts.TsdynError, match=said):
        scene.assemble(**arguments)
    np.testing.assert_array_equal(scene.start[0], before)


def test_a_far_loop_of_rods():
    """A platform on three rods, drawn upside down beside them."""
    scene = ts.Scene()
    plate = scene.add_body(1.0, (1, 1, 2), (2.0, 0.3, -1.0), (0.0, 0.6, 0.8, 0.0), name="plate")
    for k, angle in enumerate(np.arange(3) * 2.0 * np.pi / 3.0):
        foot = np.array([np.cos(angle), np.sin(angle), 0.0])
        scene.add(C.Distance(scene.ground, plate, point_a=foot, point_b=0.5 * foot, length=1.0, name=f"rod {k}"))
    assert scene.assemble().residual < ALGEBRA
    assert np.abs(scene.evaluate().Phi).max() < NEAR
