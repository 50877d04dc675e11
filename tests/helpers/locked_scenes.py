"""Scenes with bodies that never turn: sliders, slides on slides, what is welded, what is held at angles."""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

C, F = ts.constraints, ts.forces
X, Y, Z = np.eye(3)


def block(scene, position=(0.0, 0.0, 0.0), turn=0.0, **motion):
    """A body that stands askew, so that nothing is along its own axes."""
    orientation = Rotation.from_rotvec(turn * np.array([1.0, -2.0, 0.5]))
    inertia = np.array([[0.05, 0.01, 0.0], [0.01, 0.07, 0.005], [0.0, 0.005, 0.04]])
    return scene.add_body(1.5, inertia, position, orientation, **motion)


def slider_crank(planar=False):
    """Planar: three hinges in a row, and so three rows too many."""
    scene = ts.Scene()
    crank = block(scene, (0.1, 0.0, 0.0), 0.0, velocity=(0.0, 0.0, 0.3), angular_velocity=(0.0, -3.0, 0.0))
    rod = block(scene, (0.45, 0.0, 0.0), 0.0, velocity=(0.0, 0.0, 0.3), angular_velocity=(0.0, 1.2, 0.0))
    slider = block(scene, (0.7, 0.1, 0.0), 0.4)
    scene.add(C.Revolute.at(crank, scene.ground, point=(0.0, 0.0, 0.0), axis=Y))
    if planar:
        scene.add(C.Revolute.at(crank, rod, point=0.2 * X, axis=Y))
        scene.add(C.Revolute.at(rod, slider, point=0.7 * X, axis=Y))
    else:
        scene.add(C.Spherical.at(crank, rod, point=0.2 * X))
        scene.add(C.Universal.at(rod, slider, point=0.7 * X, axis=Z, axis_b=Y))
    scene.add(C.Translational.at(slider, scene.ground, point=0.7 * X, axis=X))
    scene.add(F.Spring(scene.ground, slider, point_a=(1.0, 0.3, 0.2), point_b=(0.1, 0.1, 0.0), stiffness=80.0))
    return scene


def slides():
    """Three slides on each other, askew, the last with a pendulum; between them a hinge's rows of the same kind."""
    scene = ts.Scene()
    before = scene.ground
    for i, axis in enumerate(([1.0, 0.2, 0.0], [0.0, 1.0, 0.3], [0.2, 0.0, 1.0])):
        body = block(scene, (0.2 * i, 0.1, 0.1 * i), 0.3 * i + 0.1)
        pair = (body, before) if i % 2 else (before, body)
        scene.add(C.Translational.at(*pair, point=body.position + 0.1, axis=axis))
        scene.add(F.Spring(before, body, point_b=(0.1, 0.0, 0.2), stiffness=200.0, damping=1.0))
        if i == 1:
            turn = Rotation.from_quat(body.orientation, scalar_first=True)
            place = body.position + turn.apply((0.1, 0.0, 0.0))
            fly = block(scene, place, 0.3 * i + 0.1, angular_velocity=(0.0, 0.0, 2.0))
            scene.add(C.Revolute(body, fly, point_a=(0.1, 0.0, 0.0), axis_a=Z, axis_b=Z))
        before = body
    bob = block(scene, before.position + np.array([0.3, 0.0, -0.4]), 0.5)
    scene.add(C.Spherical.at(before, bob, point=before.position + 0.05))
    return scene


def welded():
    """A plate on the ground, a bracket on a slide, a pendulum on each, and a rope between the pendulums."""
    scene = ts.Scene()
    plate, slide = block(scene, (0.0, 0.0, 0.5), 0.7), block(scene, (1.0, 0.0, 0.5), 0.2)
    bracket = block(scene, (1.1, 0.0, 0.4), 1.0)
    scene.add(C.Fixed.at(plate, scene.ground))
    scene.add(C.Translational.at(scene.ground, slide, point=slide.position, axis=X))
    scene.add(C.Fixed.at(slide, bracket))
    scene.add(F.Spring(scene.ground, slide, stiffness=60.0, free_length=0.9))
    bobs = [block(scene, body.position + np.array([0.2, 0.0, -0.5]), 0.3) for body in (plate, bracket)]
    for body, bob in zip((plate, bracket), bobs, strict=True):
        scene.add(C.Revolute.at(body, bob, point=body.position, axis=Y))
    scene.add(F.Spring(*bobs, point_a=(0.0, 0.1, 0.0), stiffness=20.0))
    return scene


