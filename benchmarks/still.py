"""Saving by locked orientations: each scene with and without rotational coordinates of its locked bodies.

Quote the ratio. Run it: python -m benchmarks.still
"""

import numpy as np

import tsdyn as ts
from benchmarks.contender import timed
from tsdyn.formulations.locked_orientations import keep_turning

C, F = ts.constraints, ts.forces
X, Y, Z = np.eye(3)
J, END, ROUNDS = (0.02, 0.03, 0.01), 2.0, 15
METHODS = {
    "Taylor, 1e-10": ts.integrators.Taylor(1e-10),
    "DOP853, 1e-9": ts.integrators.DOP853(1e-9, 1e-9),
    "Nystrom4, 1e-3 s": ts.integrators.Nystrom4(step=1e-3),
}


def slider_crank(planar=False):
    """A crank, a rod and a slider; planar: on hinges alone, three rows too many."""
    scene = ts.Scene()
    crank = scene.add_body(1.0, J, 0.1 * X, velocity=0.3 * Y, angular_velocity=3.0 * Z)
    rod = scene.add_body(1.0, J, 0.45 * X, velocity=0.3 * Y, angular_velocity=-1.2 * Z)
    slider = scene.add_body(2.0, J, 0.7 * X)
    scene.add(C.Revolute.at(crank, scene.ground, point=0.0 * X, axis=Z))
    if planar:
        scene.add(C.Revolute.at(crank, rod, point=0.2 * X, axis=Z))
        scene.add(C.Revolute.at(rod, slider, point=0.7 * X, axis=Z))
    else:
        scene.add(C.Spherical.at(crank, rod, point=0.2 * X))
        scene.add(C.Universal.at(rod, slider, point=0.7 * X, axis=Y, axis_b=Z))
    scene.add(C.Translational.at(slider, scene.ground, point=0.7 * X, axis=X))
    return scene


def slides(count):
    """Slides on slides, along x, y and z in turn, with a spring each; a bob hangs on the last."""
    scene = ts.Scene()
    before = scene.ground
    for i in range(count):
        slide = scene.add_body(1.0, J, (0.1 * i, 0.05 * i, 0.0))
        scene.add(C.Translational.at(before, slide, point=slide.position, axis=np.eye(3)[i % 3]))
        scene.add(F.Spring(before, slide, point_b=(0.05, 0.0, 0.0), stiffness=50.0))
        before = slide
    bob = scene.add_body(1.0, J, before.position + np.array([0.0, 0.3, -0.4]))
    scene.add(C.Spherical.at(before, bob, point=before.position))
    return scene


def row(count):
    """Pendulums, each on a slide of its own, coupled by springs."""
    scene = ts.Scene()
    before = None
    for i in range(count):
        slide = scene.add_body(1.0, J, 0.5 * i * X)
        bob = scene.add_body(1.0, J, 0.5 * i * X + np.array([0.2, 0.1, -0.3]))
        scene.add(C.Translational.at(scene.ground, slide, point=slide.position, axis=X))
        scene.add(C.Spherical.at(slide, bob, point=slide.position))
        if before is not None:
            scene.add(F.Spring(before, slide, stiffness=40.0))
        before = slide
    return scene


SCENES = {
    "slider-crank": slider_crank,
    "slider-crank on hinges": lambda: slider_crank(planar=True),
    "two slides and a bob": lambda: slides(2),
    "six slides and a bob": lambda: slides(6),
    "100 bobs on slides": lambda: row(100),
}


def seconds(scene, method):
    """Of a call."""
    taken, solution = timed(ts.simulate, scene, (0.0, END), integrator=method, t_eval=(0.0, END))
    solution.raise_if_failed()
    return taken


def main():
    """Print milliseconds a call, the least of interleaved rounds, with and without, and the ratio."""
    print(f"{'milliseconds a call':42} every rotation  those that turn  ratio")
    for name, build in SCENES.items():
        for label, method in METHODS.items():
            scenes = [build(), build()]
            keep_turning(scenes[0].packed, range(len(scenes[0].bodies)))
            least = [min(seconds(scene, method) for _ in range(2)) for scene in scenes]
            for _ in range(ROUNDS if max(least) < 0.5 else 2):
                least = [min(best, seconds(scene, method)) for best, scene in zip(least, scenes, strict=True)]
            whole, fewer = (1e3 * best for best in least)
            print(f"{name + ', ' + label:42} {whole:14.2f} {fewer:16.2f} {whole / fewer:6.2f}")


if __name__ == "__main__":
    main()
