"""Loops of imported files: `loops=` of `ts.load`, <loop_joint>, Drake's ball constraints; limits as hints."""

import warnings

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import ALGEBRA, HELD

pytest.importorskip("lxml")
LINKS = {"crank": 0.3, "coupler": 0.9, "rocker": 0.7}  # m
BASE = 0.8  # m
INERTIAL = """<inertial><origin xyz="{0} 0 0"/><mass value="1"/>
  <inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>"""


def urdf(extra="", limit="", space="", axis="0 0 1", base=BASE):
    """A four-bar as a tree, all links along x: crank and coupler, and the rocker on its own."""
    links = "".join(f'<link name="{name}">{INERTIAL.format(length / 2)}</link>' for name, length in LINKS.items())
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{a}"/><child link="{b}"/><origin xyz="{x} 0 0"/>'
        f'<axis xyz="{axis}"/>{limit if b == "rocker" else ""}</joint>'
        for name, a, b, x in (
            ("bearing", "base", "crank", 0.0),
            ("pin", "crank", "coupler", LINKS["crank"]),
            ("far", "base", "rocker", base),
        )
    )
    ends = "".join(
        f'<link name="{name} end"/><joint name="{name} tip" type="fixed"><parent link="{name}"/>'
        f'<child link="{name} end"/><origin xyz="{LINKS[name]} 0 0"/></joint>'
        for name in ("coupler", "rocker")
    )
    return f'<robot name="four-bar" {space}><link name="base"/>{links}{joints}{ends}{extra}</robot>'


LOOP_JOINT = """<{0}loop_joint name="closing" {1}><link1 link="coupler" xyz="0.9 0 0" rpy="0 0 0"/>
  <{2} link="rocker" xyz="0.7 0 0" rpy="0 0 0"/><axis xyz="0 0 1"/></{0}loop_joint>"""
BALL = """<drake:ball_constraint>
  <drake:ball_constraint_body_A name="coupler"/><drake:ball_constraint_body_B name="rocker"/>
  <drake:ball_constraint_p_AP value="0.9 0 0"/><drake:ball_constraint_p_BQ value="0.7 0 0"/></drake:ball_constraint>"""
DRAKE = 'xmlns:drake="http://drake.mit.edu"'
ENDS = "coupler end", "rocker end"
WAYS = {  # text of the file, loops of the call, the constraint that is made
    "hinge": (urdf(), [(*ENDS, "hinge")], "Revolute"),
    "hinge about y": (urdf(axis="0 1 0"), [(*ENDS, "hinge", (0, 1, 0))], "Revolute"),
    "ball": (urdf(), [(*ENDS, "ball")], "Spherical"),
    "loop_joint": (urdf(LOOP_JOINT.format("", 'type="continuous"', "link2")), (), "Revolute"),
    "loop_joint without a type": (urdf(LOOP_JOINT.format("drake:", "", "link2"), space=DRAKE), (), "Revolute"),
    "loop_joint with two link1": (urdf(LOOP_JOINT.format("", 'type="spherical"', "link1")), (), "Spherical"),
    "ball_constraint": (urdf(BALL, space=DRAKE), (), "Spherical"),
}


def load(folder, text, name="robot.urdf", **options):
    path = folder / name
    path.write_text(text)
    with warnings.catch_warnings(action="ignore", category=ts.ImportLosses):
        return ts.load(path, **options)


def pin_of_the_rocker(scene):
    """Where coupler and rocker meet, by both, ground frame."""
    found = []
    for name in ENDS:
        body, position, _ = scene.imported.frames[name]
        body = scene[body]
        found.append(body.position + ts.simulate(scene, (0.0, 1e-9)).rotation(body)[0] @ position)
    return found


