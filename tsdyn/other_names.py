"""Names that other programs have for what tsdyn has under another name: hints of error messages."""

import inspect
import re

from .errors import UnknownAttribute
from .validation import close, nearest

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
PUBLIC = "Scene", "Solution", "Ensemble", "State"  # their subclasses are called by the same names
RUNS = "simulate", "run", "solve"  # what a scene has in other programs
ATTRIBUTES = {  # of scenes, solutions, ensembles and states; what an object has of these is named
    "add_rigid_body": ("add_body(...)",),
    "add_particle": ("add_point_mass(...)",),
    "add_joint": ("add(joint)",),
    "add_constraint": ("add(constraint)",),
    "add_force": ("add(force)",),
    "joints": ("constraints", "scene.constraints"),
    "dof": ("mobility().degrees_of_freedom", "scene.mobility().degrees_of_freedom"),
    "bodies": ("scene.bodies",),
    "x": ("q", "position(body)", "case(i).position(body)"),
    "y": ("q", "qd"),
    "time": ("t",),
    "times": ("t",),
    "sol": ("at(t)",),
    "y_events": ("q_events", "qd_events"),
    "nfev": ("stats.evaluations",),
    "njev": ("stats.jacobians",),
    "position": ("case(i).position(body)",),
    "positions": ("q", "position(body)", "case(i).position(body)"),
    "pos": ("q", "position(body)", "case(i).position(body)"),
    "v": ("qd", "velocity(body)"),
    "vel": ("qd", "velocity(body)"),
    "velocity": ("qd", "case(i).velocity(body)"),
    "velocities": ("qd", "velocity(body)"),
    "a": ("qdd", "acceleration(body)"),
    "acc": ("qdd", "acceleration(body)"),
    "accelerations": ("qdd", "acceleration(body)"),
    "dq": ("qd",),
    "qdot": ("qd",),
    "ddq": ("qdd",),
    "qddot": ("qdd",),
    "quaternion": ("orientation(body)",),
    "omega": ("angular_velocity(body)",),
    "lam": ("multipliers",),
    "lambda_": ("multipliers",),
    "forces": ("reaction(item)",),
    "reactions": ("reaction(item)",),
    "errors": ("constraint_error",),
    "animate": ("view()",),
    "to_pandas": ("to_dataframe()",),
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


def lacking(owner, name):
    """Return the error of an attribute that an object of ours lacks, for `__getattr__`.

    Raises the own error of a property that has failed: Python asks `__getattr__` then, too.
    """
    kinds = type(owner).__mro__
    kind = next((cls.__name__ for cls in kinds if cls.__name__ in PUBLIC), kinds[0].__name__)
    said = f"{kind!r} object has no attribute {name!r}"
    if name.startswith("_"):  # of a protocol
        return AttributeError(said)
    if hasattr(kinds[0], name):
        return object.__getattribute__(owner, name)
    known = {*dir(owner), *(word for cls in kinds for word in inspect.get_annotations(cls))}
    here = [f"{kind.lower()}.{word}" for word in ATTRIBUTES.get(name, ()) if re.match(r"\w+", word)[0] in known]
    if kind == "Scene" and name in RUNS:
        here = ["ts.simulate(scene, t_span)"]
    near = nearest(name, [word for word in known if not word.startswith("_")])
    return UnknownAttribute(said + (f"; here it is {' or '.join(here)}." if here else near))


def argument(name, known):
    """Return what an argument is called here, or None."""
    here = ARGUMENTS.get(name)
    return here if here in known else None
