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
