"""Many frictions that stick and slide in one scene: each as it does alone, and packed once for all combinations."""

import numpy as np
import pytest

import tsdyn as ts
from benchmarks import friction
from tests.helpers.tolerances import FINE
from tsdyn.simulation import phase_scenes

C, F, M = ts.constraints, ts.forces, ts.motions
G = 9.81


@pytest.fixture
def packs(monkeypatch):
    """The phases that are packed."""
    found, pack = [], phase_scenes.pack
    monkeypatch.setattr(phase_scenes, "pack", lambda *given: found.append(given) or pack(*given))
    return found


def blocks_on_a_belt(stiffness, speed=0.5, mu=0.4, static=0.6):
    """Blocks side by side, each on its spring, in guides that leave them one direction."""
    scene = ts.Scene(gravity=(0, 0, -G))
    band = scene.add_body(10.0, (1, 1, 1), velocity=(speed, 0, 0), name="band")
    way = scene.add(C.Translational.at(scene.ground, band, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.TranslationMotor.of(way, displacement=M.Ramp(0.0, speed)))
    for i, k in enumerate(stiffness):
        block = scene.add_point_mass(1.0, position=(0, i, 0), velocity=(speed, 0, 0), name=f"block {i}")
        contact = scene.add(C.PlaneContact(block, band, normal_b=(0, 0, 1)))
        scene.add(C.Dot2(scene.ground, block, axis_a=(0, 1, 0), value=float(i)))
        scene.add(F.Spring(block, scene.ground, point_b=(-5, i, 0), stiffness=k, free_length=5.0))
        scene.add(F.ContactFriction(contact, kinetic=mu, static=static, name=f"friction {i}"))
    return scene


def test_each_block_on_a_belt_has_the_period_of_one_alone(packs):
    """Sticks for 2 (mu_s - mu) m g / (k V), slips half an ellipse about mu m g / k: in closed form."""
    stiffness, speed, mu, static = 100.0 * (1.0 + 0.07 * np.arange(6)), 0.5, 0.4, 0.6
    scene = blocks_on_a_belt(stiffness, speed, mu, static)
    solution = ts.simulate(scene, (0.0, 2.5), rtol=1e-12, atol=1e-12)
    w, b = np.sqrt(stiffness), (static - mu) * G / stiffness
    period = 2.0 * b / speed + 2.0 * (np.pi - np.arctan(w * b / speed)) / w
    assert len({names for *_, names in solution.phases}) > 12
    for i in range(6):
        sticks = [f"friction {i}" in names for *_, names in solution.phases]
        begins = [
            begin for (begin, *_), now, before in zip(solution.phases[1:], sticks[1:], sticks, strict=False)
            if now and not before
        ]  # fmt: skip
        assert len(begins) > 2
        np.testing.assert_allclose(np.diff(begins), period[i], atol=FINE)
    assert len(packs) <= 4  # the whole scene's gaps, with open contacts, and with all rows that hold frictions


def test_a_level_chain_of_twenty_rough_pins_is_let_go():
    """M alpha = Q, up to friction of 1e-6: squares of relative accelerations far out are zero in floating point."""
    scene, count, length, inertia = ts.Scene(gravity=(0, 0, -G)), 20, 0.2, 0.01
    before = scene.ground
    for i in range(count):
        link = scene.add_body(1.0, 3 * [inertia], position=(length * (i + 0.5), 0, 0), name=f"link {i}")
        pin = scene.add(C.Revolute.at(before, link, point=(length * i, 0, 0), axis=(0, 1, 0)))
        scene.add(F.RevoluteFriction(pin, radius=0.01, kinetic=1e-6))
        before = link
    arms = length * (np.tri(count, k=-1) + 0.5 * np.eye(count))
    alpha = np.linalg.solve(arms.T @ arms + inertia * np.eye(count), arms.T @ np.full(count, G))
    solution = ts.simulate(scene, (0, 0.01))
    found = [solution.angular_acceleration(f"link {i}")[0][1] for i in range(count)]
    np.testing.assert_allclose(found, alpha, atol=1e-5)


@pytest.mark.slow
def test_a_chain_of_rough_pins(packs):
    """What sticks doesn't turn, all else does, and friction takes what energy is lost."""
    count = 18
    solution = ts.simulate(friction.build(count, rough=True, slip=0.0), (0.0, 2e-3), dense_output=True)
    kinds = {names for *_, names in solution.phases}
    assert len(kinds) > 8
    assert len(packs) <= 4
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=FINE)
    middles = np.array([0.5 * (begin + end) for begin, end, _ in solution.phases])
    states, held = solution.at(middles), [names for *_, names in solution.phases]
    spins = np.array([states.angular_velocity(f"link {i}")[:, 1] for i in range(count)])
    turns = np.abs(np.diff(spins, axis=0, prepend=0.0))
    sticks = np.array([[f"RevoluteFriction(pin {i})" in names for names in held] for i in range(count)])
    assert turns[sticks].max() < FINE
    assert turns[~sticks].max() > 1e3 * FINE
    assert solution.constraint_error.position.max() < 1e-12


@pytest.mark.slow
def test_sixty_rough_pins():
    """Pins that are held while they still turn by what the time leaves open come to rest, and the run goes on."""
    solution = ts.simulate(friction.build(60, rough=True, slip=0.0), (0.0, 5e-4), dense_output=True)
    assert solution.success, solution.message
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=FINE)
    assert solution.constraint_error.velocity.max() < FINE
