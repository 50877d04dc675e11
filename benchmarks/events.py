"""Cost of contacts: of an event beside the step that it ends, and of a step where contacts are watched.

Balls bounce without loss, alone, as one of ten bodies, ten at once, and beside a box at rest; a stack of ten boxes with
40 contacts falls and comes to rest; pins of a chain stick and slide. Steps of ten boxes that slide on springs follow:
without contacts, with 40 open ones, and on 30 points, three of each, in place of planar joints, bilateral ones and
closed contacts.
Last a block that slides and stops, by the exact law of friction and by the regularised one. Runs of a group are
interleaved; least times of rounds.

Run it: python -m benchmarks.events
"""

import numpy as np

import tsdyn as ts
from benchmarks import friction
from benchmarks.contender import timed

G, ROUNDS = 9.81, 7
BOX = np.array([0.5, 0.5, 0.25])  # m


def balls(bodies, bouncing, falls=60.0):
    """A scene of so many bodies, of which some bounce; its span."""
    scene = ts.Scene(gravity=(0, 0, -G))
    for i in range(bodies):
        spin = (0.1, 0.2 * i, 0.3)
        ball = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(2 * i, 0, 1 + 0.013 * i), angular_velocity=spin)
        if i < bouncing:
            scene.add(
                ts.constraints.SphereContact(ball, scene.ground, radius_a=0.1, normal_b=(0, 0, 1), restitution=1.0)
            )
    return scene, (0.0, falls / bouncing)


def _boxes(scene, count, apart, height):
    return [
        scene.add_body(**ts.shapes.box(2 * BOX, mass=1.0), position=(i * apart[0], 0, height + i * apart[2]))
        for i in range(count)
    ]


def _corners(scene, box, other, top, corners=4, unilateral=True, **law):
    for k in range(corners):
        x, y = ((-1, -1), (1, -1), (-1, 1), (1, 1))[k] if corners == 4 else ((-1, -1), (1, -1), (0, 1))[k]
        corner = BOX * [x, y, -1]
        law |= {"normal_b": (0, 0, 1), "unilateral": unilateral}
        scene.add(ts.constraints.PlaneContact(box, other, point_a=corner, point_b=(0, 0, top), **law))


def ball_beside_box():
    """A ball that bounces beside a box at rest on four corners, and the span."""
    scene, span = balls(1, 1)
    (box,) = _boxes(scene, 1, (0, 0, 0), BOX[2])
    _corners(scene, box, scene.ground, 0.0)
    return scene, span


def stack(count=10):
    """Boxes on each other, 3 cm apart and tilted at random, and their span."""
    scene, rng = ts.Scene(gravity=(0, 0, -G)), np.random.default_rng(1)
    below, top = scene.ground, 0.0
    for i in range(count):
        half = 0.01 * rng.normal()
        z = BOX[2] + i * (2 * BOX[2] + 0.03) + 0.03
        orientation = (np.cos(half), np.sin(half), 0, 0)
        box = scene.add_body(**ts.shapes.box(2 * BOX, mass=1.0), position=(0, 0, z), orientation=orientation)
        _corners(scene, box, below, top, restitution=0.2)
        below, top = box, BOX[2]
    return scene, (0.0, 2.0)


def slide(kind):
    """Ten boxes on a floor, each on a spring: on planar joints, with contacts far above or not, or on three points."""
    scene = ts.Scene(gravity=(0, 0, -G))
    for i, box in enumerate(_boxes(scene, 10, (3.0, 0, 0), BOX[2])):
        anchor = {"point_b": (3.0 * i, 2.0, BOX[2])}
        scene.add(ts.forces.Spring(box, scene.ground, **anchor, stiffness=40.0 + i, free_length=1.5))
        if kind in ("bilateral", "closed"):
            _corners(scene, box, scene.ground, 0.0, 3, kind == "closed")
        else:
            scene.add(ts.constraints.Planar.at(scene.ground, box, point=(3.0 * i, 0, 0), axis=(0, 0, 1)))
        if kind == "open":
            _corners(scene, box, scene.ground, -1.0)
    return scene, (0.0, 100.0)


def block(exact):
    """A block that slides on a floor from 2 m/s, stops after half of the span, and rests."""
    scene, law = ts.Scene(gravity=(0, 0, -G)), {"kinetic": 0.2} if exact else {}
    body = scene.add_body(1.0, (1, 1, 1), velocity=(2.0, 0, 0))
    scene.add(ts.constraints.Parallel(body, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 0, 1)))
    floor = {"normal_b": (0, 0, 1), "unilateral": exact}
    floor = scene.add(ts.constraints.PlaneContact(body, scene.ground, **floor, **law))
    if not exact:
        scene.add(ts.forces.ContactFriction(floor, kinetic=0.2, slip_velocity=1e-3))
    return scene, (0.0, 2.0)


def least(calls):
    """Least seconds of each call, by name, and what it returned; the rounds are interleaved."""
    seconds = dict.fromkeys(calls, np.inf)
    found = {name: call() for name, call in calls.items()}
    for _ in range(ROUNDS):
        for name, call in calls.items():
            seconds[name] = min(seconds[name], timed(call)[0])
    return seconds, found


def main():
    """Print microseconds an event and a step."""
    scenes = {
        "a ball": balls(1, 1), "one ball of ten": balls(10, 1), "ten balls": balls(10, 10),
        "a ball beside a box": ball_beside_box(), "a stack of ten": stack(),
        "twenty rough pins": (friction.build(20, True, 0.0), (0.0, 0.1)),
    }  # fmt: skip
    seconds, found = least({name: lambda given=given: ts.simulate(*given) for name, given in scenes.items()})
    print("an event, with the step that it ends")
    for name, solution in found.items():
        events = len(solution.phases) - 1
        print(f"  {name:20} {seconds[name] / events * 1e6:8.1f} us, {events} events, {solution.stats.steps} steps")
    scenes = {kind: slide(kind) for kind in ("none", "open", "bilateral", "closed")}
    seconds, found = least({kind: lambda given=given: ts.simulate(*given) for kind, given in scenes.items()})
    print("a step of ten boxes that slide")
    for kind in found:
        beside = "bilateral" if kind == "closed" else "none"
        cost = {name: seconds[name] / found[name].stats.steps for name in (kind, beside)}
        print(f"  {kind + ' contacts':20} {cost[kind] * 1e6:8.1f} us, x {cost[kind] / cost[beside]:.2f}")
    scenes = {"exact": block(True), "regularised": block(False)}
    seconds, found = least({law: lambda given=given: ts.simulate(*given) for law, given in scenes.items()})
    print("a block that slides and stops")
    for law in found:
        steps = found[law].stats.steps
        print(f"  {law:20} {seconds[law] * 1e3:8.2f} ms, {steps} steps, x {seconds[law] / seconds['regularised']:.2f}")


if __name__ == "__main__":
    main()
