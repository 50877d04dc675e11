"""URDF, MJCF and SDF files as scenes: bodies, joints, forces, frames, shapes, and what is left out."""

import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.pages import decoded
from tests.helpers.tolerances import ALGEBRA, CLOSE, ROUNDING

pytest.importorskip("lxml")
MODELS = Path(__file__).parent / "models"
BODY = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"

TRIANGLE = "solid a\nfacet\nouter loop\nvertex 0 0 0\nvertex 1000 0 0\nvertex 0 1000 0\nendloop\nendfacet\nendsolid\n"


def load(path, **options):
    with warnings.catch_warnings(action="ignore", category=ts.ImportLosses):
        return ts.load(path, **options)


def text(folder, content, name="robot.urdf"):
    path = folder / name
    path.write_text(content)
    return path


def mujoco():
    return pytest.importorskip("mujoco")


def left_out(scene):
    return {what: [entry.where for entry in entries] for what, entries in scene.imported.groups().items()}


def test_a_joint_with_armature_has_the_name_of_its_body(tmp_path):
    """A rod of 2 kg, level: m g l / (J + m l^2 + armature)."""
    rod = "<inertial pos='0.5 0 0' mass='2' diaginertia='0.1 0.1 0.1'/>"
    hinge = "<body name='arm'><joint name='arm' axis='0 1 0' armature='0.4'/>" + rod + "</body>"
    scene = load(text(tmp_path, f"<mujoco><worldbody>{hinge}</worldbody></mujoco>", "arm.xml"))
    solution = ts.simulate(scene, (0, 0.1))
    np.testing.assert_allclose(solution.angular_acceleration(scene.bodies[0])[0, 1], 9.81, rtol=ALGEBRA)


def test_urdf():
    with pytest.warns(ts.ImportLosses, match="limits of a joint"):
        scene = ts.load(MODELS / "arm.urdf")
    assert [body.name for body in scene.bodies] == ["table", "cross", "arm", "ram"]
    assert [type(item).__name__ for item in scene.constraints[:4]] == [
        "Revolute",
        "Revolute",
        "Revolute",
        "Translational",
    ]
    assert scene["turn spring"].damping == 0.4
    assert scene.mobility().degrees_of_freedom == 4
    assert np.isclose(sum(body.mass for body in scene.bodies), 4.0 + 2.5 + 0.8 + 0.3, rtol=ROUNDING)
    assert scene.imported.format == "URDF"
    lost = left_out(scene)
    assert lost["limits of a joint"] == ["lift", "roll", "push"]
    assert lost["mesh that is not found"] == ["arm"]
    assert lost["friction of a joint"] == ["turn"]
    assert "element <transmission>" in lost
    assert "merged into ram" in str(scene.imported)
    assert "limits of a joint (3): lift [-1, 2]" in str(scene.imported)


def test_frames_of_merged_links():
    scene = load(MODELS / "arm.urdf")
    tool, camera = scene.imported.frames["tool"], scene.imported.frames["camera"]
    assert tool.body == camera.body == "ram"
    assert np.allclose(camera.position - tool.position, tool.rotation @ (0, 0.1, 0), atol=ROUNDING)


def test_free_base():
    scene = load(MODELS / "arm.urdf", free_base=True)
    assert scene.mobility().degrees_of_freedom == 10
    with pytest.raises(ts.InvalidArgument, match="free_base is for URDF"):
        ts.load(MODELS / "four_bar.sdf", free_base=True)


def test_joint_angles_have_the_signs_of_the_file():
    scene = load(MODELS / "arm.urdf")
    scene.set("turn", rate=2.0)
    solution = ts.simulate(scene, (0.0, 1e-3))
    assert solution.angle("turn")[-1] > 0.0


def test_shapes():
    scene = load(MODELS / "arm.urdf")
    found = scene.shapes
    assert [type(shape).__name__ for shape in found["ground"]] == ["Box"]
    cylinder = found["table"][0]
    assert (cylinder.radius, cylinder.length, cylinder.colour) == (0.1, 0.2, "#3366cc")
    centroid = -scene.imported.frames["table"].position
    assert np.allclose(cylinder.position, (0, 0, 0.1) - centroid, atol=ROUNDING)
    assert ts.Scene().shapes == {}


