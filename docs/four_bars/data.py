"""The four-bar of examples/four_bar.py as numbers: what the programs of this folder simulate.

Crank, coupler and rocker are pinned at A, B, C, D in the plane of x and y; gravity is along -y. The crank starts at
0.6 rad from x with 9 rad/s. After 2 s its angle, by the single equation of motion and SciPy at 1e-12, is ANGLE.
"""

import numpy as np

MASSES, INERTIAS = (1.0, 2.0, 1.5), (0.01, 0.15, 0.07)  # kg; kg m^2 about the middles of crank, coupler, rocker
GRAVITY, END, RATE = 9.81, 2.0, 9.0  # m/s^2, s, rad/s
A, D = np.array([0.0, 0.0]), np.array([0.8, 0.0])  # m
B = 0.3 * np.array([np.cos(0.6), np.sin(0.6)])
ANGLE = 14.122841131146503  # rad


def far_pin():
    """C, where the circles of 0.9 m about B and of 0.7 m about D meet, on the left of BD."""
    d = D - B
    along = (0.9**2 - 0.7**2 + d @ d) / (2 * d @ d)
    return B + along * d + np.sqrt(0.9**2 / (d @ d) - along**2) * np.array([-d[1], d[0]])


C = far_pin()
LINKS = (A, B), (B, C), (C, D)
ANGLES = [np.arctan2(*(last - first)[::-1]) for first, last in LINKS]  # rad, from x


def rates():
    """Angular velocities of the links at the start, rad/s: the velocities of C from both sides are equal."""
    turned = [np.array([-(last - first)[1], (last - first)[0]]) for first, last in LINKS]
    coupler, rocker = np.linalg.solve(np.stack([turned[1], turned[2]], axis=1), -RATE * turned[0])
    return RATE, coupler, rocker


def report(program, angle, gap):
    """Print how far the crank's angle after 2 s is off, and the gap at the far pin."""
    print(f"{program}: angle off by {abs(angle - ANGLE):.1e} rad, gap {gap:.1e} m")
