"""Contacts in tsdyn, MuJoCo, Exudyn and Drake: error against time.

- ball: it falls from 1 m and bounces with e = 0.8; the error is that of its height after 1.5 s, in the third flight.
- rocking: a slender block rocks on smooth ground, by plastic impacts of its edges; the error is that of its tilt after
  0.2 s, between the first and the second impact. The reference: the closed form of the impact, DOP853 before and after.
- chain: five links fall on a smooth floor, and their ends bounce one after the other with e = 0.8; the error is that of
  the first end's height after 0.3 s. The reference: minimal coordinates, DOP853 between the impacts.
- slope: a block rests on a slope below the angle of friction; the error is how far it has moved after 10 s.

Contacts of the other programs are compliant, here as stiff as the step allows; Drake has no coefficient of restitution.
Exudyn is left out on the slope, where a run with a step of 1e-4 s doesn't end within two minutes.
Engines that aren't installed are left out.

Run it: python -m benchmarks.contacts
"""

import importlib.util
import time
from importlib import metadata

import numpy as np
from scipy.integrate import solve_ivp

import tsdyn as ts

STEPS, TOLERANCES, ROUNDS = (1e-3, 1e-4), (1e-4, 1e-8, 1e-12), 2
G, E, BALL_END = 9.81, 0.8, 1.5
HALF_WIDTH, HALF_HEIGHT, TILT, ROCKING_END = 0.2, 0.5, 0.1, 0.2  # m, m, rad, s
ANGLE, FRICTION, SLOPE_END = 0.3, 0.5, 10.0  # rad, -, s
LINKS, LINK, LINK_MASS, BEND, DROP, CHAIN_END = 5, 0.2, 0.1, 0.25, 0.05, 0.3  # -, m, kg, rad, m, s
LINK_INERTIA = LINK_MASS * LINK**2 / 12
ANGLES = [BEND * (1 + i / 7) * (-1) ** i for i in range(LINKS)]  # from x to z
MASS = 2.0
INERTIA = MASS * (HALF_WIDTH**2 + HALF_HEIGHT**2) / 3
HEIGHT = HALF_HEIGHT * np.cos(TILT) + HALF_WIDTH * np.sin(TILT)


def timed(run):
    """Seconds of processor time of a call, and what it returns."""
    began = time.process_time()
    found = run()
    return time.process_time() - began, found


# The references


def ball():
    """Height of a ball, by its flights."""
    fall = np.sqrt(2 / G)
    t, rate = BALL_END - fall, E * G * fall
    while t > 2 * rate / G:
        t, rate = t - 2 * rate / G, E * rate
    return rate * t - G * t * t / 2


def rocking():
    """Tilt of the block: energy to the impact, the rate after it, and the equation of motion about the other edge."""
    b, h, own = HALF_WIDTH, HALF_HEIGHT, INERTIA / MASS

    def rates(_, y):
        x, rate = y
        arm, drop = b * np.cos(x) - h * np.sin(x), -b * np.sin(x) - h * np.cos(x)
        return rate, -arm * (G + drop * rate**2) / (own + arm * arm)

    def flat(_, y):
        return y[0]

    flat.terminal = True
    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15}
    first = solve_ivp(rates, (0.0, 1.0), (TILT, 0.0), events=flat, **options)
    rate = -first.y[1, -1] * (own - b * b) / (own + b * b)
    return -solve_ivp(rates, (first.t[-1], ROCKING_END), (0.0, rate), **options).y[0, -1]


