"""Andrews' squeezer: seven bodies, three loops, a motor that turns the crank 16 rad within 0.03 s.

The benchmark of Hairer and Wanner (Solving Ordinary Differential Equations II, section VII.7). The scene is that of
`tsdyn stress`, with ten Revolute joints in space: nine redundant rows, which need no preparation. The check compares
the angles at the end with the reference solution of the test set for initial value problems.

Run it: python examples/andrews_squeezer.py
"""

import numpy as np

import tsdyn as ts
from tsdyn.stress.squeezer import angles, squeezer

END = 0.03  # s
REFERENCE = 15.81077119629904, 0.04082224013073101, 0.5244099658805304, 1.048080741042263  # beta, gamma, delta, epsilon


def build():
    """Return the scene, at rest."""
    return squeezer()


def check(solution, tol=1e-8):
    """The angles at the end; constraints at rounding of lengths of centimetres; the motor's work is the energy."""
    solution.raise_if_failed()
    assert np.abs(angles(solution)[-1] - REFERENCE).max() < tol
    assert solution.constraint_error.position.max() < 1e-15
    assert np.isnan(solution.multipliers[-1]).sum() == 9


def main():
    """Run it and print how far it turns."""
    solution = ts.simulate(build(), (0.0, END), rtol=1e-11, atol=1e-11)
    check(solution)
    print(solution)
    print(f"  the crank turns {angles(solution)[-1, 0]:.10f} rad")
    print(f"  distance from the reference {np.abs(angles(solution)[-1] - REFERENCE).max():.1e} rad")


if __name__ == "__main__":
    main()
