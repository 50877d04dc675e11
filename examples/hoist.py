"""A hoist: a motor with a heavy rotor lowers a jib; a rope over its tip carries a load on a movable block.

    foot   Revolute, ground and jib                            5 rows
    rope   Rope, ground, block, tip of the jib, winch          1 row: the load is free to swing
    rotor  Armature, 0.05 kg m^2 at 20 turns of one            adds 20 kg m^2 to the jib

Energy is conserved: the rotor takes its part. Run it: python examples/hoist.py
"""

import numpy as np

import tsdyn as ts

LENGTH, ANGLE = 4.0, np.deg2rad(50.0)  # m, of the jib; at first
INERTIA, RATIO = 0.05, 20.0  # kg m^2
TIP = np.array([LENGTH * np.cos(ANGLE), 0.0, LENGTH * np.sin(ANGLE)])


def build():
    """Return the scene at rest, released."""
    scene = ts.Scene()
    turn = (np.cos(ANGLE / 2), 0.0, -np.sin(ANGLE / 2), 0.0)
    bar = ts.shapes.box((LENGTH, 0.12, 0.12), mass=60.0)
    jib = scene.add_body(**bar, position=TIP / 2, orientation=turn, name="jib")
    block = scene.add_body(**ts.shapes.sphere(0.18, mass=25.0), position=TIP - (0.3, 0, 1.8), name="block")
    foot = scene.add(ts.constraints.Revolute.at(scene.ground, jib, point=(0, 0, 0), axis=(0, -1, 0), name="foot"))
    end = (LENGTH / 2, 0.0, 0.0)
    points = [(jib, end), (block, (0, 0, 0.18)), (jib, end), (scene.ground, (0, 0, 0.5))]
    scene.add(ts.constraints.Rope(points, always_taut=True, name="rope"))
    scene.add(ts.forces.Armature(foot, inertia=INERTIA, ratio=RATIO, name="rotor"))
    places = {"axis_a": (0, -1, 0), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    scene.add(ts.forces.TorsionalSpring(scene.ground, jib, **places, stiffness=6e3, free_angle=ANGLE + 0.3))
    return scene


def length(solution):
    """The length of the rope between its points, m, (k,)."""
    tip = solution.position("jib", point=(LENGTH / 2, 0, 0))
    hook = solution.position("block", point=(0, 0, 0.18))
    return 2.0 * np.linalg.norm(tip - hook, axis=1) + np.linalg.norm(tip - (0, 0, 0.5), axis=1)


def tension(solution):
    """The tension of the rope, N, (k,): two parts of it carry the block, from the tip."""
    force, _ = solution.reaction("rope", on="block")
    up = solution.position("jib", point=(LENGTH / 2, 0, 0)) - solution.position("block", point=(0, 0, 0.18))
    return 0.5 * (force * up).sum(axis=1) / np.linalg.norm(up, axis=1)


def check(solution, tol=1e-7):
    """The rope keeps its length and pulls, energy to tol, and the rotor the reaction of its inertia."""
    solution.raise_if_failed()
    ropes = length(solution)
    assert np.ptp(ropes) < 1e-12
    assert (tension(solution) > 0.0).all()
    assert np.ptp(solution.energy) < tol * np.ptp(solution.potential_energy)
    _, torque = solution.reaction("rotor", on="jib")
    expected = -INERTIA * RATIO**2 * solution.angle_acceleration("foot")
    assert np.abs(-torque[:, 1] - expected).max() < 1e-9 * np.abs(expected).max()


def main():
    """Run it for 3 s and print the largest tension."""
    solution = ts.simulate(build(), (0.0, 3.0), rtol=1e-9, atol=1e-9)
    check(solution)
    print(solution)
    print(f"  tension {tension(solution).min():.0f} to {tension(solution).max():.0f} N")


if __name__ == "__main__":
    main()