def test_shapes_of_sdf_without_numbers_and_without_extent(tmp_path):
    shapes = ("<capsule/>", "<sphere/>", "<box><size>1 0 1</size></box>", "<ellipsoid/>")
    visuals = "".join(f"<visual name='v{i}'><geometry>{shape}</geometry></visual>" for i, shape in enumerate(shapes))
    ends = "<parent>world</parent><child>a</child>"
    hinge = f"<joint name='j' type='revolute'>{ends}<axis><xyz>0 1 0</xyz></axis></joint>"
    content = f"<link name='a'><inertial><mass>1</mass></inertial>{visuals}</link>{hinge}"
    scene = load(text(tmp_path, f"<sdf version='1.10'><model name='m'>{content}</model></sdf>", "m.sdf"))
    capsule, sphere = scene.shapes["a"]
    assert (capsule.radius, capsule.length, sphere.radius) == (0.5, 1.0, 1.0)  # the defaults of the specification
    assert left_out(scene) == {"shape without extent": ["a"], "shape <ellipsoid>": ["a"]}


def test_the_viewer_draws_them(tmp_path):
    scene = load(MODELS / "arm.urdf")
    page = ts.simulate(scene, (0.0, 0.01)).view(tmp_path / "arm.html")
    assert "#3366cc" in page.read_text()


LINK = """<link name="{}"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
<inertia ixx=".2" iyy=".2" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>{}</link>"""
CROSS = f"""<robot name="arm"><link name="base"/><link name="cross"/>{LINK.format("lower", "")}
{LINK.format("upper", '<visual><geometry><capsule radius="0.05" length="0.9"/></geometry></visual>')}
<joint name="hip" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
<joint name="roll" type="continuous"><parent link="upper"/><child link="cross"/><origin xyz="0 0 -1"/></joint>
<joint name="pitch" type="continuous"><parent link="cross"/><child link="lower"/><axis xyz="0 1 0"/></joint></robot>"""


def test_helping_links_are_not_drawn(tmp_path):
    """The cross of a universal joint has neither mass nor shape; a link with mass is drawn without a shape, too."""
    scene = load(text(tmp_path, CROSS))
    assert scene.shapes["cross"] == []
    assert [type(shape).__name__ for shape in scene.shapes["upper"]] == ["Capsule"]
    page = decoded(ts.simulate(scene, (0.0, 0.1)).view(tmp_path / "arm.html").read_text())
    names = [body["name"] for body in page.bodies]
    parts = [(names[part["body"]], part["kind"]) for part in page.parts if part["layer"] == "bodies"]
    assert [part for part in parts if part[0] == "upper"] == [
        ("upper", kind) for kind in ("cylinder", "sphere", "sphere")
    ]
    assert {name for name, _ in parts} == {"upper", "lower"}
    assert {label["text"] for label in page.labels} == {"upper", "lower", "hip", "roll", "pitch"}
    assert {names[trail["body"]] for trail in page.trails} == {"upper", "lower"}
    pins = [np.linalg.norm(np.reshape(part["matrix"], (4, 3))[:1]) for part in page.parts if part["layer"] == "joints"]
    np.testing.assert_allclose(pins, 0.04, rtol=0.05)  # of links of half a metre, not of the cross


def test_meshes_are_found(tmp_path):
    (tmp_path / "arm" / "meshes").mkdir(parents=True)
    (tmp_path / "arm" / "meshes" / "arm.stl").write_text(TRIANGLE)
    (tmp_path / "arm" / "urdf").mkdir()
    path = text(tmp_path / "arm" / "urdf", (MODELS / "arm.urdf").read_text())
    (said,) = [what for what in left_out(load(path)) if "mesh" in what]
    assert said == "mesh that is outside the folder of the file; ts.load(path, outside=True) reads it"
    scene = load(path, outside=True)
    assert not [what for what in left_out(scene) if "mesh" in what]
    assert np.isclose(scene.shapes["arm"][0].vertices.max(), 1.0)


