"""What plug-ins are written with: constraints, joints, forces, friction and integration methods of your own.

The one module below `tsdyn` that is part of the public interface; the built-in classes in constraints/, forces/ and
integrators/ import from here, too. docs/plug-ins.md shows how.
"""

from .calls import Placing, fitting
from .elements.bodies import Ground, PointMass, ground_point, rotation_matrix
from .elements.element import Angle, Displacement, angles, displacements, in_frame
from .elements.force import Force, load, vector_load

from .elements.friction import (  # isort: skip
    AXIS, BEARING_ROWS, BodyFriction, JointFriction, act, act_series, along_and_across, bearing_series, coefficient,
    coefficient_series, direction_series, magnitude, optional, slip, slip_of, slip_series,
)  # fmt: skip
from .elements.joint import FramedJoint, Joint, across, beside, carried, turned_about

from .elements.loads import (  # isort: skip
    STATE, ByState, Given, GivenByState, GivenInBody, JointLoad, arguments_of, fill_state, fill_state_series,
    given_series, load_at, state_load,
)  # fmt: skip
from .elements.markers import Parameters, Point, Turn, Vector
from .elements.primitive import Primitive
from .elements.tolerances import PARALLEL
from .errors import InvalidArgument, InvalidConstraint, InvalidForce
from .jit.kernels import kernel, specialised, stack
from .jit.predicates import some
from .maths import vectors

from .maths.recurrences import (  # isort: skip
    angle, angle_about, angle_near, angle_series, cross, dot, exponential, inverse_root, product, quotient, root,
    rotated, rotated_back, rotation, scaled, sine_cosine, square,
)  # fmt: skip
from .methods.collocation import CollocationTableau
from .methods.diagonally_implicit import trapezoid_error

from .methods.explicit import (  # isort: skip
    call_accelerate, call_place, embedded_error, error_kernel, second_embedded_error, step_kernel, vector,
)  # fmt: skip
from .methods.integrator import (  # isort: skip
    Adaptive, Collocation, DiagonallyImplicit, ExplicitNystrom, ExplicitRungeKutta, Integrator,
)  # fmt: skip
from .methods.interpolants import DOP853 as DOP853_INTERPOLANT
from .methods.interpolants import linear_second
from .methods.tableau import ImplicitTableau, NystromTableau, RungeKuttaTableau
from .motions.expressions import Smooth
from .motions.prescribed import Motion
from .motions.signals import Signal, numbers_of
from .motions.tables import is_data
from .validation import finite, floats, not_negative, number, positive, shown, vector3, whole

__all__ = [
    "AXIS",
    "BEARING_ROWS",
    "DOP853_INTERPOLANT",
    "PARALLEL",
    "STATE",
    "Adaptive",
    "Angle",
    "BodyFriction",
    "ByState",
    "Collocation",
    "CollocationTableau",
    "DiagonallyImplicit",
    "Displacement",
    "ExplicitNystrom",
    "ExplicitRungeKutta",
    "Force",
    "FramedJoint",
    "Given",
    "GivenByState",
    "GivenInBody",
    "Ground",
    "ImplicitTableau",
    "Integrator",
    "InvalidArgument",
    "InvalidConstraint",
    "InvalidForce",
    "Joint",
    "JointFriction",
    "JointLoad",
    "Motion",
    "NystromTableau",
    "Parameters",
    "Placing",
    "Point",
    "PointMass",
    "Primitive",
    "RungeKuttaTableau",
    "Signal",
    "Smooth",
    "Turn",
    "Vector",
    "across",
    "act",
    "act_series",
    "along_and_across",
    "angle",
    "angle_about",
    "angle_near",
    "angle_series",
    "angles",
    "arguments_of",
    "bearing_series",
    "beside",
    "call_accelerate",
    "call_place",
    "carried",
    "coefficient",
    "coefficient_series",
    "cross",
    "direction_series",
    "displacements",
    "dot",
    "embedded_error",
    "error_kernel",
    "exponential",
    "fill_state",
    "fill_state_series",
    "finite",
    "fitting",
    "floats",
    "given_series",
    "ground_point",
    "in_frame",
    "inverse_root",
    "is_data",
    "kernel",
    "linear_second",
    "load",
    "load_at",
    "magnitude",
    "not_negative",
    "number",
    "numbers_of",
    "optional",
    "positive",
    "product",
    "quotient",
    "root",
    "rotated",
    "rotated_back",
    "rotation",
    "rotation_matrix",
    "scaled",
    "second_embedded_error",
    "shown",
    "sine_cosine",
    "slip",
    "slip_of",
    "slip_series",
    "some",
    "specialised",
    "square",
    "stack",
    "state_load",
    "step_kernel",
    "trapezoid_error",
    "turned_about",
    "vector",
    "vector3",
    "vector_load",
    "vectors",
    "whole",
]