@pytest.mark.parametrize("way", WAYS)
def test_a_four_bar_closes(tmp_path, way):
    """Both ends meet, each as far from its own pivot as its link is long."""
    text, loops, kind = WAYS[way]
    scene = load(tmp_path, text, loops=loops)
    closing = [item for item in scene.constraints if type(item).__name__ == kind][-1]
    assert closing.name in ("closing", "coupler end to rocker end", "ball coupler-rocker")
    one, other = pin_of_the_rocker(scene)
    np.testing.assert_allclose(one, other, atol=HELD)
    assert np.linalg.norm(one - (BASE, 0, 0)) == pytest.approx(LINKS["rocker"], abs=HELD)
    crank_pin = one * 0.0 + scene["crank"].position * 2.0
    assert np.linalg.norm(one - crank_pin) == pytest.approx(LINKS["coupler"], abs=HELD)
    assert "closed by assembly" in str(scene.imported)
    assert scene.mobility().degrees_of_freedom == 1


def test_a_weld_holds_both_frames(tmp_path):
    """Coupler and rocker lie on each other then, and stand still: a triangle of 0.3 m, 0.2 m and 0.4 m."""
    scene = load(tmp_path, urdf(base=0.4), loops=[(*ENDS, "weld")])
    frames = [scene.imported.frames[name] for name in ENDS]
    solution = ts.simulate(scene, (0.0, 1e-9))
    turns = [solution.rotation(scene[frame.body])[0] @ frame.rotation for frame in frames]
    np.testing.assert_allclose(turns[0], turns[1], atol=ALGEBRA)
    assert scene.mobility().degrees_of_freedom == 0


def test_a_weld_that_holds_upside_down_is_turned_round(tmp_path):
    """Rows of a weld also hold where its frames are half a turn apart, as they are at zero here."""
    flag = f'<link name="flag">{INERTIAL.format(0.1)}</link><joint name="hinge" type="continuous"><parent link="base"/>'
    mark = '<link name="mark"/><joint name="to mark" type="fixed"><parent link="base"/><child link="mark"/>'
    text = f"""<robot name="flag"><link name="base"/>{flag}<child link="flag"/><axis xyz="0 0 1"/></joint>
      {mark}<origin rpy="0 0 3.141592653589793"/></joint></robot>"""
    scene = load(tmp_path, text, loops=[("flag", "mark", "weld")])
    np.testing.assert_allclose(scene["flag"].position, (-0.1, 0.0, 0.0), atol=HELD)


def test_a_loop_that_cannot_close_is_left_open_and_noted(tmp_path):
    """A triangle of 0.3 m, 0.2 m and 0.8 m."""
    (tmp_path / "triangle.urdf").write_text(urdf())
    with pytest.warns(ts.ImportLosses, match=r"open by up to 0\.\d+, and can't be closed") as caught:
        scene = ts.load(tmp_path / "triangle.urdf", loops=[(*ENDS, "weld")])
    assert caught[0].filename == __file__
    assert "can't be closed: not assembled from" in str(scene.imported)
    assert np.abs(scene.evaluate().Phi).max() > 0.1


@pytest.mark.parametrize(("lower", "upper"), [(0.5, 2.5), (-2.5, -0.5)])
def test_limits_say_on_which_side(tmp_path, lower, upper):
    """At zero the rocker is outside its limits: the loop closes within them, above or below the base."""
    limit = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'
    scene = load(tmp_path, urdf(limit=limit), loops=[(*ENDS, "hinge")])
    assert scene.imported.limits == {"far": (lower, upper)}
    assert lower <= ts.simulate(scene, (0.0, 1e-9)).angle("far")[0] <= upper


