"""The simplest walker (Garcia et al. 1998): two legs without mass on a slope, without a motor; a limit cycle.

    plane        Dot2, ground and hip, ground and feet    1 row each: nothing falls sideways
    legs         Distance, hip and foot                   1 row each
    pins         PointOnLine, foot and an axis across     2 rows each; that of the foot that stands is active

At heel strike an action pins the swing foot where it is and frees the other one. The gait converges to a limit cycle:
for feet without mass and a slope of 0.009 the angle of the stance leg is 0.200310900544287 rad there, and deviations
are multiplied by -0.190 +- 0.558 i from step to step. Run it: python examples/compass_walker.py
"""

import numpy as np

import tsdyn as ts

SLOPE, FOOT = 0.009, 1e-4  # rad; mass of a foot, that of the hip, the length of a leg and gravity are 1
ANGLE, RATE = 0.200310900544287, -0.199832473004977  # of the stance leg after heel strike; feet without mass
FEET = ("left", "right")
ACROSS = (0.0, 1.0, 0.0)


def build(angle=ANGLE, rate=RATE, foot=FOOT):
    """Return the scene just after a heel strike: the left foot stands, the slope is the plane z = 0."""
    scene = ts.Scene(gravity=(np.sin(SLOPE), 0.0, -np.cos(SLOPE)))
    s, c, swing = np.sin(angle), np.cos(angle), (1.0 - np.cos(2.0 * angle)) * rate - rate  # rate of the swing leg
    hip = scene.add_point_mass(1.0, position=(-s, 0, c), velocity=(-c * rate, 0, -s * rate), name="hip")
    turn = np.array((-c, 0, s)) * swing
    places = {"left": ((0, 0, 0), (0, 0, 0)), "right": ((-2 * s, 0, 0), hip.velocity + turn)}
    for name, (position, velocity) in places.items():
        mass = scene.add_point_mass(foot, position=position, velocity=velocity, name=name)
        scene.add(ts.constraints.Distance(hip, mass, length=1.0, name=f"{name} leg"))
        pin = ts.constraints.PointOnLine(mass, scene.ground, point_b=position, axis_b=ACROSS, name=f"{name} pin")
        scene.add(pin)
    for body in scene.bodies:
        scene.add(ts.constraints.Dot2(scene.ground, body, axis_a=ACROSS, name=f"{body.name} plane"))
    scene.deactivate("right pin")
    return scene


class HeelStrike:
    """The event that the swing foot comes down in front, and its action."""

    direction = -1  # behind, it scuffs

    def __init__(self):
        self.stance, self.swing = FEET

    def __call__(self, t, state):
        """How much further in front of the hip the swing foot is than the stance foot behind it."""
        hip, stance, swing = (state.position(name)[0] for name in ("hip", self.stance, self.swing))
        return swing + stance - 2.0 * hip

    def action(self, change):
        """Pin the foot that comes down, and free the other one; not at the start, where it is behind."""
        stance, swing = (change.state.position(name) for name in (self.stance, self.swing))
        if swing[0] < stance[0]:
            return
        change.set(f"{self.swing} pin.point_b", swing)
        change.activate(f"{self.swing} pin")
        change.deactivate(f"{self.stance} pin")
        self.stance, self.swing = self.swing, self.stance


def gait(solution):
    """Angle (rad) and rate (rad/s) of the stance leg after each heel strike, (steps, 2)."""
    found = []
    for t, pin, _ in solution.impulses:
        state = solution.at(t)
        (x, _, z), (u, _, w) = state.position("hip") - state.position(pin.removesuffix(" pin")), state.velocity("hip")
        found.append((-np.arctan2(x, z), w * x - u * z))
    return np.array(found)


def walk(end=120.0, **options):
    """Return the run up to an end, s, of the walker as `build` makes it with these options."""
    return ts.simulate(build(**options), (0.0, end), events=HeelStrike(), dense_output=True)


def check(solution, tol=3e-5):
    """The gait settles, on that of feet without mass to the tolerance; heel strikes alone take energy."""
    solution.raise_if_failed()
    steps = gait(solution)
    assert np.abs(steps[-1] - (ANGLE, RATE)).max() < tol
    assert np.abs(steps[-1] - steps[-2]).max() < 1e-6
    for begin, end, _ in solution.phases:
        energy = solution.energy[(solution.t > begin) & (solution.t < end)]
        assert not energy.size or np.ptp(energy) < 1e-7


def main():
    """Walk and print the gait."""
    solution = walk()
    check(solution)
    print(solution)
    for angle, rate in gait(solution)[::6]:
        print(f"  {angle:.9f} rad, {rate:.9f} rad/s")


if __name__ == "__main__":
    main()