def chain():
    """Height of the first end: coordinates are its place x, z, and the angles of the links."""
    n = LINKS + 2
    arms = [LINK * (np.arange(LINKS) < i) for i in range(LINKS + 1)]  # of the ends
    arms += [LINK * ((np.arange(LINKS) < i) + 0.5 * (np.arange(LINKS) == i)) for i in range(LINKS)]  # of the centroids
    arms = np.array(arms)

    def points(x):
        """Jacobians (points, 2, n) of all points, and their centripetal directions (points, 2, LINKS)."""
        c, s = np.cos(x[2:]), np.sin(x[2:])
        moved = np.zeros((len(arms), 2, n))
        moved[:, 0, 0] = moved[:, 1, 1] = 1.0
        moved[:, :, 2:] = np.stack([-arms * s, arms * c], axis=1)
        return moved, np.stack([-arms * c, -arms * s], axis=1)

    def mass(x):
        moved, bent = points(x)
        M = LINK_MASS * np.einsum("pin,pim->nm", moved[LINKS + 1 :], moved[LINKS + 1 :])
        M[2:, 2:] += LINK_INERTIA * np.eye(LINKS)
        return M, moved, bent

    def rates(_, y):
        M, moved, bent = mass(y[:n])
        a = bent[LINKS + 1 :] @ y[n + 2 :] ** 2 + [0, G]
        return np.append(y[n:], np.linalg.solve(M, -LINK_MASS * np.einsum("pin,pi->n", moved[LINKS + 1 :], a)))

    def height(i, begun):
        def value(t, y):
            return y[1] + arms[i] @ np.sin(y[2:n]) if t > begun[i] + 1e-6 else 1.0

        value.terminal, value.direction = True, -1
        return value

    t, y, begun = 0.0, np.array([0, DROP, *ANGLES, *np.zeros(n)], float), np.full(LINKS + 1, -1.0)
    while True:
        heights = [height(i, begun) for i in range(LINKS + 1)]
        run = solve_ivp(rates, (t, CHAIN_END), y, "DOP853", events=heights, rtol=1e-13, atol=1e-15, max_step=2e-3)
        t, y = run.t[-1], run.y[:, -1]
        if run.status != 1:
            return y[1]
        i = next(i for i, times in enumerate(run.t_events) if times.size)
        M, moved, _ = mass(y[:n])
        J, begun[i] = moved[i, 1], t
        y[n:] -= np.linalg.solve(M, J) * (1 + E) * (J @ y[n:]) / (J @ np.linalg.solve(M, J))


# The same in tsdyn


def ours(build, end, tol):
    """Seconds, and the solution at the end; kernels and phases are prepared by a first run."""
    scene = build()
    ts.simulate(scene, (0.0, end), rtol=tol, atol=tol)
    return timed(lambda: ts.simulate(scene, (0.0, end), t_eval=[end], rtol=tol, atol=tol))


def ours_ball(tol):
    """A point mass over a plane."""

    def build():
        scene = ts.Scene(gravity=(0, 0, -G))
        body = scene.add_point_mass(1.0, (0, 0, 1.0), name="ball")
        contact = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": E}
        scene.add(ts.constraints.PlaneContact(body, scene.ground, **contact))
        return scene

    seconds, solution = ours(build, BALL_END, tol)
    return seconds, solution.position("ball")[-1, 2]


def ours_rocking(tol):
    """A block with two edges."""

    def build():
        scene, turned = ts.Scene(gravity=(0, 0, -G)), (np.cos(TILT / 2), 0, np.sin(TILT / 2), 0)
        block = scene.add_body(MASS, (INERTIA,) * 3, (0, 0, HEIGHT), turned, name="block")
        scene.add(ts.constraints.Parallel(block, scene.ground, axis_a=(0, 1, 0), axis_b=(0, 1, 0)))
        for x in (-HALF_WIDTH, HALF_WIDTH):
            edge = {"point_a": (x, 0, -HALF_HEIGHT), "normal_b": (0, 0, 1), "unilateral": True}
            scene.add(ts.constraints.PlaneContact(block, scene.ground, **edge))
        return scene

    seconds, solution = ours(build, ROCKING_END, tol)
    return seconds, 2 * np.arctan2(*solution.orientation("block")[-1, [2, 0]])


def links():
    """The links on hinges, above the floor, without contacts."""
    scene, tip, last = ts.Scene(gravity=(0, 0, -G)), np.array([0, 0, DROP]), None
    for i, angle in enumerate(ANGLES):
        along, turned = (
            LINK * np.array([np.cos(angle), 0, np.sin(angle)]),
            (np.cos(angle / 2), 0, -np.sin(angle / 2), 0),
        )
        body = scene.add_body(LINK_MASS, (LINK_INERTIA,) * 3, tip + along / 2, turned, name=f"link {i}")
        if last is None:
            scene.add(ts.constraints.Planar.at(scene.ground, body, point=tip, axis=(0, 1, 0)))
        else:
            scene.add(ts.constraints.Revolute.at(last, body, point=tip, axis=(0, -1, 0)))
        last, tip = body, tip + along
    return scene


