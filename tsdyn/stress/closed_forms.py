"""Runs with closed forms, where a method may be wrong without a word: laws that end series, scales, ratios, rest.

A `ClosedForm` gives the error of what is measured, and how large it may be. `tsdyn stress` runs all of them beside the
gallery.
"""

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from .. import constraints, forces, shapes
from ..errors import TsdynError
from ..simulation.load import load
from ..simulation.prepared_run import simulate
from ..simulation.scene import Scene

ROBOT = """<robot name="pair"><link name="base"/>{links}
<joint name="one" type="continuous"><parent link="base"/><child link="a"/>
<origin xyz="0 0.1 0"/><axis xyz="0 0 1"/></joint>
<joint name="two" type="continuous"><parent link="base"/><child link="b"/>
<origin xyz="0 -0.1 0"/><axis xyz="0 0 1"/>
<mimic joint="one" multiplier="-1" offset="0.5"/></joint></robot>"""
LINK = """<link name="{}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""


class ClosedForm(NamedTuple):
    """What is measured, against what is known."""

    name: str
    error: Callable[[], float]
    allowed: float


class Measured(NamedTuple):
    """The error of a `ClosedForm`; NaN, with the reason, where it could not be measured."""

    name: str
    error: float
    allowed: float
    message: str = ""

    @property
    def holds(self):
        """Whether the error is as small as it must be."""
        return bool(self.error <= self.allowed)


def _through_the_anchor():
    """A mass on a spring of length l0 falls through the anchor from x0: at twice the time to it, it rests at -x0."""
    x0, l0, w = 1.5, 0.5, math.sqrt(30.0)
    scene = Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0, position=(x0, 0, 0))
    scene.add(forces.Spring(scene.ground, mass, stiffness=w * w, free_length=l0))
    whole = 2.0 * math.acos(-l0 / (x0 - l0)) / w
    return abs(simulate(scene, (0.0, whole)).position(mass)[-1, 0] + x0)


def _wire():
    """The torsion of a wire: sqrt(k / J)."""
    radius, mass, stiffness = 0.25e-3, 1.5e-3, 1e-5
    scene = Scene(gravity=(0, 0, 0))
    wire = scene.add_body(**shapes.cylinder(radius, 1.0, axis="z", mass=mass))
    scene.add(constraints.Revolute.at(scene.ground, wire, point=(0, 0, 0), axis=(0, 0, 1)))
    x = (1.0, 0.0, 0.0)
    scene.add(
        forces.TorsionalSpring(scene.ground, wire, axis_a=(0, 0, 1), reference_a=x, reference_b=x, stiffness=stiffness)
    )
    right = math.sqrt(stiffness / (0.5 * mass * radius**2))
    return abs(np.abs(scene.linearise().eigenvalues()).max() / right - 1.0)


def _light_rod():
    """Degrees of freedom of a heavy bob welded to a light rod on a pin: one."""
    scene = Scene()
    rod = scene.add_body(1e-7, (1e-11, 1e-7, 1e-7), position=(1, 0, 0))
    bob = scene.add_body(1000.0, (100, 100, 100), position=(2, 0, 0))
    scene.add(constraints.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(constraints.Fixed.at(rod, bob, point=(2, 0, 0)))
    return abs(scene.mobility().degrees_of_freedom - 1)


def _electron():
    """A fall from rest through 1e-6 m at 1.76e20 m/s^2: sqrt(2 d / a), relative."""
    d, a = 1e-6, 1.76e20
    scene = Scene(gravity=(a, 0, 0))
    scene.add_point_mass(1.0, name="mass")
    right = math.sqrt(2.0 * d / a)
    found = simulate(scene, (0.0, 1.5 * right), events=lambda t, state: state.position("mass")[0] - d)
    return abs(found.t_events[0][0] / right - 1.0)


def _mimic():
    """A joint of a URDF that mimics another: angle = 0.5 - that of the other."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "pair.urdf"
        path.write_text(ROBOT.format(links=LINK.format("a") + LINK.format("b")))
        scene = load(path)
    scene.set("one", rate=0.7)
    found = simulate(scene, (0.0, 1.0))
    return np.abs(found.angle("two") - 0.5 + found.angle("one")).max()


def _motor():
    """A hinge whose motor is at one and a half turns."""
    scene = Scene()
    arm = scene.add_body(1.0, (0.01, 0.1, 0.1), position=(0.5, 0, 0))
    hinge = scene.add(constraints.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(constraints.RotationMotor.of(hinge, angle=3.0 * math.pi))
    scene.assemble()
    return abs(simulate(scene, (0.0, 0.1)).angle(hinge)[-1] - 3.0 * math.pi)


def _pulse():
    """The velocity that a force of 1 N gives 1 kg within 0.1 s of 100 s."""
    scene = Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0)
    scene.add(forces.PointForce(mass, force=lambda t: (1.0 if 50.0 < t < 50.1 else 0.0, 0.0, 0.0)))
    return abs(simulate(scene, (0.0, 100.0)).velocity(mass)[-1, 0] - 0.1)


