"""What plug-ins are written with: constraints, joints, forces, friction and integration methods of your own.

The one module below `tsdyn` that is part of the public interface; the built-in classes in constraints/, forces/ and
integrators/ import from here, too. docs/plug-ins.md shows how. `as` marks what is passed on for type checkers.
"""

from .calls import Placing as Placing, fitting as fitting
from .elements.bodies import (
    Ground as Ground,
    PointMass as PointMass,
    ground_point as ground_point,
    named as named,
    rotation_matrix as rotation_matrix,
)
from .elements.element import (
    Angle as Angle,
    Displacement as Displacement,
    angles as angles,
    chosen_coordinate as chosen_coordinate,
    displacements as displacements,
    geometry_of as geometry_of,
    in_frame as in_frame,
    rope_points as rope_points,
    stop_waiting as stop_waiting,
)
from .elements.force import Force as Force, load as load, vector_load as vector_load
from .elements.friction import (
    AXIS as AXIS,
    BEARING_ROWS as BEARING_ROWS,
    GUIDE as GUIDE,
    HEADING_ROWS as HEADING_ROWS,
    ORIENTATION as ORIENTATION,
    PIN as PIN,
    PLANE as PLANE,
    POINT_OF_BODY as POINT_OF_BODY,
    TANGENTIAL_ROWS as TANGENTIAL_ROWS,
    BodyFriction as BodyFriction,
    JointFriction as JointFriction,
    act as act,
    act_series as act_series,
    along_and_across as along_and_across,
    bearing_series as bearing_series,
    coefficient as coefficient,
    coefficient_series as coefficient_series,
    direction_series as direction_series,
    heading as heading,
    heading_series as heading_series,
    magnitude as magnitude,
    optional as optional,
    sliding as sliding,
    sliding_series as sliding_series,
    slip as slip,
    slip_of as slip_of,
    slip_series as slip_series,
    slip_velocity as slip_velocity,
    tangential as tangential,
    tangential_series as tangential_series,
)
from .elements.joint import (
    FramedJoint as FramedJoint,
    Joint as Joint,
    SumRow as SumRow,
    across as across,
    beside as beside,
    carried as carried,
    turned_about as turned_about,
)
from .elements.laws import (
    Action as Action,
    SceneLaw as SceneLaw,
    arguments_of as arguments_of,
    instants as instants,
    scene_law as scene_law,
)
from .elements.loads import (
    STATE as STATE,
    ByState as ByState,
    Given as Given,
    GivenByScene as GivenByScene,
    GivenByState as GivenByState,
    GivenInBody as GivenInBody,
    JointLoad as JointLoad,
    fill_state as fill_state,
    fill_state_series as fill_state_series,
    given_series as given_series,
    load_at as load_at,
    scene_load as scene_load,
    state_load as state_load,
    variant as variant,
)
from .elements.markers import Parameters as Parameters, Point as Point, Turn as Turn, Vector as Vector
from .elements.primitive import Primitive as Primitive
from .elements.tolerances import PARALLEL as PARALLEL, SLIP as SLIP, UNDIRECTED as UNDIRECTED
from .elements.unilateral import Side as Side, Unilateral as Unilateral
from .errors import (
    InvalidArgument as InvalidArgument,
    InvalidConstraint as InvalidConstraint,
    InvalidForce as InvalidForce,
)
from .jit.kernels import kernel as kernel, specialised as specialised, stack as stack
from .jit.predicates import some as some
from .maths import vectors as vectors
from .maths.recurrences import (
    angle as angle,
    angle_about as angle_about,
    angle_near as angle_near,
    angle_series as angle_series,
    cross as cross,
    dot as dot,
    exponential as exponential,
    inverse_root as inverse_root,
    product as product,
    quotient as quotient,
    root as root,
    rotated as rotated,
    rotated_back as rotated_back,
    rotation as rotation,
    scaled as scaled,
    sine_cosine as sine_cosine,
    square as square,
)
from .maths.tolerances import TYPED as TYPED
from .methods.collocation import CollocationTableau as CollocationTableau
from .methods.diagonally_implicit import trapezoid_error as trapezoid_error
from .methods.explicit import (
    call_accelerate as call_accelerate,
    call_place as call_place,
    embedded_error as embedded_error,
    error_kernel as error_kernel,
    second_embedded_error as second_embedded_error,
    step_kernel as step_kernel,
    vector as vector,
)
from .methods.integrator import (
    Adaptive as Adaptive,
    Collocation as Collocation,
    DiagonallyImplicit as DiagonallyImplicit,
    ExplicitNystrom as ExplicitNystrom,
    ExplicitRungeKutta as ExplicitRungeKutta,
    Integrator as Integrator,
)
from .methods.interpolants import DOP853 as DOP853_INTERPOLANT, linear_second as linear_second
from .methods.tableau import (
    ImplicitTableau as ImplicitTableau,
    NystromTableau as NystromTableau,
    RungeKuttaTableau as RungeKuttaTableau,
)
from .motions.elementary import Smooth as Smooth
from .motions.of_coordinates import (
    MOST as MOST_COORDINATES,
    ROWS as COORDINATE_SLOPE_ROWS,
    CoordinateFunction as CoordinateFunction,
    JointFunction as JointFunction,
    coordinate_function as coordinate_function,
    functions_of as functions_of,
    joint_function as joint_function,
    joint_slope as joint_slope,
    slope_series as slope_series,
)
from .motions.prescribed import Motion as Motion
from .motions.signals import Signal as Signal, numbers_of as numbers_of
from .motions.tables import is_data as is_data
from .motions.tracing import gate as gate
from .validation import (
    finite as finite,
    floats as floats,
    label as label,
    not_negative as not_negative,
    number as number,
    positive as positive,
    shown as shown,
    shown_for_handle as shown_for_handle,
    vector3 as vector3,
    whole as whole,
)
