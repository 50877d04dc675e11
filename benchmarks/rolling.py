"""Rolling in tsdyn, MuJoCo and Exudyn: error against time.

A coin in a steady turn (examples/coin.py) for one turn of 2.5 s; the same coin, which nods as it rolls, as long; and a
ball on a turntable (examples/turntable.py) for one of its turns, pi s. References are closed forms, and of the coin
that nods Newton's and Euler's equations about its contact point, by DOP853 at 1e-13. MuJoCo holds rolling by contact
with friction, as stiff as the step allows; Exudyn has a joint of a rolling disc, none of a ball. Engines that aren't
installed are left out.

Run it: python -m benchmarks.rolling
"""

import importlib.util
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import tsdyn as ts
from examples import coin, turntable

STEPS, TOLERANCES, ROUNDS = (1e-2, 1e-3, 1e-4), (1e-4, 1e-8, 1e-12), 3
LEAN, TURN = 0.5, 2.5
COIN_END, BALL_END = 2.0 * np.pi / TURN, np.pi
NODDING = 0.5, (0.6, 7.0, 1.5)  # lean, rad, and angular velocity, rad/s
UP = np.array([0.0, 0.0, 1.0])


def ours(build, name, end, tol):
    """Seconds of the run, and where the centre is at its end."""
    run = ts.prepare(build(), rtol=tol, atol=tol)
    solution = run((0.0, end), t_eval=[end])
    return solution.stats.seconds["run"], solution.position(name)[-1]


def free_body(name, mass, inertia, position, velocity, quaternion, omega, geom):
    """MJCF of a body and its state; omega in its frame."""
    numbers = " ".join(map(str, inertia))
    body = (
        f'<body name="{name}" pos="{" ".join(map(str, position))}" quat="{" ".join(map(str, quaternion))}"><freejoint/>'
        f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{numbers}"/>{geom}</body>'
    )
    return body, (*velocity, *omega)


def mujoco(world, speeds, name, end, step):
    """The same of MuJoCo by its Runge-Kutta method; speeds are those of all joints."""
    import mujoco

    count = round(end / step)
    step = end / count
    contact = f'solref="{2 * step} 1" solimp="0.9999 0.9999 1e-3" friction="10 0 0" condim="3"'
    option = f'<option timestep="{step}" integrator="RK4" cone="elliptic" impratio="100" tolerance="1e-12"/>'
    text = f"<mujoco>{option}<default><geom {contact}/></default><worldbody>{world}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[:] = speeds
    began = time.perf_counter()
    for _ in range(count):
        mujoco.mj_step(model, data)
    return time.perf_counter() - began, data.body(name).xpos.copy()


def steady():
    """The coin in a steady turn."""
    return coin.build(LEAN, TURN)


def nodding():
    """The coin in a motion that is not steady."""
    return coin.rolling(*NODDING)


def after_nodding():
    """Where its centre is at the end: (I - m rho x rho x) omega' = m rho x (rho' x omega + g) - omega x I omega.

    rho: from the centre to the contact point; I = A 1 + (J - A) n n^T with the axis n.
    """
    body, a, m = nodding()["coin"], coin.RADIUS, coin.MASS
    A = Rotation.from_quat(np.roll(body.orientation, -1))

    def rates(_, y):
        n, omega, turned = y[:3], y[3:6], np.cross(y[3:6], y[:3])
        u, du = UP - n[2] * n, -turned[2] * n - n[2] * turned
        size = np.linalg.norm(u)
        rho, drho = -a * u / size, -a * (du / size - u * (u @ du) / size**3)
        inertia = coin.ACROSS * np.eye(3) + (coin.ALONG - coin.ACROSS) * np.outer(n, n)
        whole = inertia + m * ((rho @ rho) * np.eye(3) - np.outer(rho, rho))
        load = m * np.cross(rho, np.cross(drho, omega) + coin.GRAVITY * UP) - np.cross(omega, inertia @ omega)
        return np.concatenate([turned, np.linalg.solve(whole, load), np.cross(rho, omega)])

    start = np.concatenate([A.apply((0, 1, 0)), A.apply(np.array(body.angular_velocity)), body.position])
    return solve_ivp(rates, (0.0, COIN_END), start, "DOP853", rtol=1e-13, atol=1e-13).y[6:, -1]


def coin_state(build):
    """A coin: mass, inertia, position, velocity, quaternion, omega in its frame."""
    body = build()["coin"]
    return (
        coin.MASS,
        (coin.ACROSS, coin.ALONG, coin.ACROSS),
        *(np.array(x) for x in (body.position, body.velocity, body.orientation, body.angular_velocity)),
    )


