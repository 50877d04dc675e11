"""Imported files against the engines that the formats come from: accelerations at random states."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers import link_motions
from tests.helpers.tolerances import CLOSE, FINE

MODELS = Path(__file__).parent / "models"


def load(path, **options):
    with warnings.catch_warnings(action="ignore", category=ts.ImportLosses):
        return ts.load(path, **options)


def without_forces(scene):
    for force in scene.forces:
        scene.remove(force)
    return scene


def pinocchio_motions(path, names, rng, free_base, scene=None):
    """A random state of a tree without damping, by Pinocchio."""
    pin = pytest.importorskip("pinocchio")
    base = (pin.JointModelFreeFlyer(),) if free_base else ()
    model = pin.buildModelFromUrdf(str(path), *base)
    model.armature[:] = model.damping[:] = model.friction[:] = 0.0
    q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    v = rng.normal(size=model.nv)
    qdd = pin.aba(model, model.createData(), q, v, np.zeros(model.nv))
    return link_motions.of_pinocchio(model, q, v, qdd, names)


def mujoco_motions(path, names, rng, actuated=True):
    """A random state by MuJoCo: contacts, limits, friction and equality constraints off."""
    mujoco = pytest.importorskip("mujoco")
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.fusestatic = False
    model, off = spec.compile(), mujoco.mjtDisableBit
    model.body_gravcomp[:] = model.opt.density = model.opt.viscosity = 0.0
    model.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_FRICTIONLOSS | off.mjDSBL_EQUALITY
    if not actuated:
        model.opt.disableflags |= off.mjDSBL_ACTUATION
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = model.qpos0, rng.normal(size=model.nv)
    mujoco.mj_integratePos(model, data.qpos, 0.5 * rng.normal(size=model.nv), 1.0)
    mujoco.mj_forward(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    return link_motions.of_mujoco(model, data, names)


def names_of(scene):
    return [body.name for body in scene.bodies]


@pytest.mark.parametrize("free", [False, True])
def test_urdf_has_the_accelerations_of_pinocchio(free):
    pytest.importorskip("lxml")
    scene = without_forces(load(MODELS / "arm.urdf", free_base=free))
    motions = link_motions.read("arm_free" if free else "arm")
    link_motions.place(scene, motions)
    assert np.abs(scene.evaluate().Phi).max() < FINE
    assert link_motions.acceleration_error(scene, motions) < FINE


def test_mjcf_has_the_accelerations_of_mujoco():
    pytest.importorskip("lxml")
    pytest.importorskip("mujoco")
    scene = load(MODELS / "leg.xml")
    motions = link_motions.read("leg")
    link_motions.place(scene, motions)
    assert np.abs(scene.evaluate().Phi).max() < FINE
    assert link_motions.acceleration_error(scene, motions) < FINE


@pytest.mark.slow
def test_references_are_those_of_the_engines():
    pytest.importorskip("pinocchio")
    for name, free in (("arm", False), ("arm_free", True)):
        scene = without_forces(load(MODELS / "arm.urdf", free_base=free))
        motions = pinocchio_motions(MODELS / "arm.urdf", names_of(scene), np.random.default_rng(1), free)
        link_motions.place(scene, motions)
        assert link_motions.acceleration_error(scene, motions) < FINE, name
    scene = load(MODELS / "leg.xml")
    motions = mujoco_motions(MODELS / "leg.xml", names_of(scene), np.random.default_rng(1))
    link_motions.place(scene, motions)
    assert link_motions.acceleration_error(scene, motions) < FINE


TREES = {  # of example-robot-data: whether the base is free
    "ur_description/urdf/ur5_robot.urdf": False,
    "panda_description/urdf/panda.urdf": False,
    "kinova_description/robots/kinova.urdf": False,
    "z1_description/urdf/z1.urdf": False,
    "xarm_description/urdf/xarm7.urdf": False,
    "go2_description/urdf/go2.urdf": True,
    "anymal_c_simple_description/urdf/anymal.urdf": True,
    "solo_description/robots/solo12.urdf": True,
    "hyq_description/robots/hyq_no_sensors.urdf": True,
    "g1_description/urdf/g1_29dof_rev_1_0.urdf": True,
    "human_description/robots/human.urdf": True,
    "allegro_hand_description/urdf/allegro_right_hand.urdf": False,
}


def robots():
    """The folder of example-robot-data, from the registry."""
    pytest.importorskip("pinocchio")
    from importlib.metadata import PackageNotFoundError, files

    try:
        found = next(path for path in files("example-robot-data") if path.name == "ur5_robot.urdf")
    except PackageNotFoundError:
        pytest.skip("pip install example-robot-data")
    return Path(found.locate()).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.parametrize("model", TREES)
def test_public_trees(model):
    path, free = robots() / model, TREES[model]
    scene = without_forces(load(path, free_base=free))
    for item in [item for item in scene.constraints if type(item) is ts.constraints.Coupler]:
        scene.remove(item)
    for seed in range(3):
        motions = pinocchio_motions(path, names_of(scene), np.random.default_rng(seed), free)
        link_motions.place(scene, motions)
        assert link_motions.acceleration_error(scene, motions) < CLOSE


SUITE = (
    "humanoid",
    "humanoid_CMU",
    "dog",
    "quadruped",
    "cheetah",
    "walker",
    "hopper",
    "stacker",
    "cartpole",
    "reacher",
)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:compiler attribute")  # of MuJoCo
@pytest.mark.parametrize("model", SUITE)
def test_public_trees_of_mujoco(model):
    import sys
    from importlib.util import find_spec

    pytest.importorskip("mujoco")
    found = find_spec("dm_control") or pytest.skip("pip install --no-deps dm-control")
    assert "dm_control" not in sys.modules  # its files alone are read
    path = Path(found.submodule_search_locations[0]) / "suite" / f"{model}.xml"
    scene = load(path)
    for force in [force for force in scene.forces if force.name.endswith(" actuator")]:
        scene.remove(force)
    for seed in range(3):
        motions = mujoco_motions(path, names_of(scene), np.random.default_rng(seed), actuated=False)
        link_motions.place(scene, motions)
        assert link_motions.acceleration_error(scene, motions) < CLOSE


@pytest.mark.slow
def test_closed_loops_of_cassie(tmp_path):
    """Its rods have balls at both ends here, as the robot has: the hinges of the file hold what the loop holds too."""
    from tests.helpers import sdf_in_pinocchio

    source = (robots() / "cassie_description/robots/cassie_v2.sdf").read_text()
    import pinocchio as pin

    for joint in ("achilles-spring-joint", "crank-rod-joint"):
        for side in ("left", "right"):
            hinge = f'name="{side}-{joint}" type="revolute"'
            assert hinge in source
            source = source.replace(hinge, hinge.replace("revolute", "ball"))
    path = tmp_path / "cassie.sdf"
    path.write_text(source)
    scene, rng = without_forces(load(path)), np.random.default_rng(0)
    assert len(scene.mobility().redundant) == 0
    model, loops = sdf_in_pinocchio.model_of(path)
    for _ in range(3):
        start = pin.integrate(model, pin.neutral(model), 0.2 * rng.normal(size=model.nv))
        q, v = sdf_in_pinocchio.closed(model, loops, start, rng)
        qdd = sdf_in_pinocchio.accelerations(model, loops, q, v)
        motions = link_motions.of_pinocchio(model, q, v, qdd, names_of(scene))
        link_motions.place(scene, motions)
        assert np.abs(scene.evaluate().Phi).max() < FINE
        assert link_motions.acceleration_error(scene, motions) < CLOSE


TENDONS = """
<mujoco>
  <option gravity="0 0 -10"/>
  <worldbody>
    <site name="left"/>
    <site name="right" pos="1 0 0"/>
    <geom name="drum" type="cylinder" size="0.1 0.1" pos="3 0 0"/>
    <body name="block" pos="0.5 0 -1.2">
      <joint name="x" type="slide" axis="1 0 0" armature="0.3"/>
      <joint name="z" type="hinge" pos="0 0 0.7" axis="0 1 0" armature="0.2"/>
      <geom size="0.1" mass="2"/>
      <site name="hook" pos="0 0 0.1"/>
    </body>
    <body name="load" pos="2 0 -1.5"><freejoint/><geom size="0.1" mass="1"/><site name="eye" pos="0 0 0.1"/></body>
  </worldbody>
  <tendon>
    <spatial name="cord" stiffness="300" springlength="0 3.2">
      <site site="left"/> <site site="hook"/> <site site="right"/> <site site="eye"/>
    </spatial>
    <spatial name="loose" stiffness="300" springlength="0 9"> <site site="left"/> <site site="eye"/> </spatial>
    <spatial name="around" stiffness="300">
      <site site="left"/> <geom geom="drum"/> <site site="eye"/>
    </spatial>
    <spatial name="line"> <site site="left"/> <site site="hook"/> <site site="right"/> </spatial>
  </tendon>
  <equality><tendon name="tie" tendon1="line" active="true"/></equality>