def test_a_scene_goes_to_toml_and_back(tmp_path):
    scene = load(MODELS / "arm.urdf")
    again = ts.load(scene.save(tmp_path / "arm.toml"))
    assert (again.evaluate().qdd == scene.evaluate().qdd).all()


def test_copies_keep_the_report():
    scene = load(MODELS / "arm.urdf")
    for twin in (scene.copy(), pickle.loads(pickle.dumps(scene)), scene.with_parameters({"table.mass": 5.0})):
        assert str(twin.imported) == str(scene.imported)
        assert twin.shapes.keys() == scene.shapes.keys()


def test_mimicking_joints_are_coupled(tmp_path):
    links = "".join(f"<link name='{name}'>{BODY}</link>" for name in ("base", "one", "two", "three"))
    joint = (
        "<joint name='{0}' type='revolute'><parent link='base'/><child link='{0}'/><origin xyz='{1} 0 0'/>"
        "<axis xyz='{2}'/>{3}</joint>"
    )
    mimic = "<mimic joint='one' multiplier='-2' offset='0.3'/>"
    joints = joint.format("one", 0, "0 0 1", "") + joint.format("two", 1, "0 0 -1", mimic)
    joints += joint.format("three", 2, "0 1 0", mimic)
    scene = load(text(tmp_path, f"<robot name='r'>{links}{joints}</robot>"))
    assert left_out(scene) == {}
    scene.body("one").angular_velocity = (0, 0, 1)
    scene.assemble(fixed=["one"])
    state = ts.simulate(scene, (0.0, 0.5)).state
    assert np.isclose(state.angle("two"), 0.3 - 2.0 * state.angle("one"), rtol=CLOSE)
    assert np.isclose(state.angle("three"), 0.3 - 2.0 * state.angle("one"), rtol=CLOSE)


LINK = "<link name='{0}'>" + BODY + "</link>"
ON_BASE = (
    "<joint name='{0} hinge' type='{1}'><parent link='base'/><child link='{0}'/><origin xyz='{2} 0 0'/>"
    "<axis xyz='0 0 {3}'/>{4}</joint>"
)


def test_offsets_of_mimicking_joints(tmp_path):
    """A chain of them, one beyond half a turn, with axes that are opposed; what hangs from them starts there, too."""
    content = "<link name='base'/>" + "".join(map(LINK.format, ("a", "b", "c", "slide", "tip")))
    content += ON_BASE.format("a", "continuous", 0, 1, "")
    content += ON_BASE.format("c", "continuous", 2, -1, "<mimic joint='b hinge' multiplier='0.5' offset='-1'/>")
    content += ON_BASE.format("b", "continuous", 1, 1, "<mimic joint='a hinge' multiplier='-1' offset='4'/>")
    content += ON_BASE.format("slide", "prismatic", 3, 1, "<mimic joint='a hinge' multiplier='2' offset='0.2'/>")
    content += "<joint name='j' type='fixed'><parent link='b'/><child link='tip'/><origin xyz='1 0 0'/></joint>"
    scene = load(text(tmp_path, f"<robot name='r'>{content}</robot>"))
    assert left_out(scene) == {}
    assert scene.imported.frames["tip"].body == "b"
    assert np.isclose(scene.body("b").position[0], 1 + 0.5 * np.cos(4.0), rtol=ROUNDING)
    scene = ts.load(scene.save(tmp_path / "r.toml"))
    scene.gravity = (0, 0, 0)
    scene.set("a hinge", rate=1.0)
    solution = ts.simulate(scene, (0.0, 2.0), t_eval=[0.0, 1.0, 2.0])
    one = solution.angle("a hinge")
    assert np.allclose(one, [0.0, 1.0, 2.0], atol=CLOSE)
    assert np.abs(solution.angle("b hinge") - (4.0 - one)).max() < CLOSE
    assert np.abs(solution.angle("c hinge") - (0.5 * (4.0 - one) - 1.0)).max() < CLOSE
    assert np.abs(solution.displacement("slide hinge") - (0.2 + 2.0 * one)).max() < CLOSE


