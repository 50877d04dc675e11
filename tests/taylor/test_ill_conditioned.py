"""Unequal masses cost the Schur complement its digits: accelerations satisfy their constraints all the same."""

import numpy as np
import pytest

import tsdyn as ts

C = ts.constraints


def chain(masses):
    """Rods of 1 m on revolute joints whose axes alternate, released from horizontal."""
    scene = ts.Scene()
    last = scene.ground
    for i, mass in enumerate(masses):
        body = scene.add_body(mass, np.array((0.02, 0.1, 0.1)) * mass, position=(i + 0.5, 0.0, 0.0))
        axis = (0.0, 1.0, 0.0) if i % 2 == 0 else (0.0, 0.6, 0.8)
        scene.add(C.Revolute.at(last, body, point=(i, 0.0, 0.0), axis=axis))
        last = body
    return scene


@pytest.mark.parametrize("ratio", [1e4, 1e7, 1e10])
def test_light_bodies_between_heavy_ones(ratio):
    """The heaviest hangs on the lightest: elimination alone loses as many digits as the ratio has."""
    solution = ts.simulate(chain((1.0, 1.0 / ratio, 1.0)), (0.0, 0.5)).raise_if_failed()
    size = np.abs(solution.qdd).max()
    assert solution.constraint_error.acceleration.max() < 1e-12 * size
    assert solution.stats.rejected < 20
    assert np.ptp(solution.energy) < 1e-6 * np.abs(solution.potential_energy).max()
