"""Contacts with the ground have loops of their own in series: the same motion as on a plate that is held in place."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.refusals import refuse
from tests.helpers.tolerances import HELD, TIGHT

C, I = ts.constraints, ts.integrators
CENTRE = np.array([0.02, -0.01, 0.03])  # of the surface, beside the centroid
TILT = Rotation.from_euler("xyz", (0.9, 0.3, 0.2))
SURFACES = {  # class, its arguments, semi-axes, radius of the tyre
    "disc": (C.RollingDisc, {"axis_a": (0, 0, 1), "radius": 0.5}, (0.5, 0.5, 0.0), 0.0),
    "torus": (C.RollingDisc, {"axis_a": (0, 0, 1), "radius": 0.5, "tyre_radius": 0.1}, (0.5, 0.5, 0.0), 0.1),
    "ball": (C.RollingBall, {"radius": 0.5}, (0.5, 0.5, 0.5), 0.0),
    "ellipsoid": (C.RollingEllipsoid, {"semi_axes": (0.5, 0.3, 0.2)}, (0.5, 0.3, 0.2), 0.0),
}


def bodies_on(planes, surface, slip):
    """A scene with a body on each plane, "ground" or "plate", 2 m apart; they roll at first."""
    kind, arguments, axes, tyre = SURFACES[surface]
    scene = ts.Scene(gravity=(1, 0, -10))
    plate = scene.add_body(1.0, (1, 1, 1), position=(3, 1, -1), name="plate") if "plate" in planes else None
    if plate is not None:
        scene.add(C.Fixed.at(plate, scene.ground, point=(0, 0, 0)))
    z, spin = TILT.apply((0, 0, 1), inverse=True), np.array([0.3, 0.2, 4.0])
    arm = CENTRE - np.square(axes) * z / np.sqrt(np.square(axes) @ np.square(z)) - tyre * z  # to the contact point
    for i, plane in enumerate(planes):
        body = scene.add_body(
            2.0, (0.2, 0.25, 0.3), position=(0, 2 * i, -TILT.apply(arm)[2]), orientation=TILT,
            velocity=-TILT.apply(np.cross(spin, arm)), angular_velocity=spin, name=f"body {i}",
        )  # fmt: skip
        places = {"center_a": CENTRE, "normal_b": (0, 0, 1), "point_b": (0, 0, 1) if plane == "plate" else (0, 0, 0)}
        scene.add(kind(body, plate if plane == "plate" else scene.ground, **arguments, **places, slip=slip))
    return scene


@pytest.mark.slow_but("False-disc", "True-ellipsoid")
@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("slip", [False, True])
def test_ground_and_plate_are_the_same(surface, slip):
    """On the ground alone, on the plate alone, and on both in one scene."""
    runs = []
    for planes in (["ground"], ["plate"], ["ground", "plate"]):
        scene = bodies_on(planes, surface, slip)
        runs.append(ts.simulate(scene, (0, 1), integrator=I.Taylor(tol=1e-15)).raise_if_failed())
        assert runs[-1].constraint_error.position.max() < HELD
        assert runs[-1].constraint_error.velocity.max() < HELD
    first = runs[0]
    assert np.ptp(first.energy) < TIGHT
    for i, run in enumerate(runs[1:], 1):
        for name in ("body 0", "body 1")[:i]:
            far = (0, 2, 0) if name == "body 1" else (0, 0, 0)
            np.testing.assert_allclose(run.position(name)[-1], first.position("body 0")[-1] + far, atol=TIGHT)
            np.testing.assert_allclose(run.velocity(name)[-1], first.velocity("body 0")[-1], atol=TIGHT)
            force, torque = (value[-1] for value in run.reaction(run.scene.constraints[-1]))
            right, about = (value[-1] for value in first.reaction(first.scene.constraints[-1]))
            np.testing.assert_allclose(force, right, atol=1e2 * TIGHT)
            np.testing.assert_allclose(torque, about, atol=1e2 * TIGHT)


def test_arms_of_what_is_no_contact_are_refused():
    def name_no_marker():
        class Lost(C.SmoothContact):
            normal = "normal_a"

    def turn_markers_round():
        class Round(C.SmoothContact):
            markers = C.SmoothContact.markers[::-1]

    for define in (name_no_marker, turn_markers_round):
        refuse(define, ts.InvalidConstraint, ("arm_series", "a Point and three Vectors of a", "`normal`"))
