"""Instances of a class of constraints or forces in scenes of two bodies that move at random."""

import numpy as np

from ..elements.force import Force
from ..elements.joint import Joint
from ..elements.primitive import Primitive
from ..errors import InvalidArgument
from ..methods.integrator import Integrator
from ..simulation.scene import Scene

ARRANGEMENTS = ("body to body", "body to ground", "ground to body")
CHECKS = {Primitive: "check_primitive", Joint: "check_primitive", Force: "check_force", Integrator: "check_integrator"}


def demand_kind(item, bases):
    """Refuse a class or an instance that another check is for."""
    kind = item if isinstance(item, type) else type(item)
    for base, check in CHECKS.items():
        if issubclass(kind, base) and not issubclass(kind, bases):
            raise InvalidArgument(
                f"{kind.__name__} is a subclass of ts.{base.__name__}: use ts.testing.{check}({kind.__name__})."
            )


def maker(kind, bases, error, example):
    """Make the `make` of `instances`: of a class by example(a, b), or a callable (a, b)."""
    demand_kind(kind, bases)

    def make(a, b, alone):
        if isinstance(kind, type) and issubclass(kind, bases):
            single = not any(marker.body == "b" for marker in kind.markers)
            return None if single and alone else example(a, b)
        if not callable(kind):
            raise InvalidArgument(
                f"a check needs a {bases[0].__name__} class or a callable (a, b) that makes one, got {kind!r}."
            )
        try:
            made = kind(a, b)
        except error:
            if alone:
                return None
            raise
        demand_kind(made, bases)
        if not isinstance(made, bases):
            raise InvalidArgument(f"a check needs what makes a {bases[0].__name__}; {kind!r} made {made!r}.")
        return None if alone and made.b is None else made

    return make


def instances(make, rng, states):
    """Yield (scene, instance, arrangement); make(a, b, alone) returns None for an arrangement without meaning.

    alone is True if one of a and b is the ground.
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
