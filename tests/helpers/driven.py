"""Scenes of motors, screws and gears, and methods for them."""

import numpy as np

import tsdyn as ts
from tests.helpers.tolerances import EPS

C, M = ts.constraints, ts.motions
X, Y, Z = np.eye(3)
SPEED = 12.0  # rad/s
TURNS = 50
J = 0.3  # kg m^2, of the rotor about its axis
METHODS = {
    "taylor": {"integrator": "taylor", "rtol": 1e-12, "atol": 1e-12},
    "dop853": {"integrator": "dop853", "rtol": 1e-10, "atol": 1e-10},
    "null-space": {"integrator": "dop853", "rtol": 1e-10, "atol": 1e-10, "formulation": "null-space"},
    "nystrom4": {"integrator": ts.integrators.Nystrom4(step=1e-3)},
    "sdirk54": {"integrator": "sdirk54", "rtol": 1e-8, "atol": 1e-8},
}


def rotor(angle, rate=0.0, start=0.0, arm=0.0):
    """A wheel on a hinge along z, its centroid an arm off it, and its motor."""
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    centre = arm * np.array([np.cos(start), np.sin(start), 0.0])
    wheel = scene.add_body(
        2.0, (0.2, 0.25, J), centre, (np.cos(start / 2), 0, 0, np.sin(start / 2)),
        velocity=rate * np.cross(Z, centre), angular_velocity=(0, 0, rate), name="wheel",
    )  # fmt: skip
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=Z, name="hinge"))
    motor = scene.add(C.RotationMotor.of(hinge, angle=angle, name="motor"))
    return scene, wheel, motor


def loose(options):
    """What a fixed step's error is larger by."""
    return 1e3 if isinstance(options["integrator"], ts.integrators.Nystrom4) else 1.0


def held(solution):
    """Constraint errors at rounding, on all three levels."""
    solution.raise_if_failed()
    error = solution.constraint_error
    assert error.position.max() < 200 * EPS * (1.0 + np.abs(solution.q).max())
    assert error.velocity.max() < 2e3 * EPS * (1.0 + np.abs(solution.qd).max())
    assert error.acceleration.max() < 2e4 * EPS * (1.0 + np.abs(solution.qdd).max())


def turn(solution, body, axis=2):
    """The angle of a body about z, from its matrix."""
    first = solution.rotation(body)[:, :, 0]
    return np.arctan2(first[:, 1], first[:, 0])


def apart(angle, other):
    """The difference of angles, nearest to zero."""
    return np.abs(np.angle(np.exp(1j * (np.asarray(angle) - other))))


def slider(motion):
    scene = ts.Scene()
    block = scene.add_body(2.0, (0.1, 0.1, 0.1), velocity=(0.0, 0.0, 0.6), name="block")
    joint = scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=Z, name="guide"))
    return scene, block, scene.add(C.TranslationMotor.of(joint, displacement=motion, name="drive"))


def pair(ratio, carrier_rate=None):
    """Two wheels on the ground, or on a carrier that turns about z."""
    scene = ts.Scene(gravity=(0, 0, 0))
    base = scene.ground
    if carrier_rate is not None:
        base = scene.add_body(1.0, (0.1, 0.1, 0.2), angular_velocity=(0, 0, carrier_rate), name="carrier")
        scene.add(C.Revolute.at(scene.ground, base, point=(0, 0, 0), axis=Z, name="main"))
    spin = carrier_rate or 0.0
    one = scene.add_body(1.0, (0.1, 0.1, 0.02), angular_velocity=(0, 0, 5.0 + spin), name="one")
    other = scene.add_body(
        2.0, (0.1, 0.1, 0.05), (0.3, 0.1, 0), velocity=np.cross((0, 0, spin), (0.3, 0.1, 0)),
        angular_velocity=(0, 0, 5.0 * ratio + spin), name="other",
    )  # fmt: skip
    scene.add(C.Revolute.at(base, one, point=(0, 0, 0), axis=Z, name="first"))
    scene.add(C.Revolute.at(base, other, point=other.position, axis=Z, name="second"))
    gear = scene.add(C.Gear.at(one, other, point_a=one.position, point_b=other.position, axis=Z, ratio=ratio, name="g"))
    return scene, one, other, gear


def everything():
    """Motors, a point led, a screw, a rack and gears, loosely coupled by springs."""
    scene, one, other, _ = pair(-0.6)
    scene.gravity = (0.5, -1.0, -9.81)
    screw = scene.add_body(1.0, (0.02, 0.02, 0.01), (1.0, 0.0, 0.2), name="screw")
    scene.add(C.Screw.at(scene.ground, screw, point=screw.position, axis=Z, lead=0.1, name="thread"))
    crank = scene.add_body(1.0, (0.02, 0.02, 0.01), (1.0, 1.0, 0.0), angular_velocity=(0, 0, 4.0), name="crank")
    hinge = scene.add(C.Revolute.at(scene.ground, crank, point=crank.position, axis=Z, name="hinge"))
    scene.add(C.RotationMotor.of(hinge, angle=M.Ramp(0.0, 4.0) + M.Exponential(0.0, 1.0), name="motor"))
    arm = scene.add_body(0.5, (0.02, 0.01, 0.02), (1.0, 1.3, 0.0), velocity=(0.0, 0.0, 0.0), name="arm")
    path = (1.0, M.Sine(0.1, 2.0, 0.0, 1.3), M.Polynomial((0.0, 0.0, 0.2)))
    arm.velocity = (0.0, 0.2, 0.0)
    scene.add(C.PointDriver(scene.ground, arm, path=path, name="led"))
    link = ts.forces.Spring
    scene.add(link(arm, crank, point_a=(0.2, 0, 0), point_b=(0.3, 0, 0.1), stiffness=20.0, damping=0.5))
    scene.add(link(screw, one, point_a=(0.1, 0, 0), point_b=(0.1, 0, 0.1), stiffness=10.0))
    scene.add(link(screw, other, point_a=(0.1, 0.1, 0), point_b=(0.1, 0, 0.1), stiffness=10.0))
    return scene
