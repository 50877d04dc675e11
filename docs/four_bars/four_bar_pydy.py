"""The four-bar in PyDy: Kane's method with dependent angles and speeds. pip install pydy."""

import data
import numpy as np
from pydy.system import System
from scipy.integrate import odeint
from sympy import symbols
from sympy.physics.mechanics import KanesMethod, Point, ReferenceFrame, RigidBody, dynamicsymbols, inertia

g = symbols("g")
q, u = dynamicsymbols("q:3"), dynamicsymbols("u:3")
N, O = ReferenceFrame("N"), Point("O")
O.set_vel(N, 0)
pin, bodies, loads = O, [], []
for i, length in enumerate((0.3, 0.9, 0.7)):
    frame = N.orientnew(f"F{i}", "Axis", (q[i], N.z))
    frame.set_ang_vel(N, u[i] * N.z)
    middle = pin.locatenew(f"M{i}", length / 2 * frame.x)
    middle.v2pt_theory(pin, N, frame)
    last = pin.locatenew(f"P{i}", length * frame.x)
    last.v2pt_theory(pin, N, frame)
    bodies.append(RigidBody(f"B{i}", middle, frame, data.MASSES[i], (inertia(frame, 0, 0, data.INERTIAS[i]), middle)))
    loads.append((middle, -data.MASSES[i] * g * N.y))
    pin = last
gap = pin.pos_from(O) - 0.8 * N.x
holonomic = [gap & N.x, gap & N.y]
rates = {q[i].diff(): u[i] for i in range(3)}
kane = KanesMethod(
    N, q_ind=[q[0]], q_dependent=q[1:], u_ind=[u[0]], u_dependent=u[1:],
    kd_eqs=[q[i].diff() - u[i] for i in range(3)],
    configuration_constraints=holonomic, velocity_constraints=[(pin.vel(N) & axis).subs(rates) for axis in (N.x, N.y)],
)  # fmt: skip
kane.kanes_equations(bodies, loads)
start = {**dict(zip(q, data.ANGLES, strict=True)), **dict(zip(u, data.rates(), strict=True))}
times = np.linspace(0, data.END, 201)


def tight(*arguments, **options):
    """SciPy's odeint at tight tolerances."""
    return odeint(*arguments, **options, rtol=1e-10, atol=1e-10)


system = System(kane, ode_solver=tight, constants={g: data.GRAVITY}, initial_conditions=start, times=times)
states = system.integrate()
angle, x = states[-1, 0], states[-1]
end = sum(length * np.array([np.cos(x[i]), np.sin(x[i])]) for i, length in enumerate((0.3, 0.9, 0.7)))
data.report("PyDy", angle, np.linalg.norm(end - data.D))
