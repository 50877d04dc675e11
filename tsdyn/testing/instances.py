"""Instances of a class of constraints or forces in scenes of two bodies that move at random."""

import numpy as np

from ..simulation.scene import Scene

ARRANGEMENTS = ("body to body", "body to ground", "ground to body")


def instances(make, rng, states):
    """Yield (scene, instance, arrangement); make(a, b, alone) returns None where an arrangement means nothing.

    alone is True where one of a and b is the ground.
    """
    for arrangement in ARRANGEMENTS:
        for _ in range(states):
            scene = Scene()
            one, two = (_body(scene, rng, name) for name in ("one", "two"))
            a = scene.ground if arrangement == "ground to body" else one
            b = scene.ground if arrangement == "body to ground" else two
            instance = make(a, b, arrangement != "body to body")
            if instance is not None:
                yield scene, scene.add(instance), arrangement


def _body(scene, rng, name):
    r, p = rng.normal(size=3), rng.normal(size=4)
    return scene.add_body(1.0, (1.0, 1.1, 1.2), position=r, orientation=p / np.linalg.norm(p), name=name)