PAIRS = {  # kind of the joints, their axes, parent of the second
    "jaws": ("prismatic", "0 1 0", "0 -1 0", "base"),
    "crossed hinges": ("revolute", "0 0 1", "1 0 0", "base"),
    "finger": ("revolute", "0 0 1", "0 0 1", "l1"),
    "hinge and slide": ("revolute", "0 0 1", "0 0 1", "base"),
}


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_mimics_on_any_bodies(pair, tmp_path):
    kind, one, two, parent = pair
    joint = (
        "<joint name='{0}' type='{1}'><parent link='{2}'/><child link='{3}'/><origin xyz='0 {4} 0'/>"
        "<axis xyz='{5}'/>{6}</joint>"
    )
    content = "<link name='base'/>" + LINK.format("l1") + LINK.format("l2")
    content += joint.format("j1", kind, "base", "l1", 0.1, one, "")
    content += joint.format("j2", kind, parent, "l2", -0.1, two, "<mimic joint='j1' multiplier='0.5'/>")
    scene = load(text(tmp_path, f"<robot name='g'>{content}</robot>"))
    assert left_out(scene) == {}
    scene.set("j1", rate=2.0)
    solution = ts.simulate(scene, (0.0, 1.0))
    q1, q2 = (getattr(solution, "displacement" if kind == "prismatic" else "angle")(name) for name in ("j1", "j2"))
    assert abs(q1[-1]) > 0.1
    assert np.abs(q2 - 0.5 * q1).max() < CLOSE


TWO_SLIDES = """<mujoco><worldbody>
<body><joint name="a" type="slide" axis="0 1 0"/><geom size=".1"/></body>
<body pos="1 0 0"><joint name="b" type="slide" axis="0 1 0"/><geom size=".1"/></body>
<body pos="2 0 0"><joint name="c" type="hinge" axis="0 1 0"/><geom size=".1"/></body>
</worldbody>
<tendon><fixed name="t"><joint joint="a" coef="2"/><joint joint="b" coef="-1"/></fixed>
<fixed name="u"><joint joint="c" coef="0.5"/></fixed>
<fixed name="v"><joint joint="b" coef="-2"/></fixed><fixed name="w"><joint joint="a" coef="3"/></fixed></tendon>
<equality>{0}</equality></mujoco>"""
EQUALITIES = {
    "polynomial": ('<joint joint1="b" joint2="a" polycoef="0 1 0.5 0 -0.1"/>', lambda a: a + 0.5 * a**2 - 0.1 * a**4),
    "ratio": ('<joint joint1="b" joint2="a" polycoef="0 -3 0 0 0"/>', lambda a: -3.0 * a),
    "tendon": ('<tendon tendon1="t"/>', lambda a: 2.0 * a),
    "joint of another kind": ('<joint joint1="c" joint2="b"/><tendon tendon1="t"/>', lambda a: 2.0 * a),
    "two tendons": ('<tendon tendon1="t" tendon2="u" polycoef="0 4 0 0 0"/><joint joint1="c" joint2="b"/>',
                    lambda a: 2.0 * a / 3.0),
    "polynomial of a tendon": ('<tendon tendon1="v" tendon2="w" polycoef="0 1 0.25 0 0"/>',
                               lambda a: -0.5 * (3.0 * a + 0.25 * 9.0 * a**2)),
}  # fmt: skip