def _bump():
    """The velocity of 1 kg behind a potential of 0.3 J, a thousandth of the way wide, by two methods."""

    def push(t, state):
        return (168.5 * np.exp(-(((state[0] - 0.5) / 1e-3) ** 2)), 0.0, 0.0)

    scene = Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0, velocity=(1.0, 0, 0))
    scene.add(forces.PointForce(mass, force=push))
    right = math.sqrt(1.0 + 2.0 * 168.5 * 1e-3 * math.sqrt(math.pi))
    found = [simulate(scene, (0.0, 1.0), integrator=method) for method in ("dop853", "taylor")]
    return max(abs(each.velocity(mass)[-1, 0] - right) for each in found)


def _block():
    """The way of a block on a slope of 10 degrees whose friction holds it, in 100 s."""
    turned = Rotation.from_rotvec((0, math.radians(10.0), 0))
    scene = Scene()
    block = scene.add_body(3.0, (0.01, 0.01, 0.01), orientation=turned)
    slide = constraints.Translational.at(scene.ground, block, point=(0, 0, 0), axis=turned.apply((1, 0, 0)))
    scene.add(forces.TranslationalFriction(scene.add(slide), kinetic=0.5))
    return abs(simulate(scene, (0.0, 100.0)).displacement(slide)[-1])


def _stiff():
    """Steps of the default method over those of Radau, for a rod on a bushing of 1e12 N/m."""
    scene = Scene()
    rod = scene.add_body(1.0, (1e-3, 1 / 12, 1 / 12), position=(0.5, 0, 0))
    stiffness = {"stiffness": 1e12, "torsional_stiffness": (1e12, 0, 1e12), "damping": 1e3}
    scene.add(forces.Bushing.at(scene.ground, rod, point=(0, 0, 0), **stiffness))
    found = [simulate(scene, (0.0, 0.4), integrator=method, max_steps=100_000) for method in (None, "radau")]
    return found[0].stats.steps / found[1].stats.steps


def _open_loop():
    """The rocker of a four-bar by the law of cosines: drawn along one line, the loop open, its crank set to 1.1 rad."""
    crank, coupler, rocker, base, angle = 0.3, 0.9, 0.7, 0.8, 1.1
    scene, R = Scene(), constraints.Revolute
    links = [
        scene.add_body(1.0, (0.01, 0.1, 0.1), position=(start + length / 2, 0, 0))
        for start, length in ((0.0, crank), (crank, coupler), (base, rocker))
    ]
    bearing = scene.add(R.at(scene.ground, links[0], point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(R.at(links[0], links[1], point=(crank, 0, 0), axis=(0, 0, 1)))
    far = scene.add(R.at(scene.ground, links[2], point=(base, 0, 0), axis=(0, 0, 1)))
    ends = {"point_a": (coupler / 2, 0, 0), "point_b": (rocker / 2, 0, 0)}
    scene.add(R(links[1], links[2], **ends, axis_a=(0, 0, 1), axis_b=(0, 0, 1)))
    scene.assemble(joints={bearing: angle})
    x, y = crank * math.cos(angle) - base, crank * math.sin(angle)
    bent = math.acos((rocker**2 + x * x + y * y - coupler**2) / (2.0 * rocker * math.hypot(x, y)))
    found = simulate(scene, (0.0, 1e-9)).angle(far)[0]
    return min(abs(math.remainder(found - math.atan2(y, x) - side * bent, 2.0 * math.pi)) for side in (1, -1))


CLOSED_FORMS = (
    ClosedForm("through the anchor of a spring (m)", _through_the_anchor, 1e-6),
    ClosedForm("torsion of a wire, relative", _wire, 1e-9),
    ClosedForm("freedom of a light rod under a heavy bob", _light_rod, 0.0),
    ClosedForm("an event within 1e-13 s, relative", _electron, 1e-12),
    ClosedForm("a joint that mimics another with an offset (rad)", _mimic, 1e-12),
    ClosedForm("a motor of a hinge at one and a half turns (rad)", _motor, 1e-12),
    ClosedForm("a pulse of a thousandth of the run (m/s)", _pulse, 1e-6),
    ClosedForm("past a bump of a thousandth of the way (m/s)", _bump, 1e-6),
    ClosedForm("a block at rest on a slope, 100 s (m)", _block, 1e-6),
    ClosedForm("a four-bar that was drawn along one line (rad)", _open_loop, 1e-12),
    ClosedForm("steps on a bushing of 1e12 N/m, over those of Radau", _stiff, 3.0),
)


def measured(form):
    """The `Measured` of a closed form."""
    try:
        return Measured(form.name, float(form.error()), form.allowed)
    except (TsdynError, IndexError) as error:
        return Measured(form.name, math.nan, form.allowed, f"{type(error).__name__}: {error}")
