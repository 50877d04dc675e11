"""Results don't depend on units, on place and pose of the ground frame, on the order of bodies, on the sign of p."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.tolerances import ALGEBRA, TIGHT

C, I = ts.constraints, ts.integrators
END = 1.5
FRAMES = {
    "another place": {"origin": (3.0, -7.0, 11.0)},
    "another pose": {"pose": Rotation.from_rotvec([0.7, -0.4, 1.1])},
    "mm, g, ms": {"metre": 1e3, "kilogram": 1e3, "second": 1e3},
    "km, t, min": {"metre": 1e-3, "kilogram": 1e-3, "second": 1.0 / 60.0},
    "um, mg, s": {"metre": 1e6, "kilogram": 1e6},
    "another order": {"order": (2, 0, 1)},
    "another sign": {"sign": -1.0},
}
METHODS = {
    "taylor": lambda second: I.Taylor(step=0.02 * second),
    "dop853": lambda second: I.DOP853(1e-12, 1e-12),
    "nystrom4": lambda second: I.Nystrom4(step=5e-3 * second),
    "sdirk54": lambda second: I.SDIRK54(step=0.01 * second),
    "implicit_trapezoid": lambda second: I.ImplicitTrapezoid(step=0.01 * second),
}
ERRORS = dict.fromkeys(METHODS, ALGEBRA) | {"dop853": TIGHT}  # fixed steps differ by rounding, tolerances by these


def build(metre=1.0, kilogram=1.0, second=1.0, origin=(0.0, 0.0, 0.0), pose=None, order=(0, 1, 2), sign=1.0):
    """Three rods, one of them on a spring and a damper; the arguments say how many units there are in one of SI."""
    pose = pose or Rotation.identity()
    x, y, z, w = pose.as_quat()

    def place(*point):
        return np.array(origin) + pose.apply(point) * metre

    scene = ts.Scene(gravity=pose.apply([0.0, 0.0, -9.81]) * metre / second**2)
    rods = {}
    for i in order:
        inertia = np.array((0.1, 0.2, 0.25)) * kilogram * metre**2
        given = {"position": place(0.5 + i, 0.0, 0.0), "orientation": sign * np.array([w, x, y, z])}
        rods[i] = scene.add_body((1 + i) * kilogram, inertia, name=f"rod {i}", **given)
    joints = [
        C.Spherical.at(rods[0], scene.ground, point=place(0.0, 0.0, 0.0)),
        C.Spherical.at(rods[0], rods[1], point=place(1.0, 0.0, 0.0)),
        C.Revolute.at(rods[1], rods[2], point=place(2.0, 0.0, 0.0), axis=pose.apply([0.0, 1.0, 0.0])),
    ]
    for i in order:
        scene.add(joints[i])
    law = {"stiffness": 20.0 * kilogram / second**2, "damping": 0.1 * kilogram / second, "free_length": metre}
    scene.add(ts.forces.Spring(rods[2], scene.ground, point_b=place(3.0, 1.0, 0.5), **law))
    return scene


def positions(method, second=1.0, metre=1.0, origin=(0.0, 0.0, 0.0), pose=None, formulation="tangent", **others):
    """Of the rods, in SI and in the frame of the scene as it was drawn."""
    scene = build(metre=metre, second=second, origin=origin, pose=pose, **others)
    times = np.linspace(0.0, END * second, 16)
    given = {"integrator": METHODS[method](second), "formulation": formulation}
    solution = ts.simulate(scene, (0.0, times[-1]), t_eval=times, **given)
    solution.raise_if_failed()
    back = (pose or Rotation.identity()).inv()
    found = [back.apply(solution.position(f"rod {i}") - np.array(origin)) / metre for i in range(3)]
    return np.array(found)


@pytest.mark.slow_for("*sdirk54", "*implicit*")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_the_motion_is_the_same(frame, method):
    np.testing.assert_allclose(positions(method, **frame), positions(method), rtol=0.0, atol=ERRORS[method])


@pytest.mark.slow_for("*maggi*")
@pytest.mark.parametrize("formulation", ["null-space", "maggi-kane"])
@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_forms_with_a_basis_give_the_same_motion(frame, formulation):
    found, demanded = (positions("nystrom4", formulation=formulation, **where) for where in (frame, {}))
    np.testing.assert_allclose(found, demanded, rtol=0.0, atol=ALGEBRA)


def test_a_sign_changes_no_bit():
    np.testing.assert_array_equal(positions("taylor", sign=-1.0), positions("taylor"))


def test_far_away_only_digits_of_positions_are_lost():
    """A coordinate of 1e6 m has digits down to 1.2e-10 m."""
    far = positions("taylor", origin=(1e6, -7e5, 1.1e6))
    np.testing.assert_allclose(far, positions("taylor"), rtol=0.0, atol=2.0 * np.spacing(1.1e6))


def test_small_mechanisms_are_held_as_closely_as_large_ones():
    """Energy of links of a micrometre."""
    metre = 1e-6
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
    rods = [
        scene.add_body(1e-9, np.array((1.0, 1.0, 0.1)) * 1e-9 * metre**2, position=((0.5 + i) * metre, 0.0, 0.0))
        for i in range(3)
    ]
    for i, rod in enumerate(rods):
        scene.add(C.Spherical.at(rod, rods[i - 1] if i else scene.ground, point=(i * metre, 0.0, 0.0)))
    solution = ts.simulate(scene, (0.0, 1e-3), integrator=I.DOP853(1e-10, 1e-16)).raise_if_failed()
    assert np.ptp(solution.energy) <= TIGHT * solution.kinetic_energy.max()
