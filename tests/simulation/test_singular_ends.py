"""Runs into singular configurations, and steps that are too large, end with what they have and the reason."""

import math

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.failures import (
    FORMS,
    LOST,
    Status,
    check_every_step,
    check_outputs,
    check_partial,
    pendulum,
    run,
    zero,
)
from tests.helpers.tolerances import ROUNDING

C = ts.constraints


def chain():
    """Two links and a string from the last one's end to the first one's pivot that pays out until it is all flat."""
    scene, half, middle = ts.Scene(), 0.5, math.pi / 6
    x, z = half * math.cos(middle), half * math.sin(middle)
    links = [
        scene.add_body(1.0, (0.01, 0.1, 0.1), at, (math.cos(turn / 2), 0.0, -math.sin(turn / 2), 0.0), name=name)
        for name, at, turn in (("first", (x, 0.0, z), middle), ("second", (3 * x, 0.0, z), -middle))
    ]
    first, second = links
    scene.add(C.Spherical(scene.ground, first, point_b=(-half, 0.0, 0.0), name="pivot"))
    scene.add(C.Spherical(first, second, point_a=(half, 0.0, 0.0), point_b=(-half, 0.0, 0.0), name="knee"))
    length = (lambda t: 1.7320508075688772 + 0.2 * t * t if t < 9.0 else 0.0, lambda t: 0.4 * t, lambda t: 0.4)
    scene.add(C.Distance(second, scene.ground, point_a=(half, 0.0, 0.0), length=length, name="string"))
    return scene


def two_strings():
    """A bead on two strings that are wound in until they are one straight line."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    bead = scene.add_point_mass(1.0, position=(0.0, 0.0, math.sqrt(1.25)), name="bead")
    length = (lambda t: 1.5 - 0.5 * t * t if t < 9.0 else 0.0, lambda t: -t, lambda t: -1.0)
    for x in (1.0, -1.0):
        scene.add(C.Distance(bead, scene.ground, point_b=(x, 0.0, 0.0), length=length, name=f"string at {x:g}"))
    return scene


def parallelogram():
    """A parallelogram that turns at 1 rad/s towards its dead centre, where it could also fold."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    arm, velocity = np.array([math.cos(0.5), math.sin(0.5), 0.0]), (-math.sin(0.5), math.cos(0.5), 0.0)
    pins = [scene.add_point_mass(1.0, arm + np.array([x, 0.0, 0.0]), velocity, name=f"pin {x:g}") for x in (0.0, 2.0)]
    for pin, x in zip(pins, (0.0, 2.0), strict=True):
        scene.add(C.Dot2(scene.ground, pin, axis_a=(0, 0, 1), name=f"plane of {pin.name}"))
        scene.add(C.Distance(pin, scene.ground, point_b=(x, 0.0, 0.0), name=f"crank of {pin.name}"))
    scene.add(C.Distance(*pins, name="coupler"))
    scene.add(ts.forces.PointForce(pins[0], force=lambda t: (0.0 if t < 9.0 else 1.0, 0.0, 0.0)))  # without a series
    return scene


