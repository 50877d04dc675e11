"""Names that other programs have for what tsdyn has under another name: hints of error messages."""

from .validation import close

CLASSES = {  # of constraints, forces and integrators, in small letters and without "joint"
    "hinge": "constraints.Revolute",
    "pin": "constraints.Revolute",
    "prismatic": "constraints.Translational",
    "slider": "constraints.Translational",
    "weld": "constraints.Fixed",
    "rigid": "constraints.Fixed",
    "ball": "constraints.Spherical",
    "ballandsocket": "constraints.Spherical",
    "cardan": "constraints.Universal",
    "helical": "constraints.Screw",
    "rod": "constraints.Distance",
    "motor": "constraints.RotationMotor",
    "pointonplane": "constraints.PlaneContact",
    "mimic": "constraints.Gear",
    "damper": "forces.Spring, with damping=",
    "springdamper": "forces.Spring",
    "tsda": "forces.Spring",
    "linearspring": "forces.Spring",
    "rsda": "forces.TorsionalSpring",
    "torsionspring": "forces.TorsionalSpring",
    "force": "forces.PointForce",
    "actuator": "forces.JointTorque or ts.forces.JointForce",
    "friction": "forces.RevoluteFriction, ts.forces.TranslationalFriction or ts.forces.CoulombFriction",
    "gravity": "Scene(gravity=(0, 0, -9.81))",
    "rk4": "integrators.Nystrom4",
    "rungekutta4": "integrators.Nystrom4",
    "dopri5": "integrators.RK45",
    "bdf": "integrators.Radau",
    "radauiia": "integrators.Radau",
    "world": "Scene",
    "system": "Scene",
    "model": "Scene",
    "multibodyplant": "Scene",
    "rigidbody": "Scene().add_body(...)",
    "particle": "Scene().add_point_mass(...)",
    "simulation": "simulate(scene, t_span)",
    "solve": "simulate(scene, t_span)",
    "solve_ivp": "simulate(scene, t_span)",
    "run": "prepare(scene, ...), which returns a ts.Run, or ts.simulate(scene, t_span)",
}
METHODS = {  # of a scene
    "add_rigid_body": "scene.add_body(...)",
    "add_particle": "scene.add_point_mass(...)",
    "add_joint": "scene.add(joint)",
    "add_constraint": "scene.add(constraint)",
    "add_force": "scene.add(force)",
    "simulate": "ts.simulate(scene, t_span)",
    "run": "ts.simulate(scene, t_span)",
    "solve": "ts.simulate(scene, t_span)",
    "joints": "scene.constraints",
    "dof": "scene.mobility().degrees_of_freedom",
}
ARGUMENTS = {
    "method": "integrator",
    "solver": "integrator",
    "t_end": "t_span",
    "tspan": "t_span",
    "tol": "rtol",
    "k": "stiffness",
    "c": "damping",
    "d": "damping",
    "l0": "free_length",
    "rest_length": "free_length",
    "m": "mass",
    "J": "inertia",
    "I": "inertia",
    "pos": "position",
    "quat": "orientation",
    "rotation": "orientation",
    "omega": "angular_velocity",
    "mu": "kinetic",
    "friction": "kinetic",
}


ELSEWHERE = {}  # of calls by their title: arguments that another call takes, and which; entered where both are known


def hint(where, name, known):
    """Return the end of a sentence on a name that is not in ts, or in a module of it: what may have been meant."""
    plain = name.lower().replace("_", "") if name.lower() not in CLASSES else name.lower()
    found = CLASSES.get(plain.removesuffix("joint").removesuffix("constraint") or plain)
    if found is not None:
        return f"; here it is ts.{found}."
    near = close(name, known)
    return f"; did you mean {' or '.join(f'{where}.{word}' for word in near)}?" if near else f"; see dir({where})."


def argument(name, known):
    """Return what an argument is called here, or None."""
    here = ARGUMENTS.get(name)
    return here if here in known else None