</mujoco>"""


def test_tendons_through_sites_are_those_of_mujoco(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "tendons.xml"
    path.write_text(TENDONS)
    scene = load(path)
    assert [type(scene[name]).__name__ for name in ("cord", "loose", "tie")] == ["Cable", "Cable", "Rope"]
    assert [entry.where for entry in scene.imported.groups()["spring of a tendon"]] == ["around"]
    assert "tendon" not in scene.imported.groups()
    scene.remove(scene["tie"])  # soft in MuJoCo
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
    model.tendon_stiffness[model.tendon("around").id] = 0.0
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    motions = link_motions.of_mujoco(model, data, names_of(scene))
    link_motions.place(scene, motions)
    assert link_motions.acceleration_error(scene, motions) < FINE


def test_a_run_with_armature_is_that_of_mujoco():
    """The leg of the models, its armature included, after a tenth of a second."""
    mujoco = pytest.importorskip("mujoco")
    scene = load(MODELS / "leg.xml")
    model = mujoco.MjModel.from_xml_path(str(MODELS / "leg.xml"))
    model.opt.timestep, model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    data = mujoco.MjData(model)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    state = ts.simulate(scene, (0.0, 0.1), rtol=1e-11, atol=1e-11).state
    for name in ("trunk", "thigh", "rod"):
        origin = state.position(name, scene.imported.frames[name].position)
        assert np.abs(origin - data.body(name).xpos).max() < FINE


ROTORS = [f"axis='{axis}' armature='0.{i}'" for i, axis in enumerate(("1 0 0", "0 0 1", "0 1 0"), 3)]
SLIDES = {
    "plane": ROTORS[:2],
    "space": ROTORS,
    "oblique springs": ["axis='1 0 0'", "axis='0.6 0 0.8' stiffness='5' damping='2'"],
    "springs across the body": ["axis='0.6 0 0.8' damping='2'", "axis='-0.8 0 0.6' stiffness='5'"],
}


@pytest.mark.parametrize("slides", SLIDES.values(), ids=SLIDES)
def test_slides_that_do_not_become_one_joint_are_those_of_mujoco(slides, tmp_path):
    """A root of slides and a hinge, a link that swings from it; between slides are links of a trifle, 1e-7 kg."""
    mujoco = pytest.importorskip("mujoco")
    roots = "".join(f"<joint name='slide {i}' type='slide' {given}/>" for i, given in enumerate(slides))
    inertial = "<inertial pos='0.2 0 0.1' mass='1' diaginertia='.02 .03 .04'/>"
    arm = f"<body name='arm' pos='0.4 0 0'><joint name='elbow' axis='0 1 0' armature='0.1'/>{inertial}</body>"
    root = f"<body name='root'>{roots}<joint name='turn' axis='0 1 0' armature='0.2'/>{inertial}{arm}</body>"
    (tmp_path / "planar.xml").write_text(f"<mujoco><worldbody>{root}</worldbody></mujoco>")
    scene = load(tmp_path / "planar.xml")
    assert set(scene.imported.groups()) == {"link without mass or inertia, given a trifle"}
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "planar.xml"))
    model.opt.timestep, model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    for name, rate in (("turn", 2.0), ("elbow", -3.0)):
        scene.set(name, rate=rate)
        data.joint(name).qvel[:] = rate
    for _ in range(3000):
        mujoco.mj_step(model, data)
    state = ts.simulate(scene, (0.0, 0.3), rtol=1e-11, atol=1e-11).state
    for name in ("root", "arm"):
        origin = state.position(name, scene.imported.frames[name].position)
        assert np.abs(origin - data.body(name).xpos).max() < 1e-6
