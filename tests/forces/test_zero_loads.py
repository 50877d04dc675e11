"""Forces of zero: refused when they are made, as if forgotten; those given, and of studies, edits and files, may be."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.built_in import FORCES

SPAN = (0.0, 0.2)
KINDS = [kind for kind in FORCES if kind.sources]


def acted_on(kind):
    """Two bodies and a force between them, and the parameters of the force that make it zero."""
    rng = np.random.default_rng(0)
    scene = ts.Scene()
    a = scene.add_body(1.0, (0.3, 0.4, 0.5), position=(0, 0, 1), velocity=(0.1, 0.2, 0), name="a")
    b = scene.add_body(2.0, (0.2, 0.3, 0.4), position=(2, 0, 0), name="b")
    force = scene.add(kind.example(rng, a, b))
    force.name = "load"
    scene.assemble()
    zeros = {f"load.{name}": 0.0 * np.asarray(getattr(force, name)) for name in force.sources if getattr(force, name)
             is not None}  # fmt: skip
    return scene, zeros


def same(one, other):
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-7)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_force_of_zero_in_a_study_does_nothing(kind):
    scene, zeros = acted_on(kind)
    bare = scene.copy()
    bare.remove(bare["load"])
    free = ts.simulate(bare, SPAN)
    acting = ts.simulate(scene, SPAN).state.q
    table = {name: np.stack([zero, scene.parameters()[name], zero]) for name, zero in zeros.items()}
    found = ts.ensemble(scene, table, SPAN, threads=1)
    assert found.success.all(), found.message
    same(found.q, [free.state.q, acting, free.state.q])
    alone = ts.simulate(scene.with_parameters(zeros), SPAN)
    assert found.q[2].tobytes() == alone.state.q.tobytes()


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_force_of_zero_is_kept_by_edits_and_files(kind, tmp_path):
    scene, zeros = acted_on(kind)
    other = scene.with_parameters(zeros)
    for name, zero in zeros.items():
        setattr(scene["load"], name.partition(".")[2], zero)
    for idle in (scene, other):
        idle.save(tmp_path / "idle.toml")
        loaded = ts.load(tmp_path / "idle.toml")
        assert loaded["load"].is_idle
        assert ts.simulate(loaded, SPAN).state.q.tobytes() == ts.simulate(idle, SPAN).state.q.tobytes()


def test_a_push_of_zero_waits_for_an_action():
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(2.0, (1, 1, 2.0), name="body")
    scene.add(ts.forces.PointForce(body, force=(0, 0, 0), name="push"))
    scene.add(ts.forces.Torque(body, torque=(0, 0, 0), name="twist"))

    def late(t, state):
        return t - 1.0

    def action(change):
        change.set("push.force", (4.0, 0, 0))
        change.set("twist.torque", (0, 0, 2.0))

    late.action = action
    solution = ts.simulate(scene, (0, 2), events=late)
    same(solution.position("body")[-1], (0.5 * 2.0, 0, 0))
    same(solution.angular_velocity("body")[-1], (0, 0, 1.0))


def test_a_file_that_says_nothing_of_a_force_is_refused(tmp_path):
    path = tmp_path / "scene.toml"
    text = 'version = 1\n[[body]]\nname = "a"\ntype = "PointMass"\nmass = 1.0\nposition = [1, 0, 0]\n'
    path.write_text(text + '[[force]]\ntype = "Spring"\nname = "coil"\na = "a"\nb = "ground"\n')
    with pytest.raises(ts.InvalidFile, match="zero at all times; set stiffness"):
        ts.load(path)


@pytest.mark.slow
def test_zeros_beside_others_in_lanes():
    scene = ts.Scene()
    bob = scene.add_body(1.0, (0.1, 0.2, 0.25), position=(1, 0, 0), name="bob")
    scene.add(ts.forces.Spring(bob, scene.ground, point_a=(0, 0.1, 0), stiffness=30.0, damping=0.2, name="spring"))
    scene.add(ts.forces.Torque(bob, torque=(1, 0, 0), name="twist"))
    table = {"spring.stiffness": [0.0, 30.0, 0.0], "spring.damping": [0.0, 0.0, 1.0], "twist.torque": np.eye(3) - 1.0}
    table["twist.torque"][1] = 0.0
    fast, found = (ts.ensemble(scene, table, SPAN, lanes=lanes) for lanes in (4, 1))
    assert found.success.all(), found.message
    same(fast.q, found.q)
