"""Random scenes with contacts: none gains energy, penetrates beyond rounding, or ends before its time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts

C = ts.constraints
FLOOR = {"normal_b": (0, 0, 1), "unilateral": True}


def balls(rng):
    """One above the other, exactly or nearly, perhaps within a large ball; each contact with its restitution."""
    scene, found = ts.Scene(), []
    e = rng.choice([0.0, 0.3, 0.8, 1.0], 40).tolist()
    for i in range(rng.integers(1, 6)):
        place = (*rng.uniform(-0.02, 0.02, 2) * rng.choice([0, 1]), 0.3 + 0.3 * i)
        ball = scene.add_point_mass(rng.uniform(0.1, 3.0), place, rng.normal(size=3) * rng.choice([0, 1]))
        scene.add(C.SphereContact(ball, scene.ground, radius_a=0.1, normal_b=(0, 0, 1), restitution=e.pop()))
        if i == 0 or len(e) % 2:
            wall = {"radius_a": 0.1, "radius_b": 3.0, "inside": True}
            scene.add(C.SphereContact(ball, scene.ground, **wall, restitution=e.pop()))
        for other in found:
            scene.add(C.SphereContact(ball, other, radius_a=0.1, radius_b=0.1, restitution=e.pop()))
        found.append(ball)
    return scene


def box(rng):
    """A box thrown onto the floor."""
    scene, size = ts.Scene(), rng.uniform(0.2, 1.0, 3)
    solid, turned = ts.shapes.box(size, mass=2.0), Rotation.from_rotvec(rng.normal(size=3))
    start = {"velocity": rng.normal(size=3), "angular_velocity": 3 * rng.normal(size=3)}
    body, e = (
        scene.add_body(**solid, position=(0, 0, 1), orientation=turned, **start),
        float(rng.choice([0.0, 0.3, 0.7])),
    )
    for i in range(8):
        corner = size / 2 * [2 * (i & 1) - 1, (i & 2) - 1, (i & 4) / 2 - 1]
        scene.add(C.PlaneContact(body, scene.ground, point_a=corner, **FLOOR, restitution=e))
    return scene


def chain(rng):
    """A chain over the floor, free or hung up, with stops between its links."""
    scene, e = ts.Scene(), float(rng.choice([0.0, 0.3, 0.7]))
    planar, free, last = rng.integers(2), rng.integers(2), scene.ground
    for i in range(rng.integers(2, 6)):
        link = scene.add_body(1.0, (0.001, 0.0133, 0.0133), position=(0.2 + 0.4 * i, 0, 0.6))
        point = (0.4 * i, 0, 0.6)
        if i or not free:
            kind, axis = (C.Revolute, {"axis": (0, 1, 0)}) if planar else (C.Spherical, {})
            joint = scene.add(kind.at(last, link, point=point, **axis))
            if planar and i and rng.integers(2):
                scene.add(C.Stop(joint, -rng.uniform(0.1, 1.0), rng.uniform(0.1, 1.0), restitution=e))
        for x in (-0.2, 0.2) if i == 0 and free else (0.2,):
            scene.add(C.PlaneContact(link, scene.ground, point_a=(x, 0, 0), **FLOOR, restitution=e))
        last = link
    return scene


def gaps(scene, solution):
    """The least gap of floors and stops at the outputs, m or rad."""
    for contact in scene.constraints:
        if isinstance(contact, C.PlaneContact):
            yield solution.position(contact.a, point=contact.point_a)[:, 2].min()
        elif isinstance(contact, C.Stop):
            angle = solution.angle(contact.joint)
            yield min((angle - contact.lower).min(), (contact.upper - angle).min())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(15))
@pytest.mark.parametrize("build", [balls, box, chain])
def test_laws_of_contact(build, seed):
    scene = build(np.random.default_rng(seed))
    solution = ts.simulate(scene, (0, 1.5))
    assert solution.success, solution.message
    size = 1.0 + np.abs(solution.energy).max()
    assert np.diff(solution.energy).max() < 1e-7 * size  # the tolerance of the run
    assert min(gaps(scene, solution), default=0.0) > -1e-11
    assert solution.constraint_error.position.max() < 1e-11
    assert min((impulse for *_, impulse in solution.impulses), default=1.0) > 0.0