@pytest.mark.parametrize(("equality", "law"), EQUALITIES.values(), ids=EQUALITIES)
def test_equalities_of_mjcf(equality, law, tmp_path):
    """Of joints with their polynomial, and of fixed tendons, 2 a - b = 4 c / 2."""
    pytest.importorskip("mujoco")
    scene = load(text(tmp_path, TWO_SLIDES.format(equality), "r.xml"))
    assert not {what for what in left_out(scene) if "equality" in what or "mimic" in what or "polynomial" in what}
    scene.set("a", rate=1.0)
    solution = ts.simulate(scene, (0.0, 1.0))
    a, b = solution.displacement("a"), solution.displacement("b")
    assert abs(a[-1]) > 0.05
    assert np.abs(b - law(a)).max() < CLOSE


HELD = {
    "slide": ('<joint joint1="b" polycoef="0.2"/>', "displacement", "b", 0.2),
    "hinge": ('<joint joint1="c" polycoef="-0.4"/>', "angle", "c", -0.4),
    "tendon": ('<tendon tendon1="u" polycoef="0.1 0 0 0 0"/>', "angle", "c", 0.2),  # c / 2 = 0.1
    "tendon at its start": ('<tendon tendon1="v"/>', "position", "body2", 0.0),
}


@pytest.mark.parametrize(("equality", "asked", "name", "value"), HELD.values(), ids=HELD)
def test_joints_that_mjcf_holds(equality, asked, name, value, tmp_path):
    pytest.importorskip("mujoco")
    scene = load(text(tmp_path, TWO_SLIDES.format(equality), "r.xml"))
    assert not {what for what in left_out(scene) if "equality" in what or "mimic" in what or "held" in what}
    scene.assemble()
    assert scene.mobility().degrees_of_freedom == 2
    if asked == "position":  # one body with the ground: there is no joint
        assert name not in {body.name for body in scene.bodies}
    else:
        np.testing.assert_allclose(getattr(ts.simulate(scene, (0.0, 1.0)), asked)(name), value, atol=CLOSE)


def test_mimics_of_sdf(tmp_path):
    """q = multiplier (q' - reference) + offset, of hinges, slides and the axes of a universal joint."""
    inertial = "<inertial><mass>1</mass></inertial>"
    links = "".join(f"<link name='{name}'>{inertial}</link>" for name in "abc")
    joint = "<joint name='{0}' type='{1}'><parent>world</parent><child>{2}</child>{3}</joint>"
    axis = "<{0}><xyz>{1}</xyz>{2}</{0}>"
    mimic = "<mimic joint='{0}' axis='{1}'><multiplier>{2}</multiplier><offset>{3}</offset>"
    mimic += "<reference>{4}</reference></mimic>"
    joints = joint.format("one", "revolute", "a", axis.format("axis", "0 0 1", ""))
    slide = mimic.format("one", "axis", 0.5, 0.1, 0.2)
    joints += joint.format("two", "prismatic", "b", axis.format("axis", "1 0 0", slide))
    arm = axis.format("axis2", "0 1 0", mimic.format("one", "axis", 2, 0, 0))
    joints += joint.format("three", "universal", "c", axis.format("axis", "1 0 0", "") + arm)
    scene = load(text(tmp_path, f"<sdf version='1.11'><model name='m'>{links}{joints}</model></sdf>", "m.sdf"))
    assert left_out(scene) == {}
    scene.body("a").angular_velocity = (0, 0, 1)
    scene.assemble(fixed=["a"])
    solution = ts.simulate(scene, (0.0, 0.5))
    assert abs(solution.angle("one")[-1]) > 0.05
    assert np.abs(solution.displacement("two") - 0.5 * (solution.angle("one") - 0.2) - 0.1).max() < CLOSE
    assert np.abs(solution.angle("three")[:, 1] - 2.0 * solution.angle("one")).max() < CLOSE


@pytest.mark.parametrize(
    ("one", "other", "reason"), [("b", "a", "in a circle"), ("b", "gone", "no other joint 'gone'")]
)
def test_mimics_that_lead_nowhere_are_listed(one, other, reason, tmp_path):
    content = "<link name='base'/>" + "".join(map(LINK.format, "ab"))
    for x, (name, driver) in enumerate((("a", one), ("b", other))):
        content += ON_BASE.format(name, "continuous", x, 1, f"<mimic joint='{driver} hinge' offset='1'/>")
    assert reason.replace("gone", "gone hinge") in str(
        load(text(tmp_path, f"<robot name='r'>{content}</robot>")).imported
    )


