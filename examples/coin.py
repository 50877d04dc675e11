"""A coin that rolls: upright and fast it is stable, slow it falls; at an angle it runs on circles.

Of a disc of mass m, radius a, inertia J about its axis and A across it (Routh; Neimark and Fufaev 1972):

    upright, stable where      w^2 > A m g a / (J (J + m a^2))                                       w: spin
    steady turn                (J + m a^2) w W cos = A W^2 sin cos - m g a sin                       of the lean
                               W: rate of the turn, w: angular velocity about the axis of the disc

Run it: python examples/coin.py
"""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

MASS, RADIUS, GRAVITY = 0.5, 0.2, 9.81  # kg, m, m/s^2
ACROSS, ALONG = MASS * RADIUS**2 / 4, MASS * RADIUS**2 / 2
LIMIT = np.sqrt(ACROSS * MASS * GRAVITY * RADIUS / (ALONG * (ALONG + MASS * RADIUS**2)))  # rad/s


def build(lean=0.5, turn=2.5):
    """The coin in a steady turn: its lean, rad, and the rate at which it turns, rad/s."""
    sine, cosine, whole = np.sin(lean), np.cos(lean), ALONG + MASS * RADIUS**2
    spin = (ACROSS * turn**2 * sine * cosine - MASS * GRAVITY * RADIUS * sine) / (whole * turn * cosine)
    return rolling(lean, (0.0, spin, turn * cosine))


def rolling(lean, omega):
    """The coin on its edge with an angular velocity (3,), frame of the coin, rad/s; its axis is y of that frame."""
    scene = ts.Scene(gravity=(0, 0, -GRAVITY))
    A = Rotation.from_euler("x", lean)
    coin = scene.add_body(MASS, (ACROSS, ALONG, ACROSS), (0, 0, RADIUS * np.cos(lean)), name="coin")
    coin.orientation, coin.angular_velocity = A, omega
    coin.velocity = np.cross(A.apply(omega), A.apply((0, 0, RADIUS)))
    places = {"axis_a": (0, 1, 0), "normal_b": (0, 0, 1), "name": "contact"}
    scene.add(ts.constraints.RollingDisc(coin, scene.ground, radius=RADIUS, **places))
    return scene


def upright(spin):
    """Eigenvalue with the largest real part, 1/s, of straight rolling at a spin, rad/s."""
    return rolling(0.0, (0.0, spin, 0.0)).linearise().eigenvalues().real.max()


def check(solution, tol=1e-9):
    """The lean of the steady turn stays, its path is closed, and the limit of stability is that of the closed form."""
    solution.raise_if_failed()
    assert np.ptp(solution.position("coin")[:, 2]) < tol
    path = solution.contact_point("contact")
    assert np.abs(path[-1] - path[0]).max() < tol
    assert upright(0.99 * LIMIT) > 0.1
    assert upright(1.01 * LIMIT) < 1e-6


def main():
    """One steady turn."""
    solution = ts.simulate(build(), (0.0, 2.0 * np.pi / 2.5))
    check(solution)
    print(solution)
    path = solution.contact_point("contact")
    print(f"circle of {np.ptp(path[:, 0]):.4f} m, friction {solution.friction_demand('contact').max():.4f}")
    print(f"upright rolling is stable above {LIMIT:.4f} rad/s")


if __name__ == "__main__":
    main()
