"""The Whipple bicycle: four rigid bodies, three hinges, two wheels that roll. It balances itself at some speeds.

Parameters are those of the benchmark of Meijaard, Papadopoulos, Ruina and Schwab (2007), Linearized dynamics equations
for the balance and steer of a bicycle, Proc. R. Soc. A 463, here with x forward, y to the left and z upwards. Of

    M x'' + v C1 x' + (g K0 + v^2 K2) x = 0        x: lean, steer; v: speed

the paper prints all coefficients; `linearise` finds the same eigenvalues from the full non-linear model.

Run it: python examples/bicycle.py
"""

import numpy as np

import tsdyn as ts

GRAVITY, BASE, TRAIL, TILT = 9.81, 1.02, 0.08, np.pi / 10  # m/s^2, m, m, rad
REAR, FRONT = 0.3, 0.35  # m, radii of the wheels
STABLE = 4.29238253634111, 6.02426201538837  # m/s: between them it balances itself
MASS = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
GRAVITATION = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
CENTRIFUGAL = np.array([[0.0, 76.59734589573222], [0.0, 2.65431523794604]])
GYROSCOPIC = np.array([[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])


def build(speed=4.6, lean_rate=0.5):
    """The bicycle upright at a speed, m/s, about to lean at a rate, rad/s."""
    scene, c = ts.Scene(gravity=(0.0, 0.0, -GRAVITY)), ts.constraints

    def body(name, mass, position, inertia, radius=np.inf):
        return scene.add_body(
            mass, inertia, position, velocity=(speed, -lean_rate * position[2], 0),
            angular_velocity=(lean_rate, speed / radius, 0), name=name,
        )  # fmt: skip

    rear = body("rear wheel", 2.0, (0, 0, REAR), (0.0603, 0.12, 0.0603), REAR)
    frame = body("frame", 85.0, (0.3, 0, 0.9), ((9.2, 0, -2.4), (0, 11, 0), (-2.4, 0, 2.8)))
    fork = body("fork", 4.0, (0.9, 0, 0.7), ((0.05892, 0, 0.00756), (0, 0.06, 0), (0.00756, 0, 0.00708)))
    front = body("front wheel", 3.0, (BASE, 0, FRONT), (0.1405, 0.28, 0.1405), FRONT)
    steer = {"point": (BASE + TRAIL, 0, 0), "axis": (-np.sin(TILT), 0, np.cos(TILT))}
    scene.add(c.Revolute.at(frame, rear, point=rear.position, axis=(0, 1, 0), name="rear hub"))
    scene.add(c.Revolute.at(frame, fork, **steer, name="steer"))
    scene.add(c.Revolute.at(fork, front, point=front.position, axis=(0, 1, 0), name="front hub"))
    plane = {"axis_a": (0, 1, 0), "normal_b": (0, 0, 1)}
    scene.add(c.RollingDisc(rear, scene.ground, radius=REAR, **plane, name="rear contact"))
    scene.add(c.RollingDisc(front, scene.ground, radius=FRONT, **plane, name="front contact"))
    return scene


def eigenvalues(speed):
    """Those of lean and steer (4,), 1/s, of the non-linear model; all others are zero: place, heading and speed."""
    found = build(speed, 0.0).linearise().eigenvalues()
    return np.sort_complex(found[np.argsort(-np.abs(found))[:4]])


def published(speed):
    """Those of the paper's coefficients (4,), 1/s."""
    K, C = GRAVITY * GRAVITATION + speed**2 * CENTRIFUGAL, speed * GYROSCOPIC
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(MASS, K), -np.linalg.solve(MASS, C)]])
    return np.sort_complex(np.linalg.eigvals(A))


def lean(solution):
    """Of the frame, rad, positive to the right."""
    return np.arcsin(solution.rotation("frame")[:, 2, 1])


def check(solution, tol=1e-9):
    """Eigenvalues are the published ones; between the speeds of the paper all motions decay, and so does this run's."""
    for speed in (0.0, 2.0, 4.0, 5.0, 6.0, 8.0):
        assert np.abs(eigenvalues(speed) - published(speed)).max() < tol
    for speed, sign in zip(STABLE, (-1.0, 1.0), strict=True):
        margins = [eigenvalues(speed + sign * beyond).real.max() for beyond in (-1e-6, 1e-6)]
        assert margins[0] < 0.0 < margins[1]
    assert np.abs(lean(solution)).max() > 0.05
    assert np.abs(lean(solution)[-1]) < 5e-3
    assert np.ptp(solution.energy) < 1e-9 * solution.energy[0]
    assert solution.constraint_error.velocity.max() < 1e-12


def main():
    """Push it, let it ride for 10 s, and print eigenvalues."""
    solution = ts.simulate(build(), (0.0, 10.0)).raise_if_failed()
    check(solution)
    print(solution)
    for speed in (4.0, 5.0, 6.0):
        print(f"{speed:g} m/s", eigenvalues(speed).round(9))
    print(f"leans by {np.abs(lean(solution)).max():.3f} rad at most, by {abs(lean(solution)[-1]):.1e} at the end")


if __name__ == "__main__":
    main()
