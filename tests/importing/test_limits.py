"""Limits of joints in files of robots as stops, of tendons as ropes."""

import numpy as np
import pytest

import tsdyn as ts

DOOR = """<robot name="door">
  <link name="frame"/>
  <link name="leaf"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
    <inertia ixx="0.2" iyy="0.2" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="frame"/><child link="leaf"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="0.25" effort="10" velocity="10"/></joint>
</robot>"""


@pytest.fixture
def door(tmp_path):
    file = tmp_path / "door.urdf"
    file.write_text(DOOR)
    return file


@pytest.mark.filterwarnings("ignore::tsdyn.ImportLosses")
def test_limits_become_stops(door):
    scene = ts.load(door, limits=True)
    scene.set("hinge", rate=2.0)
    solution = ts.simulate(scene, (0, 3.0))
    angle = solution.angle("hinge")
    assert solution.impulses[0][1] == "limits of hinge"
    assert angle.max() == pytest.approx(0.25, abs=1e-14)
    # stopped at 0.25 rad it keeps the energy of rest there, and swings to the other side by no more
    assert solution.energy[-1] == pytest.approx(-0.5 * 2.0 * 9.81 * np.cos(0.25), abs=1e-7)
    assert angle.min() > -0.25 - 1e-8
    assert "limits of a joint" not in str(scene.imported)


@pytest.mark.filterwarnings("ignore::tsdyn.ImportLosses")
def test_without_limits_they_are_listed(door):
    scene = ts.load(door)
    assert len(scene.constraints) == len(ts.load(door, limits=True).constraints) - 1
    assert "limits of a joint" in str(scene.imported)
    assert not np.any(ts.simulate(scene, (0, 0.1)).impulses)


RAIL = """<sdf version="1.7"><model name="press">
  <link name="ram"><inertial><mass>2</mass></inertial></link>
  <joint name="rail" type="prismatic"><parent>world</parent><child>ram</child>
    <axis><xyz>0 0 -1</xyz><limit>{}</limit></axis></joint>
</model></sdf>"""


@pytest.mark.filterwarnings("ignore::tsdyn.ImportLosses")
@pytest.mark.parametrize("drop", [0.5, 2000.0])
@pytest.mark.parametrize("lower", ["", "<lower>-1e16</lower>"])
def test_limits_of_one_side(tmp_path, drop, lower):
    """A ram of 2 kg falls onto its upper limit, and has no lower one."""
    file = tmp_path / "press.sdf"
    file.write_text(RAIL.format(f"{lower}<upper>{drop}</upper>"))
    assert ts.load(file).constraints[-1].name != "limits of rail"
    scene = ts.load(file, limits=True)
    assert (scene["limits of rail"].lower, scene["limits of rail"].upper) == (None, drop)
    fall = np.sqrt(2 * drop / 9.81)
    (t, _, impulse), *_ = ts.simulate(scene, (0, 1.1 * fall)).impulses
    assert t == pytest.approx(fall, rel=1e-14)
    assert impulse == pytest.approx(2 * 9.81 * fall, rel=1e-12)


CROSS = """<sdf version="1.7"><model name="swing">
  <link name="bob"><pose>0 0 -0.5 0 0 0</pose><inertial><mass>2</mass></inertial></link>
  <joint name="cross" type="universal"><parent>world</parent><child>bob</child><pose>0 0 0.5 0 0 0</pose>
    <axis><xyz>1 0 0</xyz><limit><lower>-0.3</lower></limit></axis>
    <axis2><xyz>{} 1 0</xyz><limit><lower>-0.2</lower><upper>0.1</upper></limit></axis2></joint>
</model></sdf>"""


@pytest.mark.parametrize(("lean", "joint"), [(0, "cross"), (0.5, "cross 2")])
def test_limits_of_both_axes(tmp_path, lean, joint):
    """Of a universal joint, and of two hinges where its axes are oblique."""
    file = tmp_path / "swing.sdf"
    file.write_text(CROSS.format(lean))
    scene = ts.load(file, limits=True)
    first, second = scene["limits of cross"], scene["limits of cross 2"]
    assert ((first.lower, first.upper), (second.lower, second.upper)) == ((-0.3, None), (-0.2, 0.1))
    spin = -np.array([lean, 1, 0]) / np.hypot(lean, 1)  # about the second axis, towards its lower bound
    for body in scene.bodies:  # of two oblique hinges one is the cross, without mass
        body.velocity, body.angular_velocity = np.cross(spin, body.position), spin * (body.name == "bob")
    (_, name, _), *_ = ts.simulate(scene, (0, 1)).impulses
    assert name == "limits of cross 2"
    assert joint in [each.name for each in scene.constraints]


@pytest.mark.filterwarnings("ignore::tsdyn.ImportLosses")
@pytest.mark.parametrize("lower", [0.5, 0.25])
def test_limits_that_cross(tmp_path, lower):
    """They are a mistake; equal ones, which exporters write for none, are listed."""
    file = tmp_path / "door.urdf"
    file.write_text(DOOR.replace('-0.5" upper', f'{lower}" upper'))
    assert "limits of a joint" in str(ts.load(file).imported)
    if lower > 0.25:
        with pytest.raises(ts.InvalidFile, match="limits of hinge: lower must be below upper"):
            ts.load(file, limits=True)
    else:
        assert "limits of a joint" in str(ts.load(file, limits=True).imported)


def test_limits_of_other_files(tmp_path):
    scene = ts.Scene()
    scene.add_point_mass(mass=1.0)
    file = scene.save(tmp_path / "stone.toml")
    with pytest.raises(ts.InvalidArgument, match="limits="):
        ts.load(file, limits=True)
    with pytest.raises(ts.TsdynError, match="limits must be True or False"):
        ts.load(file, limits=1)


TETHER = """<mujoco>
  <option gravity="0 0 -10"/>
  <worldbody>
    <site name="left"/> <site name="right" pos="1 0 0"/>
    <body name="load" pos="0.5 0 -0.2"><freejoint/><geom size="0.1" mass="2"/><site name="eye"/></body>
  </worldbody>
  <tendon>
    <spatial name="leash" limited="true" range="0 2"><site site="left"/><site site="eye"/><site site="right"/></spatial>
    <spatial name="strut" limited="true" range="0.1 2"><site site="left"/><site site="eye"/></spatial>
  </tendon>
</mujoco>"""


@pytest.mark.filterwarnings("ignore::tsdyn.ImportLosses")
def test_limits_of_tendons_become_ropes(tmp_path):
    pytest.importorskip("mujoco")
    file = tmp_path / "tether.xml"
    file.write_text(TETHER)
    assert len(ts.load(file).constraints) == 1  # the normalisation
    scene = ts.load(file, limits=True)
    assert [entry.where for entry in scene.imported.groups()["limits of a tendon"]] == ["strut"]
    rope = scene["limits of leash"]
    assert (rope.length, rope.always_taut) == (2.0, False)
    depth = np.sqrt(3) / 2  # of the point from which either span is 1 m
    (t, name, impulse), *_ = ts.simulate(scene, (0, 1)).impulses
    fall = depth - 0.2
    assert name == "limits of leash"
    assert t == pytest.approx(np.sqrt(2 * fall / 10), abs=1e-12)
    assert impulse == pytest.approx(2.0 * np.sqrt(2 * fall * 10) / (2 * depth), abs=1e-9)  # two spans stop it
