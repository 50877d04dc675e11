"""Scenes in other units of length, mass and time."""

from typing import NamedTuple

import numpy as np

import tsdyn as ts

C = ts.constraints


class Units(NamedTuple):
    """Units in terms of SI."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    def scene(self):
        return ts.Scene(gravity=(0, 0, -9.81 * self.length / self.time**2))

    def run(self, make, tol):
        """Run make(units), a scene and its end: the solution, and the last places of bodies in these units."""
        scene, end = make(self)
        method = ts.integrators.Taylor(rtol=tol, atol=tol * min(self.length, self.length / self.time, 1.0))
        solution = ts.simulate(scene, (0, end * self.time), integrator=method).raise_if_failed()
        return solution, np.array([solution.position(body)[-1] / self.length for body in scene.bodies])

    def floor(self, body, point, base=None, at=(0, 0, 0), **law):
        base = body.scene.ground if base is None else base
        at = {"point_a": point, "point_b": at, "normal_b": (0, 0, 1), "unilateral": True}
        body.scene.add(C.PlaneContact(body, base, **at, **law))
