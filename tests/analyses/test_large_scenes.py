"""Statics of many bodies: few steps whatever their number, coordinates by structure, interrupts, what falls."""

import os
import signal
import threading

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import minimize, root
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.closed_loops import four_bar
from tests.helpers.hanging_chains import DOWN, G, pendulum_matrices, pendulums
from tests.helpers.tolerances import CLOSE, HELD
from tsdyn.analyses import coordinates, reduction

C, F = ts.constraints, ts.forces


def ball_chain(turns, length=0.3, mass=0.5, inertia=(4e-3, 4e-3, 1e-3), closed=False):
    """Links on spherical joints, each along its own -z after a turn (n, 3), rad; the last held at its end if closed."""
    scene, before, top = ts.Scene(gravity=DOWN), None, np.zeros(3)
    for i, turn in enumerate(turns):
        rotation = Rotation.from_rotvec(turn)
        down = rotation.apply([0.0, 0.0, -length])
        body = scene.add_body(mass, inertia, top + down / 2, rotation, name=f"link {i}")
        scene.add(C.Spherical.at(before or scene.ground, body, point=top, name=f"ball {i}"))
        before, top = body, top + down
    if closed:
        scene.add(C.Spherical.at(before, scene.ground, point=top, name="end"))
    return scene


@pytest.mark.parametrize("count", [8, 40, pytest.param(300, marks=pytest.mark.slow)])
def test_steps_hardly_grow_with_the_links_of_a_chain(count):
    found = pendulums(np.full(count, np.pi / 2)).equilibrium()
    assert found.stable
    assert found.steps < 20
    assert np.abs(found.state.q.reshape(-1, 7)[:, 0]).max() < HELD * count


def test_links_that_point_anywhere_hang_at_last():
    rng = np.random.default_rng(3)
    found = ball_chain(2.0 * rng.normal(size=(30, 3))).equilibrium()
    assert found.stable
    assert found.neutral == 30  # each about its own axis
    assert found.steps < 60
    heights = found.state.q.reshape(-1, 7)[:, 2]
    np.testing.assert_allclose(heights, -0.3 * (np.arange(30) + 0.5), atol=CLOSE)


def test_balls_on_rods_hang_in_few_steps():
    scene, before, count, length = ts.Scene(gravity=DOWN), None, 60, 0.1
    for i in range(count):
        ball = scene.add_point_mass(mass=0.1, position=(length * (i + 1), 0.0, 0.0), name=f"ball {i}")
        scene.add(C.Distance(ball, before or scene.ground, length=length))
        before = ball
    found = scene.equilibrium()
    assert found.stable
    assert found.steps < 20
    np.testing.assert_allclose(found.state.q.reshape(-1, 3)[:, 2], -length * np.arange(1, count + 1), atol=CLOSE)


def test_springs_that_begin_slack_hang():
    """Each spring carries what hangs below it."""
    scene, before, count, stiffness = ts.Scene(gravity=DOWN), None, 30, 200.0
    for i in range(count):
        ball = scene.add_point_mass(mass=0.1, position=(0.1 * (i + 1), 0.0, 0.0), name=f"ball {i}")
        scene.add(F.Spring(before or scene.ground, ball, stiffness=stiffness, free_length=0.1))
        before = ball
    found = scene.equilibrium()
    pulls = 0.1 * G * np.arange(count, 0, -1)
    np.testing.assert_allclose(found.state.q[2::3], -(0.1 + pulls / stiffness).cumsum(), atol=CLOSE)
    assert found.steps < 40


@pytest.mark.slow
def test_what_slides_is_seen_soon_and_a_stop_far_away_is_found():
    scene = ts.Scene(gravity=DOWN)
    cart = scene.add_body(1.0, (1, 1, 1), name="cart")
    rail = scene.add(C.Translational.at(scene.ground, cart, point=(0, 0, 0), axis=(1, 0, -1), name="rail"))
    with pytest.raises(ts.NoEquilibrium, match="cart") as caught:
        scene.equilibrium()
    assert int(str(caught.value).split(" steps")[0].split()[-1]) < 30
    scene.add(F.JointForce(rail, function=stop, name="stop"))
    found = scene.equilibrium()
    assert found.state.displacement(rail) == pytest.approx(30.0 + G / np.sqrt(2.0) / 1000.0, rel=CLOSE)