def ends(scene):
    """Bodies and points of a chain that touch the floor."""
    bodies = scene.bodies
    return [(bodies[0], (-LINK / 2, 0, 0)), *((body, (LINK / 2, 0, 0)) for body in bodies)]


def ours_chain(tol):
    """With contacts of the ends."""

    def build():
        scene = links()
        for body, point in ends(scene):
            contact = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": E}
            scene.add(ts.constraints.PlaneContact(body, scene.ground, point_a=point, **contact))
        return scene

    seconds, solution = ours(build, CHAIN_END, tol)
    return seconds, solution.position("link 0", point=(-LINK / 2, 0, 0))[-1, 2]


def ours_slope(tol):
    """A block that slides in a plane, with friction by its normal force."""

    def build():
        scene = ts.Scene(gravity=(G * np.sin(ANGLE), 0, -G * np.cos(ANGLE)))
        block = scene.add_body(MASS, (INERTIA,) * 3, name="block")
        scene.add(ts.constraints.Parallel(block, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 0, 1)))
        table = scene.add(ts.constraints.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
        scene.add(ts.forces.ContactFriction(table, kinetic=FRICTION))
        return scene

    seconds, solution = ours(build, SLOPE_END, tol)
    return seconds, solution.position("block")[-1, 0]


# In MuJoCo: contacts of a time constant and a damping ratio

PLANAR = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 1 0"/>'
BOX = f'<geom type="box" size="{HALF_WIDTH} 0.3 {HALF_HEIGHT}"/>'


def mujoco(step, end, contact, body, gravity=(0, 0, -G), start=(0, 0, 0)):
    """Coordinates x, z (from where the body is put) and tilt of a body in a plane, at the end."""
    inertia = f'<inertial pos="0 0 0" mass="{MASS}" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>'
    bodies = f'<body pos="0 0 {body[0]}">{PLANAR}{inertia}{body[1]}</body>'
    return mujoco_run(step, end, contact, bodies, gravity, start)


def mujoco_run(step, end, contact, bodies, gravity, start):
    """Coordinates of bodies over a plane at the end. They collide with the plane alone."""
    import mujoco

    text = (
        f'<mujoco><option timestep="{step}" gravity="{" ".join(map(str, gravity))}" cone="elliptic" impratio="100"/>'
        f'<default><geom solimp="0.9999 0.9999 1e-3" contype="0" {contact}/></default><worldbody>'
        f'<geom type="plane" size="9 9 1" contype="1"/>{bodies}</worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = start

    def run():
        for _ in range(round(end / step)):
            mujoco.mj_step(model, data)
        return data.qpos.copy()

    return timed(run)


def mujoco_ball(step):
    """A sphere; e gives the damping ratio, and the time constant has five steps to a radian of the oscillation."""
    ratio = -np.log(E) / np.hypot(np.pi, np.log(E))
    contact = f'solref="{5 * step / ratio} {ratio}" condim="1"'
    seconds, x = mujoco(step, BALL_END, contact, (1.1, '<geom type="sphere" size="0.1"/>'))
    return seconds, x[1] + 1.0


def mujoco_chain(step):
    """Spheres at the ends of the links; contacts as those of the ball."""
    ratio, sphere = -np.log(E) / np.hypot(np.pi, np.log(E)), '<geom type="sphere" size="0.02" pos="{} 0 0"/>'
    numbers = f'mass="{LINK_MASS}" diaginertia="{LINK_INERTIA} {LINK_INERTIA} {LINK_INERTIA}"'
    link = f'<joint type="hinge" axis="0 -1 0"/><inertial pos="{LINK / 2} 0 0" {numbers}/>{sphere.format(LINK)}'
    first = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>' + link + sphere.format(0)
    bodies = f'<body pos="0 0 {DROP + 0.02}">{first}' + f'<body pos="{LINK} 0 0">{link}' * (LINKS - 1)
    contact, start = f'solref="{5 * step / ratio} {ratio}" condim="1"', (0, 0, ANGLES[0], *np.diff(ANGLES))
    seconds, x = mujoco_run(step, CHAIN_END, contact, bodies + "</body>" * LINKS, (0, 0, -G), start)
    return seconds, x[1] + DROP


def mujoco_rocking(step):
    """A box without friction."""
    contact = f'solref="{2 * step} 1" condim="1"'
    seconds, x = mujoco(step, ROCKING_END, contact, (0.0, BOX), start=(0, HEIGHT, TILT))
    return seconds, x[2]


def mujoco_slope(step):
    """A box with friction; gravity is turned."""
    contact = f'solref="{2 * step} 1" friction="{FRICTION} 0 0"'
    gravity = G * np.sin(ANGLE), 0, -G * np.cos(ANGLE)
    seconds, x = mujoco(step, SLOPE_END, contact, (HALF_WIDTH, BOX.replace(str(HALF_HEIGHT), str(HALF_WIDTH))), gravity)
    return seconds, x[0]


# In Drake: its discrete solver, small spheres at the corners of a box


def drake(step, end, half_height, friction, gravity, height, tilt=0.0):
    """Coordinates x and tilt of a block at the end."""
    import pydrake.all as d

    builder = d.DiagramBuilder()
    plant, _ = d.AddMultibodyPlantSceneGraph(builder, time_step=step)
    plant.mutable_gravity_field().set_gravity_vector(gravity)
    inertia = d.SpatialInertia(MASS, np.zeros(3), d.UnitInertia(*(INERTIA / MASS,) * 3))
    block, law = plant.AddRigidBody("block", inertia), d.CoulombFriction(friction, friction)
    radius = 1e-6
    for i, (x, y) in enumerate([(1, 1), (1, -1), (-1, -1), (-1, 1)]):
        place = d.RigidTransform([x * HALF_WIDTH, 0.3 * y, radius - half_height])
        plant.RegisterCollisionGeometry(block, place, d.Sphere(radius), f"corner {i}", law)
    plant.RegisterCollisionGeometry(plant.world_body(), d.RigidTransform(), d.HalfSpace(), "ground", law)
    plant.Finalize()
    simulator = d.Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    pose = d.RigidTransform(d.RotationMatrix.MakeYRotation(tilt), [0, 0, height])
    plant.SetFreeBodyPose(context, block, pose)
    simulator.Initialize()

    def run():
        simulator.AdvanceTo(end)
        found = plant.EvalBodyPoseInWorld(context, block)
        R = found.rotation().matrix()
        return found.translation()[0], np.arctan2(R[0, 2], R[0, 0])

    return timed(run)


def drake_rocking(step):
    """Without friction."""
    seconds, found = drake(step, ROCKING_END, HALF_HEIGHT, 0.0, (0, 0, -G), HEIGHT, TILT)
    return seconds, found[1]


def drake_slope(step):
    """A low block, gravity turned."""
    gravity = G * np.sin(ANGLE), 0, -G * np.cos(ANGLE)
    seconds, found = drake(step, SLOPE_END, HALF_WIDTH, FRICTION, gravity, HALF_WIDTH)
    return seconds, found[0]


# In Exudyn: generalised-alpha; spheres at the points that touch, and a large triangle


def exudyn(scene, points, step, end, mass, e=0.0):
    """Seconds, and places and rotations of the bodies at the end; twenty steps to a period of `mass` on a contact."""
    import exudyn as exu
    from exudyn import utilities

    from tsdyn.measuring.engines import Exudyn

    made, radius, size = Exudyn(scene), 0.09, 100.0
    stiffness = mass * (2 * np.pi / (20 * step)) ** 2
    law = {"restitutionCoefficient": e, "impactModel": 2, "minimumImpactVelocity": 1e-3}
    law = law if e else {"contactDamping": 2 * np.sqrt(stiffness * mass)}
    corners = exu.Vector3DList([[-size, -size, -radius], [size, -size, -radius], [0, size, -radius]])
    ground = made._marker(scene.ground, (0, 0, 0))
    for body, point in points:
        node = made.mbs.AddNode(utilities.NodeGenericData(initialCoordinates=[0] * 4, numberOfDataCoordinates=4))
        contact = utilities.ObjectContactSphereTriangle(
            markerNumbers=[made._marker(body, point), ground], nodeNumber=node, sphereRadius=radius,
            trianglePoints=corners, contactStiffness=stiffness, **law,
        )  # fmt: skip
        made.mbs.AddObject(contact)
    made.mbs.Assemble()
    found = made.run(end, step, outputs=1, clock=time.process_time)
    return found.seconds, found.r[-1], found.A[-1]


def exudyn_ball(step):
    """A body without rotation."""
    scene = ts.Scene(gravity=(0, 0, -G))
    body = scene.add_body(MASS, (INERTIA,) * 3, (0, 0, 1.0))
    seconds, r, _ = exudyn(scene, [(body, (0, 0, 0))], step, BALL_END, MASS, E)
    return seconds, r[0, 2]


def exudyn_chain(step):
    """All ends, as in tsdyn."""
    scene = links()
    seconds, r, A = exudyn(scene, ends(scene), step, CHAIN_END, LINK_MASS, E)
    return seconds, (r[0] - A[0] @ (LINK / 2, 0, 0))[2]


def exudyn_rocking(step):
    """A block in a plane, on the two edges of its section."""
    scene, turned = ts.Scene(gravity=(0, 0, -G)), (np.cos(TILT / 2), 0, np.sin(TILT / 2), 0)
    block = scene.add_body(MASS, (INERTIA,) * 3, (0, 0, HEIGHT), turned)
    scene.add(ts.constraints.Planar.at(scene.ground, block, point=(0, 0, 0), axis=(0, 1, 0)))
    edges = [(block, (x, 0, -HALF_HEIGHT)) for x in (-HALF_WIDTH, HALF_WIDTH)]
    seconds, _, A = exudyn(scene, edges, step, ROCKING_END, MASS / 2)
    return seconds, np.arctan2(A[0, 0, 2], A[0, 0, 0])


RUNS = {
    "ball": (ball, {"tsdyn": ours_ball, "mujoco": mujoco_ball, "exudyn": exudyn_ball}),
    "chain": (chain, {"tsdyn": ours_chain, "mujoco": mujoco_chain, "exudyn": exudyn_chain}),
    "rocking": (
        rocking,
        {"tsdyn": ours_rocking, "mujoco": mujoco_rocking, "exudyn": exudyn_rocking, "pydrake": drake_rocking},
    ),
    "slope": (lambda: 0.0, {"tsdyn": ours_slope, "mujoco": mujoco_slope, "pydrake": drake_slope}),
}


PROGRAMS = {"tsdyn": "tsdyn", "mujoco": "MuJoCo", "exudyn": "Exudyn", "pydrake": "Drake, discrete"}
PACKAGES = {"pydrake": "drake"}


def cells(program, value, motion):
    """Error at the end and milliseconds, the least of some rounds; empty where a program hasn't the motion."""
    reference, runs = RUNS[motion]
    if program not in runs:
        return ["", ""]
    try:
        found = [runs[program](value) for _ in range(ROUNDS)]
    except ts.StepFailure:
        return ["gave up", ""]
    return [f"{abs(found[-1][1] - reference()):.1e}", f"{1e3 * min(seconds for seconds, _ in found):.2g}"]


def table(motions=tuple(RUNS)):
    """Yield the lines of a table in Markdown, of the programs that are installed."""
    yield f"| program | setting | {' | '.join(f'{motion} | ms' for motion in motions)} |"
    yield "|---|---|" + "---:|---:|" * len(motions)
    for program, title in PROGRAMS.items():
        if not importlib.util.find_spec(program):
            continue
        version = "" if program == "tsdyn" else f" {metadata.version(PACKAGES.get(program, program))}"
        for value in TOLERANCES if program == "tsdyn" else STEPS:
            setting = f"tolerance {value:.0e}" if program == "tsdyn" else f"step {value:g} s"
            row = [cell for motion in motions for cell in cells(program, value, motion)]
            yield f"| {title}{version} | {setting} | {' | '.join(row)} |"
            title = version = ""


def main():
    """Print the table as it grows."""
    for line in table():
        print(line, flush=True)


if __name__ == "__main__":
    main()