def floating():
    """Held parallel, and at an angle, but free to fly: on springs; and a second one at three angles to the first."""
    scene = ts.Scene()
    one, two = block(scene, (0.0, 0.0, 1.0), 0.3), block(scene, (1.0, 0.0, 1.0), 0.9, velocity=(0.0, 0.4, 0.0))
    scene.add(C.Parallel.at(one, scene.ground, axis=(1.0, 2.0, 3.0)))
    turn = [Rotation.from_quat(body.orientation, scalar_first=True) for body in (one, two)]
    scene.add(C.Dot1(scene.ground, one, axis_a=X, axis_b=Z, value=float(X @ turn[0].apply(Z))))
    for u, v in ((X, Y), (Y, Z), (Z, X)):
        scene.add(C.Dot1(one, two, axis_a=u, axis_b=v, value=float(turn[0].apply(u) @ turn[1].apply(v))))
    scene.add(F.Spring(scene.ground, one, point_b=(0.3, 0.1, 0.0), stiffness=90.0))
    scene.add(F.Spring(one, two, point_a=(0.0, 0.1, 0.0), point_b=(0.3, 0.1, 0.2), stiffness=70.0, damping=0.5))
    scene.add(F.Torque(two, torque=(1.0, 2.0, 3.0)))
    return scene


def rails():
    """A carriage on two rails, five rows too many, and a bob on it; and a body that is welded on twice."""
    scene = ts.Scene()
    carriage = block(scene, (0.0, 0.0, 1.0), 0.3, velocity=(1.0, 0.0, 0.0))
    for side in (-0.5, 0.5):
        scene.add(C.Translational.at(scene.ground, carriage, point=(0.0, side, 1.0), axis=X))
    bob = block(scene, (0.3, 0.1, 0.5), 0.3, velocity=(1.0, 0.0, 0.0))
    scene.add(C.Spherical.at(carriage, bob, point=(0.0, 0.0, 1.0)))
    load = block(scene, (0.0, 0.3, 1.4), 0.8, velocity=(1.0, 0.0, 0.0))
    for point in ((0.0, 0.0, 1.2), (0.0, 0.4, 1.2)):
        scene.add(C.Fixed.at(carriage, load, point=point))
    return scene


def hub(legs=20):
    """A slide with so many pendulums that its rows are cut into parts."""
    scene = ts.Scene()
    slide = block(scene, (0.0, 0.0, 0.0), 0.6)
    scene.add(C.Translational.at(scene.ground, slide, point=(0.0, 0.0, 0.1), axis=(1.0, 0.5, 0.0)))
    for i in range(legs):
        angle = 2.0 * np.pi * i / legs
        place = np.array([np.cos(angle), np.sin(angle), 0.0])
        bob = block(scene, 1.2 * place - 0.3 * Z, 0.1 * i)
        scene.add(C.Spherical.at(slide, bob, point=place))
    return scene


def driven():
    """A slide on a motor; on it another, and a table that a motor turns, with a slide on it: that one turns."""
    scene = ts.Scene()
    first, second = block(scene, (0.0, 0.0, 0.0), 0.3), block(scene, (0.0, 0.3, 0.0), 0.8)
    rail = scene.add(C.Translational.at(scene.ground, first, point=(0.0, 0.0, 0.0), axis=X))
    scene.add(C.TranslationMotor.of(rail, displacement=0.2 * np.sin(2.0 * ts.motions.time) ** 2))
    scene.add(C.Translational.at(first, second, point=second.position, axis=Y))
    scene.add(F.Spring(first, second, stiffness=90.0, free_length=0.25))
    table, load = block(scene, (0.0, 0.0, 0.5), 0.0), block(scene, (0.4, 0.0, 0.5), 0.2)
    hinge = scene.add(C.Revolute.at(first, table, point=table.position, axis=Z))
    scene.add(C.RotationMotor.of(hinge, angle=ts.motions.time**2))
    scene.add(C.Translational.at(table, load, point=load.position, axis=X))
    scene.add(F.Spring(table, load, stiffness=50.0))
    return scene


SCENES = {  # how many bodies never turn
    "slider-crank": (slider_crank, 1),
    "planar slider-crank": (lambda: slider_crank(planar=True), 1),
    "slides": (slides, 3),
    "welded": (welded, 3),
    "floating": (floating, 2),
    "rails": (rails, 2),
    "hub": (hub, 1),
    "driven": (driven, 2),
}