def turntable():
    """A body turned about z by its Dot1 until the two axes are parallel."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    turn, rate = math.pi / 3, -0.4 / math.sin(math.pi / 3)
    body = scene.add_body(
        1.0, (1, 1, 1), orientation=(math.cos(turn / 2), 0, 0, math.sin(turn / 2)), angular_velocity=(0, 0, rate)
    )
    cosine = (lambda t: 0.5 + 0.4 * t if t < 9.0 else 0.0, lambda t: 0.4, zero)
    scene.add(C.Dot1(body, scene.ground, axis_a=(1, 0, 0), axis_b=(1, 0, 0), value=cosine, name="turn"))
    scene.add(C.Dot1(body, scene.ground, axis_a=(1, 0, 0), axis_b=(0, 0, 1), name="level"))
    return scene


SINGULAR = {
    "chain": (chain, math.sqrt((2.0 - math.sqrt(3.0)) / 0.2)),
    "two strings": (two_strings, 1.0),
    "parallelogram": (parallelogram, math.pi - 0.5),
    "turntable": (turntable, 1.25),
}


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("step", [1e-3, 1e-2, 1e-1])
@pytest.mark.parametrize(("build", "instant"), SINGULAR.values(), ids=SINGULAR.keys())
def test_singular_configuration(build, instant, step, formulation):
    solution = check_partial(run(build(), 2.0 * instant, step, formulation=formulation), LOST)
    check_every_step(solution)
    late = step if formulation == "maggi-kane" else 1e-9  # its q has left the constraints, and what it meets is its own
    assert solution.t[-1] <= instant + late
    assert solution.t[-1] > instant - (8.0 * step if step < 0.1 else instant)


@pytest.mark.parametrize("build", [build for build, _ in SINGULAR.values()], ids=SINGULAR.keys())
def test_singular_configuration_is_called_so(build):
    """A smaller step does not help there: the message says what does not fit any more."""
    scene = build()
    message = run(scene, 5.0, 1e-3).message
    names = [c.name for c in scene.constraints if not isinstance(c, C.EulerNormalization)]
    assert any(name in message for name in names), message


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("build", [build for build, _ in SINGULAR.values()], ids=SINGULAR.keys())
def test_singular_configuration_with_t_eval(build, formulation):
    times = np.linspace(0.0, 5.0, 301)
    solution = check_partial(run(build(), 5.0, 1e-2, formulation=formulation, t_eval=times), LOST)
    check_outputs(solution, times)


class Fading(ts.Primitive):
    """A height that is held until t = 0.505 and then forgotten: the row of Phi_q is zero from there on."""

    rows = 1
    markers = (ts.Point("a"),)

    def __init__(self, a, *, name=""):
        super().__init__(a, None, ((0.0, 0.0, 0.0),), name)
        self.weight = ts.Motion(lambda t: 1.0 if t < 0.505 else 0.0, zero, zero, name)

    def parameters(self):
        return (self.weight,)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = par[0] * x[2]

    @staticmethod
    def jacobian(x, par, t, out):
        out[0, 2] = par[0]

    @staticmethod
    def phi_t(x, par, t, out):
        out[0] = par[1] * x[2]

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = 2.0 * par[1] * xd[2] + par[2] * x[2]


@pytest.mark.slow
@pytest.mark.parametrize("formulation", FORMS)
def test_lost_rank(formulation):
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, velocity=(1.0, 0.0, 0.0), name="bead")
    scene.add(Fading(bead, name="fading"))
    scene.add(C.Dot2(scene.ground, bead, axis_a=(0, 1, 0), name="lane"))
    solution = check_partial(run(scene, 1.0, 1e-2, formulation=formulation), {Status.SINGULAR})
    check_every_step(solution)
    assert solution.t[-1] == pytest.approx(0.5)


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize(("spin", "step"), [(0.0, 1.0), (0.0, 2.0), (0.0, 5.0), (30.0, 0.1), (30.0, 0.5), (300.0, 0.1)])
def test_step_far_too_large(spin, step, formulation):
    solution = check_partial(run(pendulum(spin), 5.0, step, formulation=formulation), LOST)
    check_every_step(solution)
    assert "smaller step" in solution.message
    assert run(pendulum(spin), 0.05, 1e-4, formulation=formulation).success


@pytest.mark.parametrize("formulation", FORMS)
def test_newton_fails_at_once(formulation):
    scene = ts.Scene()
    body = scene.add_body(1.0, (1.0, 2.0, 2.5), angular_velocity=(1.0, 30.0, 2.0))
    times = np.array([0.0, 0.3, 2.0])
    solution = check_partial(run(scene, 2.0, 0.2, formulation=formulation, t_eval=times), LOST)
    check_outputs(solution, times)
    assert solution.stats.steps == 0
    np.testing.assert_array_equal(solution.state.q, body.q)
    np.testing.assert_allclose(solution.angular_velocity(body)[-1], body.angular_velocity, atol=ROUNDING)
