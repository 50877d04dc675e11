"""Peaucellier's linkage: seven bars and revolute joints that guide a point along an exactly straight line.

Two long bars from the fixed point O and a rhombus make an inversor, |OB| |OD| = L^2 - S^2. B moves on a circle through
O, so D moves on a straight line. Ten joints in space close three loops; nine rows are redundant.

Run it: python examples/peaucellier.py
"""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

LONG, SHORT, CRANK = 1.0, 0.4, 0.35  # m: bars from O, sides of the rhombus, radius of the circle
START = 0.5  # rad, of the crank from x
LINE = (LONG**2 - SHORT**2) / (2.0 * CRANK)  # m, distance of the line from O


def joints(angle=START):
    """Places (x, y) of O, the crank's foot Q, B, D and the corners A and C of the rhombus."""
    O, Q = np.zeros(2), np.array([CRANK, 0.0])
    B = Q + CRANK * np.array([np.cos(angle), np.sin(angle)])
    D = B * (LONG**2 - SHORT**2) / (B @ B)
    middle, across = (B + D) / 2, np.array([-B[1], B[0]]) / np.linalg.norm(B)
    aside = np.sqrt(SHORT**2 - (D - B) @ (D - B) / 4) * across
    return {"O": O, "Q": Q, "B": B, "D": D, "A": middle + aside, "C": middle - aside}


def build():
    """Return the scene, released from rest; gravity is along the line."""
    scene, at = ts.Scene(gravity=(0.0, -9.81, 0.0)), {name: np.array([*p, 0.0]) for name, p in joints().items()}
    bars = {}
    for pair in ("QB", "OA", "OC", "AB", "BC", "CD", "DA"):
        first, last = at[pair[0]], at[pair[1]]
        angle = np.arctan2(*(last - first)[1::-1])
        shape = ts.shapes.box((np.linalg.norm(last - first), 0.03, 0.01), density=2700)
        turn = Rotation.from_rotvec((0.0, 0.0, angle))
        bars[pair] = scene.add_body(**shape, position=(first + last) / 2, orientation=turn, name=pair)
    ground = scene.ground
    for a, b, name in (
        (ground, bars["QB"], "Q"), (ground, bars["OA"], "O"), (ground, bars["OC"], "O"),
        (bars["OA"], bars["AB"], "A"), (bars["OA"], bars["DA"], "A"), (bars["OC"], bars["BC"], "C"),
        (bars["OC"], bars["CD"], "C"), (bars["QB"], bars["AB"], "B"), (bars["QB"], bars["BC"], "B"),
        (bars["CD"], bars["DA"], "D"),
    ):  # fmt: skip
        scene.add(ts.constraints.Revolute.at(a, b, point=at[name], axis=(0, 0, 1)))
    return scene


def guided(solution):
    """The path of D, (k, 3)."""
    bar = solution.scene.body("CD")
    return solution.position(bar, point=(np.linalg.norm(joints()["D"] - joints()["C"]) / 2, 0.0, 0.0))


def check(solution):
    """D stays on the line to rounding and moves far along it; the energy is constant."""
    solution.raise_if_failed()
    path = guided(solution)
    assert np.abs(path[:, 0] - LINE).max() < 1e-13
    assert np.ptp(path[:, 1]) > 0.5
    assert np.ptp(solution.energy) < 1e-6


def main():
    """Run it for 2 s and print how straight the line is."""
    solution = ts.simulate(build(), (0.0, 2.0))
    check(solution)
    print(solution)
    path = guided(solution)
    print(f"  D moves {np.ptp(path[:, 1]):.3f} m along a line and {np.ptp(path[:, 0]):.1e} m across it")


if __name__ == "__main__":
    main()