def stop(t, way, rate):
    """A spring from 30 m on."""
    return -1000.0 * (way - 30.0) if way > 30.0 else 0.0


def test_equilibrium_of_springs_and_links_is_that_of_the_least_energy():
    """Six links, each tied to the ground by a spring, against the energy in absolute angles, by SciPy."""
    count, length, mass, stiffness, free = 6, 0.7, 1.3, 40.0, 0.3
    scene = pendulums(np.linspace(0.3, 2.4, count))
    anchors = np.array([[0.8 * (-1) ** i, 0.0, 0.4 - 0.5 * i] for i in range(count)])
    for body, anchor in zip(scene.bodies, anchors, strict=True):
        scene.add(
            F.Spring(
                scene.ground,
                body,
                point_a=anchor,
                point_b=(0, 0, -length / 2),
                stiffness=stiffness,
                free_length=free,
            )
        )

    def ends(angles):
        return np.cumsum(length * np.column_stack((-np.sin(angles), -np.cos(angles))), axis=0)

    def gradient(angles):
        tips, slopes = ends(angles), length * np.column_stack((-np.cos(angles), np.sin(angles)))
        apart = tips - anchors[:, [0, 2]]
        sizes = np.linalg.norm(apart, axis=1)
        pull = stiffness * (1.0 - free / sizes)[:, None] * apart  # of each tip
        weights = pull[::-1].cumsum(axis=0)[::-1] + np.outer(mass * G * (count - np.arange(count) - 0.5), [0.0, 1.0])
        return (weights * slopes).sum(axis=1)

    found = scene.equilibrium()
    rotations = [found.state.rotation(body) for body in scene.bodies]
    angles = np.array([np.arctan2(A[0, 2], A[2, 2]) for A in rotations])
    exact = root(gradient, angles, tol=1e-14).x
    np.testing.assert_allclose(angles, exact, atol=CLOSE)
    hessian = np.array([(gradient(exact + 1e-6 * e) - gradient(exact - 1e-6 * e)) / 2e-6 for e in np.eye(count)])
    assert found.stable
    assert np.linalg.eigvalsh(hessian + hessian.T).min() > 0.0


def test_net_of_springs_against_scipy():
    """A grid of balls that hangs from its rim by springs under tension: the least energy of 9 x 3 coordinates."""
    size, step, stiffness, mass = 5, 0.5, 200.0, 0.4
    scene, balls = ts.Scene(gravity=DOWN), {}
    places = {(i, j): np.array([step * i, step * j, 0.0]) for i in range(size) for j in range(size)}
    inner = [key for key in places if all(0 < k < size - 1 for k in key)]
    for key in inner:
        balls[key] = scene.add_point_mass(mass=mass, position=places[key], name=f"ball {key}")
    edges = [((i, j), (i + a, j + b)) for i, j in places for a, b in ((1, 0), (0, 1)) if (i + a, j + b) in places]
    edges = [edge for edge in edges if any(key in balls for key in edge)]
    for one, other in edges:
        ends = {"point_a": places[one]} if one not in balls else {}
        ends |= {"point_b": places[other]} if other not in balls else {}
        a, b = (balls.get(key, scene.ground) for key in (one, other))
        scene.add(F.Spring(a, b, stiffness=stiffness, free_length=0.8 * step, **ends))

    def energy(x):
        at = {**places, **dict(zip(inner, x.reshape(-1, 3), strict=True))}
        lengths = np.array([np.linalg.norm(at[one] - at[other]) for one, other in edges])
        return 0.5 * stiffness * ((lengths - 0.8 * step) ** 2).sum() + mass * G * x.reshape(-1, 3)[:, 2].sum()

    found = scene.equilibrium()
    best = minimize(energy, np.concatenate([places[key] for key in inner]), options={"gtol": 1e-9}, tol=1e-12)
    assert found.stable
    assert energy(found.state.q) <= best.fun + HELD
    np.testing.assert_allclose(found.state.q, best.x, atol=1e-6)