def mujoco_coin(step, build):
    """A thin cylinder about y."""
    geom = f'<geom type="cylinder" size="{coin.RADIUS} 1e-4" euler="90 0 0"/>'
    body, speeds = free_body("coin", *coin_state(build), geom)
    return mujoco(f'<geom type="plane" size="5 5 1"/>{body}', speeds, "coin", COIN_END, step)


def mujoco_ball(step):
    """A ball on a disc whose hinge keeps its rate by a large inertia."""
    ball = turntable.build()["ball"]
    geom = f'<geom type="sphere" size="{turntable.RADIUS}"/>'
    inertia = (0.4 * turntable.MASS * turntable.RADIUS**2,) * 3
    state = ball.position, ball.velocity, (1, 0, 0, 0), ball.angular_velocity
    body, speeds = free_body("ball", turntable.MASS, inertia, *state, geom)
    table = (
        '<body><joint type="hinge" axis="0 0 1"/><inertial pos="0 0 -0.1" mass="1" diaginertia="1e9 1e9 1e9"/>'
        '<geom type="cylinder" size="2 0.1" pos="0 0 -0.1"/></body>'
    )
    return mujoco(table + body, (turntable.RATE, *speeds), "ball", BALL_END, step)


def exudyn_coin(step, build):
    """A joint of a rolling disc, by the generalised-alpha method."""
    import exudyn as exu
    from exudyn import utilities as ex

    mbs = exu.SystemContainer().AddSystem()
    mass, inertia, position, velocity, quaternion, omega = coin_state(build)
    made = mbs.CreateRigidBody(
        referencePosition=list(position), initialVelocity=list(velocity), gravity=[0, 0, -coin.GRAVITY],
        referenceRotationMatrix=Rotation.from_quat(np.roll(quaternion, -1)).as_matrix(),
        initialAngularVelocity=list(Rotation.from_quat(np.roll(quaternion, -1)).apply(omega)),
        inertia=ex.RigidBodyInertia(mass=mass, inertiaTensor=np.diag(inertia)),
    )  # fmt: skip
    ground = mbs.AddMarker(ex.MarkerBodyRigid(bodyNumber=mbs.AddObject(ex.ObjectGround())))
    disc = mbs.AddMarker(ex.MarkerBodyRigid(bodyNumber=made))
    mbs.AddObject(
        ex.ObjectJointRollingDisc(
            markerNumbers=[ground, disc], discRadius=coin.RADIUS, discAxis=[0, 1, 0], planeNormal=[0, 0, 1]
        )
    )
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode, settings.timeIntegration.endTime = 0, COIN_END
    settings.timeIntegration.numberOfSteps = round(COIN_END / step)
    settings.timeIntegration.newton.useModifiedNewton = True
    began = time.perf_counter()
    mbs.SolveDynamic(settings)
    return time.perf_counter() - began, np.array(mbs.GetObjectOutputBody(made, exu.OutputVariableType.Position))


def contenders():
    """(motion, program, name of the setting, settings, run, exact end)."""
    coins = ("coin", steady, steady()["coin"].position), ("nodding", nodding, after_nodding())
    ball = np.append(turntable.circle(np.array([BALL_END]))[0], turntable.RADIUS)
    tolerance = "tolerance", TOLERANCES
    for motion, build, end in coins:
        yield motion, "tsdyn", *tolerance, lambda tol, build=build: ours(build, "coin", COIN_END, tol), end
        if importlib.util.find_spec("exudyn"):
            yield motion, "Exudyn", "step", STEPS, lambda step, build=build: exudyn_coin(step, build), end
        if importlib.util.find_spec("mujoco"):
            yield motion, "MuJoCo", "step", STEPS, lambda step, build=build: mujoco_coin(step, build), end
    yield "turntable", "tsdyn", *tolerance, lambda tol: ours(turntable.build, "ball", BALL_END, tol), ball
    if importlib.util.find_spec("mujoco"):
        yield "turntable", "MuJoCo", "step", STEPS, mujoco_ball, ball


def main():
    """Print the error of the centre at the end, and milliseconds, the least of some rounds."""
    print("motion     program  setting              error (m)   time (ms)")
    for motion, program, setting, values, run, exact in contenders():
        for value in values:
            found = [run(value) for _ in range(ROUNDS)]
            error = np.linalg.norm(found[-1][1] - exact)
            print(
                f"{motion:10} {program:8} {setting:9} {value:6.0e} {error:14.1e} {1e3 * min(s for s, _ in found):11.2f}"
            )


if __name__ == "__main__":
    main()
