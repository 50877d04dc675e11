"""A script as a user writes one: mypy --strict accepts it, see test_types.py and .ci/run."""

import numpy as np

import tsdyn as ts

scene = ts.Scene(gravity=(0.0, 0.0, -9.6))
crank = scene.add_body(**ts.shapes.cylinder(0.1, 1.0, mass=2.0), position=(0.5, 0.0, 0.0), name="crank")
rod = scene.add_body(mass=1.0, inertia=np.eye(3), position=[1.5, 0.0, 0.0])
pin = scene.add(ts.constraints.Revolute.at(scene.ground, crank, point=(0, 0, 0), axis=(0, 1, 0), name="pin"))
scene.add(ts.constraints.Spherical(crank, rod, point_a=(0.5, 0, 0), point_b=(-0.5, 0, 0)))
spring = scene.add(ts.forces.Spring(rod, scene.ground, point_b=(0, 0, 1), stiffness=100.0))
spring.stiffness = 2.0 * spring.stiffness
scene.gravity = (0.0, 0.0, -9.81)
freedom: int = scene.mobility().degrees_of_freedom
crank.mass = crank.mass + float(scene.assemble().moved) + float(scene.evaluate().Phi.max())


class Quarter:
    terminal = True

    def __call__(self, t: float, state: ts.State) -> float:
        return state.angle(pin) - 0.5 * np.pi + float(state.position(rod)[2])


solution = ts.simulate(scene, (0.0, 1.0), integrator=ts.integrators.Taylor(), events=Quarter(), t_eval=[0, 1])
force, torque = solution.raise_if_failed().reaction(pin)
peak: float = abs(force[:, 2]).max()
again = ts.simulate(scene, (1.0, 2.0), state=solution.state, rtol=1e-9)
print(solution.angle("pin")[-1], solution.energy[0], again.steps.h[0], again.stats.steps, again.status.sentence)