def test_a_default_namespace_is_left_out(tmp_path):
    content = (MODELS / "arm.urdf").read_text().replace("<robot ", '<robot xmlns="http://a.b" xmlns:x="http://c.d" ')
    content = content.replace("</robot>", "<x:property name='y'/></robot>")
    scene, plain = load(text(tmp_path, content)), load(MODELS / "arm.urdf")
    assert (scene.evaluate().qdd == plain.evaluate().qdd).all()
    assert {"element <{http://c.d}property>"} == set(left_out(scene)) - set(left_out(plain))


def test_links_without_mass_at_the_end_are_held(tmp_path):
    joint = "<joint name='{0}' type='continuous'><parent link='{1}'/><child link='{2}'/></joint>"
    content = f"<link name='base'/><link name='arm'>{BODY}</link><link name='tip'/><link name='nail'/>"
    content += joint.format("a", "base", "arm") + joint.format("b", "arm", "tip") + joint.format("c", "tip", "nail")
    scene = load(text(tmp_path, f"<robot name='r'>{content}</robot>"))
    assert [body.name for body in scene.bodies] == ["arm"]
    assert sorted(left_out(scene)["joint of a link without mass, held"]) == ["b", "c"]
    assert scene.imported.frames["nail"].body == "arm"


def test_inertia_of_no_solid_is_carried_over(tmp_path):
    body = BODY.replace("izz='1'", "izz='5'")
    scene = load(text(tmp_path, f"<robot name='r'><link name='arm'>{body}</link></robot>"), free_base=True)
    assert scene.body("arm").inertia.diagonal().tolist() == [1, 1, 5]
    assert "the largest exceeds the sum" in str(scene.imported)


def test_mjcf():
    mujoco()
    scene = load(MODELS / "leg.xml")
    assert [body.name for body in scene.bodies] == ["ball", "trunk", "thigh/hip_x", "thigh", "body4", "rod"]
    assert scene.gravity.tolist() == [0, 0, -9.5]
    assert type(scene["rooty"]).__name__ == "Planar"
    assert np.isclose(scene["hip_y spring"].free_angle, np.deg2rad(20 - 15), rtol=ROUNDING)
    assert (scene["servo"].stiffness, scene["servo"].damping) == (30.0, 0.5)
    assert (scene["cord"].stiffness, scene["cord"].free_length) == (40.0, 0.3)
    lost = left_out(scene)
    assert [scene[f"{name} armature"].inertia for name in ("hip_x", "hip_y")] == [0.02, 0.02]
    assert lost["motor"] == ["drive"]
    assert lost["equality that is not active"] == ["loop"]
    assert len(lost["contact shape"]) == 6
    assert [type(shape).__name__ for shape in scene.shapes["ball"]] == ["Sphere"]


def test_the_kind_of_an_xml_is_told_by_its_root(tmp_path):
    mujoco()
    kinds = [load(text(tmp_path, (MODELS / name).read_text(), "file.xml")).imported.format
             for name in ("arm.urdf", "four_bar.sdf")]  # fmt: skip
    assert kinds == ["URDF", "SDF"]
    assert load(MODELS / "leg.xml").imported.format == "MJCF"


def test_loops_of_mjcf(tmp_path):
    mujoco()
    content = (
        (MODELS / "leg.xml").read_text().replace('active="false"', "").replace("ball.xml", str(MODELS / "ball.xml"))
    )
    scene = load(text(tmp_path, content, "leg.xml"), outside=True)
    assert type(scene["loop"]).__name__ == "Spherical"
    assert "are closed by assembly" in str(scene.imported)
    assert np.abs(scene.evaluate().Phi).max() < CLOSE


