"""Runs of fixed steps over scenes of every kind, and when two of them are the same."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.calls import PARTS
from tests.helpers.reference import load
from tests.helpers.scenes import build, random_chain, random_pair

FORMULATIONS = ("tangent", "null-space", "maggi-kane")
STEP = 1 / 256  # s; a power of two, so that times of steps are exact


def run(scene, span, step=STEP, **options):
    integrator = ts.integrators.Nystrom4(step=step)
    return ts.simulate(scene, span, integrator=integrator, **options).raise_if_failed()


def same(one, two, names=PARTS):
    for name in names:
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name), err_msg=name)


def same_history(one, two):
    for a, b in zip((*one.steps, *one.charts, *one.state), (*two.steps, *two.charts, *two.state), strict=True):
        np.testing.assert_array_equal(a, b)


SCENES = {
    "sliding_top": lambda: load("sliding_top")[0],
    "spatial": lambda: load("two_body_pendulum_spatial")[0],
    "chain": lambda: build(random_chain(np.random.default_rng(1), 3)),
    "driven": lambda: assembled(random_pair(np.random.default_rng(2), "Distance, driven", "body to ground")),
}
scenes = pytest.mark.parametrize("make", SCENES.values(), ids=SCENES.keys())
formulations = pytest.mark.parametrize("formulation", FORMULATIONS)


def assembled(definition):
    scene = build(definition)
    scene.assemble()
    return scene


def rows(solution, which):
    return type("Rows", (), {name: getattr(solution, name)[which] for name in PARTS})
