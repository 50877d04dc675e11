"""What `tsdyn compile` leaves to later runs: nothing that scenes of the built-in kinds need by the default method."""

import subprocess
import sys

import pytest

from tests.helpers.processes import ROOT

SCENES = """
import numpy as np
import tsdyn as ts
from tsdyn import ahead
from tsdyn.jit.cache import statistics
from tsdyn.jit.compiled import is_loaded

C, F, half = ts.constraints, ts.forces, np.sqrt(0.5)
UP = {"normal_b": (0, 0, 1)}

def empty():
    return ts.Scene(gravity=(0, 0, -9.81))

def ball(scene, z=0.1, **given):
    return scene.add_body(mass=1.0, inertia=(1, 1, 2), position=(0.03 * z, 0, z), velocity=(1, 0, 0), **given)

def box(z=0.25, **law):
    scene = empty()
    body = scene.add_body(**ts.shapes.box((1, 1, 0.5), mass=1.0), position=(0, 0, z), velocity=(1, 0, 0))
    for x, y in ((-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)):
        scene.add(C.PlaneContact(body, scene.ground, point_a=(x, y, -0.25), unilateral=True, **UP, **law))
    return scene

def balls():
    scene = empty()
    low, high = ball(scene), ball(scene, 0.5)
    scene.add(C.SphereContact(low, scene.ground, radius_a=0.1, kinetic=0.2, **UP))
    scene.add(C.SphereContact(high, low, radius_a=0.1, radius_b=0.1, kinetic=0.3))
    return scene

def rolling(kind, **given):
    scene = empty()
    scene.add(kind(ball(scene, orientation=(half, half, 0, 0)), scene.ground, kinetic=0.2, **UP, **given))
    return scene

def hinged(count=1):
    scene, joints = empty(), []
    for i in range(count):
        body = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(1, 2 * i, 0))
        joints.append(scene.add(C.Revolute.at(scene.ground, body, point=(0, 2 * i, 0), axis=(0, 1, 0))))
    return scene, *joints

def with_(scene, *parts):
    for part in parts:
        scene.add(part)
    return scene

def rope():
    scene = empty()
    mass = scene.add_point_mass(1.0, position=(0.5, 0, -0.2))
    return with_(scene, C.Rope([(scene.ground, (0, 0, 0)), (mass, (0, 0, 0))], length=1.0, restitution=0.4))

def stop():
    scene, joint = hinged()
    return with_(scene, C.Stop(joint, lower=-0.5, upper=0.1, restitution=0.5))

def ratchet():
    scene, joint = hinged()
    return with_(scene, C.Ratchet(joint))

def coupled(**law):
    scene, one, two = hinged(2)
    friction = F.RevoluteFriction(two, kinetic=0.2, radius=0.1)
    return with_(scene, C.Coupler(one, two, **law), C.Stop(one, upper=0.1), friction)

def driven(**law):
    scene, joint = hinged()
    torque = F.Torque(scene.bodies[0], torque=ts.Table([0, 1], [(0, 2, 0), (0, 3, 0)]))
    return with_(scene, torque, F.RevoluteFriction(joint, kinetic=0.2, **law))

def slide():
    scene = empty()
    body = ball(scene, 0.0)
    joint = scene.add(C.Translational.at(scene.ground, body, point=(0, 0, 0), axis=(1, 0, 0)))
    return with_(scene, F.TranslationalFriction(joint, kinetic=0.2))

def rubbing():
    scene = empty()
    body = ball(scene, 0.0)
    scene.add(C.Planar.at(scene.ground, body, point=(0, 0, 0), axis=(0, 0, 1)))
    return with_(scene, F.CoulombFriction(body, scene.ground, force=2.0))

def loop():
    scene = empty()
    points = np.array([(0, 0, 0), (0.3, 0, 1), (2, 0, 1.5), (2, 0, 0)], float)
    rods = [scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=x) for x in 0.5 * (points[1:] + points[:-1])]
    sides = zip((scene.ground, *rods), (*rods, scene.ground), points)
    joints = [scene.add(C.Revolute.at(a, b, point=x, axis=(0, 1, 0))) for a, b, x in sides]
    return with_(scene, C.Stop(joints[0], upper=0.3, restitution=0.5))

def set_and_read():
    scene, joint = hinged()
    scene.set(joint, rate=-1.0)
    stop = scene.add(C.Stop(joint, lower=-0.1))
    solution = ts.simulate(scene, (0, 1), dense_output=True)
    return solution.reaction(joint), solution.reaction(stop), solution.work, solution.at(0.5).multipliers

def simulated(scene, **options):
    ts.simulate(scene, (0, 1), **options)

def switched():
    scene, joint = hinged()
    release = lambda t, state: t - 0.5
    release.action = lambda change: change.deactivate(joint.name)
    simulated(scene, events=release)

def struck():
    scene = box(kinetic=0.3)
    ts.impact(scene, ts.State(0.0, *scene.start))

def ensemble(scene):
    name = scene.bodies[0].name
    ts.ensemble(scene, {f"{name}.mass": [1.0, 2.0]}, (0, 1))

RUNS = {
    "impacts": lambda: simulated(box(0.5, restitution=0.3)),
    "friction": lambda: simulated(box(kinetic=0.3)),
    "balls": lambda: simulated(balls()),
    "a rope": lambda: simulated(rope()),
    "a stop": lambda: simulated(stop()),
    "a ratchet": lambda: simulated(ratchet()),
    "a coupler": lambda: simulated(coupled(ratio=2.0)),
    "a coupler by a polynomial": lambda: simulated(coupled(polynomial=(0, 1, 0.1))),
    "a disc": lambda: simulated(rolling(C.RollingDisc, radius=0.1, axis_a=(0, 0, 1))),
    "a rolling ball": lambda: simulated(rolling(C.RollingBall, radius=0.1)),
    "an ellipsoid": lambda: simulated(rolling(C.RollingEllipsoid, semi_axes=(0.1, 0.1, 0.1))),
    "a motor": lambda: simulated(driven(radius=0.05)),
    "a regularised motor": lambda: simulated(driven(radius=0.05, slip_velocity=1e-3)),
    "a slide": lambda: simulated(slide()),
    "a plane": lambda: simulated(rubbing()),
    "an action": switched,
    "an impact": struck,
    "an ensemble of boxes": lambda: ensemble(box(kinetic=0.3)),
    "an ensemble of ropes": lambda: ensemble(rope()),
    "a loop with redundant rows": lambda: simulated(loop()),
    "a joint that is set, and what is read": set_and_read,
}
listed, found = set(ahead.named(False).values()), set()
for name, run in RUNS.items():
    run()
    loaded = {kernel for kernel in ahead._all() if is_loaded(kernel)}
    strays = statistics["hits"] + statistics["misses"] - len(loaded)
    if strays:  # of kernels for arguments of other types than declared, and of those that none but kernels should call
        print(f"{name}: {strays} more are loaded")
        break
    used = loaded - listed - found
    found |= used
    for kernel in used:
        print(f"{name}: {kernel.py_func.__module__}.{kernel.py_func.__qualname__}")
"""


@pytest.mark.slow
def test_runs_with_contacts_and_friction_need_no_kernel_that_is_not_compiled():
    result = subprocess.run([sys.executable, "-c", SCENES], cwd=ROOT, text=True, capture_output=True, timeout=900)
    assert (result.stdout, result.returncode) == ("", 0), result.stderr