def test_sdf(tmp_path):
    links = "".join(
        f"<link name='{name}'><pose>{x} 0 0 0 0 0</pose><inertial><pose>{length / 2} 0 0 0 0 0</pose><mass>1</mass>"
        "</inertial></link>"
        for (name, length), x in zip(LINKS.items(), (0.0, LINKS["crank"], BASE), strict=True)
    )
    joints = "".join(
        f"<joint name='{b} joint' type='revolute'><parent>{a}</parent><child>{b}</child>"
        "<axis><xyz>0 0 1</xyz></axis></joint>"
        for a, b in (("world", "crank"), ("crank", "coupler"), ("world", "rocker"))
    )
    ball = BALL.replace(' name="', ">").replace(' value="', ">")
    for tag in ("body_A", "body_B", "p_AP", "p_BQ"):
        start, _, rest = ball.partition(f"<drake:ball_constraint_{tag}>")
        value, _, rest = rest.partition('"/>')
        ball = f"{start}<drake:ball_constraint_{tag}>{value}</drake:ball_constraint_{tag}>{rest}"
    text = f"<sdf version='1.7' {DRAKE}><model name='m'>{links}{joints}{ball}</model></sdf>"
    scene = load(tmp_path, text, "robot.sdf")
    assert scene["ball coupler-rocker"].rows == 3
    assert np.abs(scene.evaluate().Phi).max() < HELD
    again = load(tmp_path, text.replace(ball, ""), "robot.sdf", loops=[("coupler", "rocker", "ball")])
    assert "coupler to rocker" in [item.name for item in again.constraints]


@pytest.mark.parametrize(
    ("loops", "said"),
    [
        (
            [("coupler end", "rocker and", "ball")],
            r"no link, frame, site or joint 'rocker and'; did you mean rocker end",
        ),
        ([("coupler end", "rocker end", "glue")], r"weld, ball and hinge"),
        ([("coupler end", "rocker end")], r"weld, ball and hinge"),
        ([("coupler end", "rocker end", "ball", (0, 0, 1))], r"weld, ball and hinge"),
        ([("coupler end", "rocker end", "hinge", (0, 0, 0))], r"three numbers, not all zero"),
        ([("coupler end", "rocker end", "hinge", "z")], r"three numbers.*got 'z'\.$"),
        (("coupler end", "rocker end", "ball"), r"^loops: each is such as [^.]*, got 'coupler end'\.$"),
        ([("coupler", "coupler", "ball")], r"on the same link, coupler"),
        ("coupler", r"loops must be a sequence"),
        (5, r"loops must be a sequence"),
    ],
)
def test_wrong_loops_are_refused(tmp_path, loops, said):
    with pytest.raises(ts.InvalidArgument, match=said):
        load(tmp_path, urdf(), loops=loops)


def test_loops_are_for_files_of_robots(tmp_path):
    scene = ts.Scene()
    scene.add_point_mass(1.0)
    path = scene.save(tmp_path / "scene.toml")
    with pytest.raises(ts.InvalidArgument, match="URDF, MJCF and SDF"):
        ts.load(path, loops=[("a", "b", "ball")])


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        (LOOP_JOINT.format("", 'type="glue"', "link2"), "unknown type 'glue'"),
        (LOOP_JOINT.format("", "", "link3"), "needs <link1"),
        (LOOP_JOINT.format("", "", "link2").replace("rocker", "rockr"), "no link 'rockr'"),
        (BALL.replace("body_B", "body_C"), "lacks <drake:ball_constraint_body_B>"),
    ],
)
def test_mistakes_of_a_file_are_named_with_their_lines(tmp_path, extra, said):
    with pytest.raises(ts.InvalidFile, match=said):
        load(tmp_path, urdf(extra, space=DRAKE))


def test_a_weld_of_mjcf_sites(tmp_path):
    pytest.importorskip("mujoco")
    body = '<body name="{0}" pos="{1} 0 0"><joint axis="0 0 1"/><geom size=".05"/><site name="{0} end" pos="1 0 0"/>'
    text = f"<mujoco><worldbody>{body.format('one', 0)}</body>{body.format('two', 1.2)}</body></worldbody></mujoco>"
    scene = load(tmp_path, text, "robot.xml", loops=[("one end", "two end", "ball")])
    ends = [
        scene[name].position + ts.simulate(scene, (0, 1e-9)).rotation(name)[0] @ (1, 0, 0) for name in ("one", "two")
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=HELD)
    assert ends[0][0] == pytest.approx(0.6, abs=HELD)  # an isosceles triangle