def test_sdf():
    scene = load(MODELS / "four_bar.sdf")
    assert scene.mobility().degrees_of_freedom == 1
    assert left_out(scene) == {
        "contact shape": ["coupler"], "friction of a joint": ["motor"], "limits of a joint": ["bearing"],
        "element <plugin>": ["line 30"],
    }  # fmt: skip
    twin = four_bar_by_hand()
    assert np.abs(scene.evaluate().qdd - twin.evaluate().qdd).max() < ALGEBRA


def four_bar_by_hand():
    """The mechanism of four_bar.sdf."""
    scene, C = ts.Scene(), ts.constraints

    def about_y(angle):
        return np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0])

    def link(origin, angle, name, mass, inertia, centroid):
        c, s = np.cos(angle), np.sin(angle)
        A = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        body = scene.add_body(mass, inertia, origin + A @ centroid, about_y(angle), name=name)
        return body, A

    crank, A = link(np.zeros(3), np.deg2rad(-30), "crank", 1.2, (0.003, 0.02, 0.02), np.array([0.2, 0, 0]))
    pin = A @ (0.4, 0, 0)
    turned = np.array([[1, 0, 0], [0, np.cos(0.1), -np.sin(0.1)], [0, np.sin(0.1), np.cos(0.1)]])
    J = turned @ np.array([[0.01, 0, 0.004], [0, 0.2, 0], [0.004, 0, 0.2]]) @ turned.T
    coupler, _ = link(pin, np.deg2rad(-30) + 0.4, "coupler", 2.0, J, np.array([0.6, 0.01, 0]))
    rocker, A = link(np.array([1.5, 0, 0]), -1.3, "rocker", 1.5, (0.004, 0.08, 0.08), np.array([0.4, 0, 0]))
    hinge = np.array([1.5, 0, 0]) + A @ (0.8, 0, 0)
    scene.add(C.Revolute.at("ground", crank, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(C.Spherical.at(crank, coupler, point=pin))
    scene.add(C.Revolute.at("ground", rocker, point=(1.5, 0, 0), axis=(0, 1, 0)))
    scene.add(C.Revolute.at(coupler, rocker, point=hinge, axis=(0, 1, 0)))
    spring = {"stiffness": 2.0, "free_angle": 0.1}
    scene.add(ts.forces.TorsionalSpring.at(coupler, rocker, axis=(0, 1, 0), **spring))
    return scene


def test_screws_and_universal_joints_of_sdf(tmp_path):
    link = "<link name='{0}'><inertial><mass>1</mass></inertial></link>"
    joint = "<joint name='{0}' type='{1}'><parent>{2}</parent><child>{3}</child><axis><xyz>{4}</xyz></axis>{5}</joint>"
    axis2, pitch = "<axis2><xyz>{}</xyz></axis2>", "<screw_thread_pitch>0.02</screw_thread_pitch>"
    screw = joint.format("s", "screw", "world", "a", "0 0 1", pitch)
    cross = joint.format("u", "universal", "a", "b", "1 0 0", axis2.format("0 1 0"))
    bent = joint.format("v", "revolute2", "a", "c", "1 0 0", axis2.format("1 1 0"))
    content = "".join(link.format(name) for name in "abc") + screw + cross + bent
    scene = load(text(tmp_path, f"<sdf version='1.10'><model name='m'>{content}</model></sdf>", "m.sdf"))
    assert np.isclose(scene["s"].lead, 0.02 / (2 * np.pi))
    assert scene.mobility().degrees_of_freedom == 1 + 2 + 2


HINGED = "<mujoco>{0}<worldbody>{1}<body name='b'><joint {2}/><geom size='.1' pos='1 0 0'/></body></worldbody></mujoco>"


def test_lights_with_textures_are_left_out(tmp_path):
    mujoco()
    assets = "<asset><texture name='t' type='2d' builtin='checker' width='8' height='8'/></asset>"
    content = HINGED.format(assets, "<light name='sun' type='image' texture='t'/>", "axis='0 1 0'")
    scene = load(text(tmp_path, content, "m.xml"))
    assert {"light": ["sun"], "texture": ["t"]}.items() <= left_out(scene).items()
    assert np.isclose(scene.evaluate().qdd[2], -9.81 / (1.0 + 0.4 * 0.1**2), rtol=CLOSE)  # of a ball on a rod


def test_names_that_others_have_by_default(tmp_path):
    """Of a kind: the one without a name gets another; of several kinds, the later one."""
    mujoco()
    content = HINGED.format("<asset/>", "", "axis='0 1 0'").replace(
        "</body>",
        "<body><joint name='joint0'/><geom size='.1'/></body><body name='body2'><joint name='eq'/><joint axis='1 0 0'/>"
        "<geom size='.1'/></body><body name='body2/eq'><joint name='c'/><geom size='.1'/></body></body>",
    )
    content = content.replace("</mujoco>", "<equality><joint name='eq' joint1='eq' joint2='c'/></equality></mujoco>")
    scene = load(text(tmp_path, content, "m.xml"))
    assert [body.name for body in scene.bodies] == ["b", "body2 2", "body2/eq 2", "body2", "body2/eq"]
    hinges = [item for item in scene.constraints if isinstance(item, ts.constraints.Revolute)]
    assert [(one.name, one.b.name) for one in hinges] == [
        ("joint0 2", "b"), ("joint0", "body2 2"), ("eq", "body2/eq 2"), ("joint3", "body2"), ("c", "body2/eq"),
    ]  # fmt: skip


def test_whatever_mjcf_has_and_nobody_reads_is_listed(tmp_path):
    mujoco()
    (tmp_path / "part.xml").write_text("<mujocoinclude>\n<option wind='1 0 0' timestep='.01'/></mujocoinclude>")
    drive = "<actuator><general name='a' joint='j' dyntype='filter' dynprm='1' gainprm='2'/></actuator>"
    content = HINGED.format("<include file='part.xml'/><visual/>" + drive, "", "name='j' user='3' margin='1'")
    scene = load(text(tmp_path, content, "m.xml"))
    lost = left_out(scene)
    del lost["contact shape"], lost["motor"]
    assert lost == {
        "attribute <option wind>": ["part.xml, line 2"], "element <visual>": ["line 1"],
        "attribute <general dyntype>": ["line 1"], "attribute <general dynprm>": ["line 1"],
        "attribute <joint user>": ["line 1"], "attribute <joint margin>": ["line 1"],
    }  # fmt: skip
    assert "timestep" in str(scene.imported)


def test_whatever_urdf_and_sdf_have_and_nobody_reads_is_listed(tmp_path):
    finish = "<material name='m'><texture filename='t.png'/></material>"
    shape = f"<visual><geometry><box size='1 1 1'/></geometry>{finish}</visual>"
    content = f"<link name='base'/><link name='a' mode='x'>{BODY}{shape}</link>"
    content += ON_BASE.format("a", "continuous", 0, 1, "")
    scene = load(text(tmp_path, f"<robot name='r'>{content}</robot>"))
    assert left_out(scene) == {"element <texture>": ["line 1"], "attribute <link mode>": ["line 1"]}
    finish = "<material><specular>1 1 1 1</specular></material>"
    shape = f"<visual name='v'><geometry><box><size>1 1 1</size></box></geometry>{finish}</visual>"
    inertial = "<inertial auto='true'><mass>1</mass><density>3</density></inertial>"
    ends = "<parent>world</parent><child>a</child>"
    hinge = f"<joint name='j' type='revolute'>{ends}<axis><xyz>0 1 0</xyz><mimic joint='k'/></axis></joint>"
    content = f"<link name='a'>{inertial}{shape}<gravity>false</gravity></link>{hinge}"
    scene = load(text(tmp_path, f"<sdf version='1.10'><model name='m'>{content}</model></sdf>", "m.sdf"))
    assert left_out(scene) == {
        "inertia of the densities of contact shapes": ["a"],
        "joint that mimics another one": ["j mimics k"],
        **{f"element <{tag}>": ["line 1"] for tag in ("density", "specular", "gravity")},
    }
