"""A leg from a URDF file whose motors sit high: cranks and rods turn the knee and the ankle, in three closed loops.

    hinges 7 x 5 rows, balls 4 x 3, knee pins 2 x 5, motors 4     for 10 bodies; three rows are redundant, and two
                                                                  freedoms are left: ankle rods turn about themselves

The file is a tree; its rods point forward until `loops=` ties their ends. Crank, rod, shin and thigh of the knee form a
parallelogram, so the knee turns as its motor does. The two cranks of the ankle turn its pitch together and its roll
against each other; `check` holds the angles of the ankle against the lengths of the rods,

    | crank pin - seat(pitch, roll) | = L        with rotation matrices alone

Run it: python examples/leg_with_rods.py
"""

from pathlib import Path

import numpy as np

import tsdyn as ts

FILE = Path(__file__).with_name("leg_with_rods.urdf")
LOOPS = [
    ("knee rod end", "knee seat", "hinge", (0, 1, 0)),
    ("left rod end", "left seat", "ball"),
    ("right rod end", "right seat", "ball"),
]
SHIN, BACK, WIDE, DROP = 0.4, 0.05, 0.05, 0.1  # m: of the ankle's cranks, from the knee down and out
MOTORS = {"hip pitch": (-0.5, 0.3), "knee motor": (0.9, 0.4), "left motor": (-0.3, 0.2), "right motor": (-0.2, -0.25)}
RATE = 2.0 * np.pi  # rad/s; the motors: rad at the start, and of their swing


def build():
    """Return the scene, assembled with the knee as its motor stands; motors swing about their start."""
    scene = ts.load(FILE, loops=LOOPS)
    scene.assemble(joints={name: start for name, (start, _) in MOTORS.items()} | {"knee": MOTORS["knee motor"][0]})
    for name, (start, swing) in MOTORS.items():
        angle = ts.motions.Sine(swing, RATE, offset=start)
        scene.add(ts.constraints.RotationMotor.of(scene[name], angle=angle, name=f"{name} drive"))
    scene.assemble()  # velocities
    return scene


def about_y(angles):
    """Rotation matrices (k, 3, 3)."""
    c, s, o = np.cos(angles), np.sin(angles), np.zeros_like(angles)
    return np.stack([np.stack([c, o, s], -1), np.stack([o, o + 1.0, o], -1), np.stack([-s, o, c], -1)], 1)


def about_x(angles):
    """Rotation matrices (k, 3, 3)."""
    c, s, o = np.cos(angles), np.sin(angles), np.zeros_like(angles)
    return np.stack([np.stack([o + 1.0, o, o], -1), np.stack([o, c, -s], -1), np.stack([o, s, c], -1)], 1)


def check(solution, tol=1e-12):
    """The parallelogram of the knee, the rods of the ankle, and the motors, to tol."""
    solution.raise_if_failed()
    for name, (start, swing) in MOTORS.items():
        assert np.abs(solution.angle(name) - start - swing * np.sin(RATE * solution.t)).max() < tol
    assert np.abs(solution.angle("knee") - solution.angle("knee motor")).max() < tol
    foot = about_y(solution.angle("ankle pitch")) @ about_x(solution.angle("ankle roll"))
    for side, y in (("left", WIDE), ("right", -WIDE)):
        pin = about_y(solution.angle(f"{side} motor")) @ (-BACK, 0.0, 0.0) + (0.0, y, -DROP)
        seat = foot @ (-BACK, y, 0.0) + (0.0, 0.0, -SHIN)
        assert np.abs(np.linalg.norm(pin - seat, axis=1) - (SHIN - DROP)).max() < tol
    assert solution.constraint_error.position.max() < 1e-13


def main():
    """Run a period and print how far the ankle turns."""
    solution = ts.simulate(build(), (0.0, 1.0))
    check(solution)
    print(solution)
    for name in ("knee", "ankle pitch", "ankle roll"):
        print(f"  {name} turns by {np.ptp(np.degrees(solution.angle(name))):.1f} degrees")


if __name__ == "__main__":
    main()
