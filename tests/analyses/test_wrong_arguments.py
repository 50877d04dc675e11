"""What a newcomer gives by mistake to `equilibrium`, `linearise` and `inverse_dynamics`, and what is said then."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.hanging_chains import pendulums

TIMES = np.linspace(0.0, 1.0, 5)
SINE = ts.motions.Sine(0.3, 2.0)


def run(scene):
    return ts.simulate(scene, (0.0, 0.1))


def driven(motion):
    return lambda scene: scene.inverse_dynamics(motion, ["pin 0"], TIMES)


CASES = {
    "a dict of angles": (lambda scene: scene.equilibrium({"pin 0": 0.3}), r"scene\.set\(joint, \.\.\.\) places joints"),
    "a solution as guess": (lambda scene: scene.equilibrium(run(scene)), r"give the \.state of <Solution"),
    "zeros as guess": (lambda scene: scene.equilibrium(np.zeros(7)), r"link 0 \(q\[3:7\]\) are zero.*no orientation"),
    "about alone": (lambda scene: scene.equilibrium(about=(1, 0, 0)), "give spin=, too"),
    "about of two": (lambda scene: scene.equilibrium(about=(1, 0)), "about .* must be three finite numbers"),
    "a word as rate": (
        lambda scene: scene.equilibrium(rotors={"link 0": "fast"}),
        r"the rate of link 0 must be a number .*got 'fast'",
    ),
    "an equilibrium as state": (
        lambda scene: scene.linearise(scene.equilibrium()),
        r"give the \.state of <Equilibrium",
    ),
    "a solution as state": (lambda scene: scene.linearise(run(scene)), r"give the \.state of <Solution"),
    "a component of a joint": (
        lambda scene: scene.linearise(inputs=["pin 0.x"]),
        "'pin 0' has no component 'x': its input is 'pin 0.angle'",
    ),
    "an input twice": (lambda scene: scene.linearise(inputs=["pin 0", "pin 0.angle"]), "angle is given more than once"),
    "a misspelt coordinate": (
        driven({"pim 0.angle": SINE}),
        "there are 'pin 0.angle', 'link 0'; did you mean pin 0.angle",
    ),
    "a coordinate it lacks": (driven({"pin 0.displacement": SINE}), "there are 'pin 0.angle', 'link 0'"),
    "one motion of a body": (driven({"link 0": SINE}), r"must be three motions.*give 'link 0\.x'"),
    "a number for a body": (driven({"link 0": 0.5}), r"must be three motions.*got 0\.5.*give 'link 0\.x'"),
    "a function for a body": (driven({"link 0": lambda t: (t, 0.0, 0.0)}), r"must be three motions.*spline"),
    "a motion twice": (driven({"pin 0": SINE, "pin 0.angle": SINE}), "the motion of pin 0.angle is given twice"),
}


@pytest.mark.parametrize("name", CASES)
def test_mistakes_of_newcomers(name):
    call, said = CASES[name]
    with pytest.raises(ts.InvalidArgument, match=said):
        call(pendulums([0.3]))


def test_components_that_there_are_stay_inputs():
    scene = pendulums([0.3])
    scene.add(ts.forces.PointForce(scene.bodies[0], force=(1.0, 0, 0), name="push"))
    assert scene.linearise(inputs=["push.x"]).inputs == ("push.x",)
    assert scene.linearise(inputs=["pin 0"]).inputs == ("pin 0.angle",)
    assert scene.inverse_dynamics({"pin 0": SINE}, ["pin 0"], TIMES).success