def test_coordinates_of_many_links_on_balls_are_their_rotations():
    """Two planes of pendulums, and turns of each link about itself."""
    count, length, mass = 60, 0.3, 0.5
    linear = ball_chain(np.zeros((count, 3))).linearise()
    assert linear.coordinates == tuple(f"link {i}.rotation {axis}" for i in range(count) for axis in "xyz")
    M, K = pendulum_matrices(count, length, mass, 4e-3)
    expected = np.sqrt(eigh(K, M, eigvals_only=True))
    found = np.sort(np.abs(linear.eigenvalues()))
    np.testing.assert_allclose(found[: 2 * count], 0.0)
    np.testing.assert_allclose(found[2 * count :], np.sort(np.repeat(expected, 4)), rtol=CLOSE)


def scenes():
    """Trees and loops of few bodies."""
    rng = np.random.default_rng(1)
    tree = ball_chain(0.5 * rng.normal(size=(4, 3)))
    last = tree.bodies[-1]
    arm = tree.add_body(1.0, (0.02, 0.03, 0.04), last.position + np.array([0.2, 0.0, 0.0]), name="arm")
    tree.add(C.Revolute.at(last, arm, point=last.position, axis=(0, 1, 0), name="pin"))
    floating = ts.Scene(gravity=(0, 0, 0))
    one, two = (floating.add_body(m, (0.1, 0.2, 0.3), (x, 0, 0), name=f"body {m}") for m, x in ((1.0, 0.0), (2.0, 1.0)))
    floating.add(C.Spherical.at(one, two, point=(0.4, 0, 0)))
    floating.add(F.Spring(one, two, point_a=(0, 0.3, 0), stiffness=30.0, free_length=0.2))
    loop = ball_chain(0.3 * rng.normal(size=(6, 3)) + [0.0, -1.2, 0.0], closed=True)
    return {"tree": tree, "floating": floating, "loop": loop, "four-bar": four_bar(rate=0.0)}


@pytest.mark.parametrize("name", scenes())
def test_eigenvalues_are_those_of_other_coordinates(name, monkeypatch):
    scene = scenes()[name]
    state = scene.equilibrium().state
    usual = scene.linearise(state)
    monkeypatch.setattr(coordinates, "DENSE", 0)
    monkeypatch.setattr(coordinates, "BATCH", 2)
    other = scene.linearise(state)
    assert len(other.coordinates) == len(usual.coordinates)
    size = np.abs(usual.eigenvalues()).max()
    for value in usual.eigenvalues():
        assert np.abs(other.eigenvalues() - value).min() < 1e-7 * size  # pairs that coincide split by the root of EPS


@pytest.mark.parametrize("name", scenes())
def test_size_of_batches_changes_no_coordinate(name, monkeypatch):
    scene = scenes()[name]
    usual = scene.linearise().coordinates
    for size in (1, 5):
        monkeypatch.setattr(coordinates, "BATCH", size)
        assert scene.linearise().coordinates == usual


def test_what_falls_is_named_at_once():
    scene = pendulums([0.4])
    one = scene.add_point_mass(mass=1.0, position=(3, 0, 0), name="ball")
    two = scene.add_point_mass(mass=1.0, position=(4, 0, 0), name="other")
    scene.add(C.Distance(one, two, length=1.0))
    with pytest.raises(ts.NoEquilibrium, match="ball, joined to 1 more, falls freely"):
        scene.equilibrium()
    scene.add(F.PointForce(two, force=(0, 0, 2 * G)))  # in balance while the pair stands upright or hangs
    assert scene.equilibrium().neutral > 0


@pytest.mark.skipif(os.name == "nt", reason="a process can't press its own Ctrl-C")
def test_ctrl_c_is_answered_within_lapack(monkeypatch):
    linear, waiting = pendulums([0.0, 0.0]).linearise(), threading.Event()

    def long_eigh(K):
        os.kill(os.getpid(), signal.SIGINT)
        assert waiting.wait(20.0)
        return np.linalg.eigvalsh(K), np.eye(len(K))

    monkeypatch.setattr(reduction.np.linalg, "eigh", long_eigh)
    outside = signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            linear.eigenvalues()
    finally:
        signal.signal(signal.SIGINT, outside)
    assert not waiting.is_set()
    waiting.set()
