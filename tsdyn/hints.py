"""Types of annotations: what public functions take and return, in terms of NumPy and of the scene's own classes.

Imported by type checkers alone, so that annotations cost nothing at run time.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .analyses.equilibrium import Equilibrium
from .analyses.linearise import Linearisation
from .configuration.assemble import AssemblyReport
from .configuration.mobility import Mobility, RedundantRow
from .elements.bodies import Attribute, Body, Ground, PointMass
from .elements.element import Attachment
from .elements.force import Force
from .elements.joint import Joint
from .elements.primitive import Primitive
from .ensembles.results import Ensemble
from .errors import TsdynError
from .importing.description import ImportReport
from .measuring.benchmark import Benchmark, Reference
from .measuring.phase_times import Phase
from .measuring.profile import Profile
from .methods.integrator import Integrator
from .model.handles import Handles
from .model.kinematics import Kinematics
from .model.packed import Packed, System
from .motions.prescribed import Motion
from .motions.tables import Table
from .observables.diagnostics import ConstraintError
from .observables.evaluate import Evaluation
from .observables.state import RememberingState, State
from .simulation.given_motion import InverseDynamics, KinematicAnalysis
from .simulation.parameters import ParameterList
from .simulation.scene import Scene
from .simulation.solution import Charts, Solution, Steps


class Rotation(Protocol):
    """What is used of scipy.spatial.transform.Rotation."""

    @property
    def as_quat(self) -> Callable[..., Any]:
        """The quaternion, scalar last."""

    @property
    def as_matrix(self) -> Callable[..., Any]:
        """The matrix."""


Floats: TypeAlias = NDArray[np.float64]
Bools: TypeAlias = NDArray[np.bool_]
Integers: TypeAlias = NDArray[np.int64]
Random: TypeAlias = np.random.Generator
Matrix: TypeAlias = Any  # dense, or a sparse array of SciPy's
Value: TypeAlias = np.float64 | Any  # of a function of time: a number at one time, an array at many

AnyBody: TypeAlias = PointMass | Ground
Place: TypeAlias = str | PathLike[str]  # of a file
BodyLike: TypeAlias = PointMass | Ground | str  # a handle, or a name
ItemLike: TypeAlias = Attachment | str
JointCoordinate: TypeAlias = Joint | tuple[Joint, str] | tuple[Joint, str, int]  # "angle" or "displacement", index
RopePoints: TypeAlias = Sequence[tuple[BodyLike, ArrayLike]]
Orientation: TypeAlias = ArrayLike | Rotation
Span: TypeAlias = Sequence[float] | Floats

TimeFunction: TypeAlias = Callable[[float], float]
Data: TypeAlias = Table | Callable[[Any], Any] | tuple[ArrayLike, ArrayLike]  # callable: a spline of SciPy's
Prescribed: TypeAlias = float | Motion | Data | Sequence[TimeFunction]  # one of ts.motions is callable
Path: TypeAlias = Sequence[Prescribed] | Data | Floats
GivenMotions: TypeAlias = Mapping[Any, Prescribed | Path] | Solution | State  # of coordinates, or of the whole scene
Load: TypeAlias = float | Table | Callable[[Any], Any]
VectorLoad: TypeAlias = ArrayLike | Table | Callable[..., Any]  # a function of t, or of t and state
JointLaw: TypeAlias = Callable[[float, float, float], float]
ControlLaw: TypeAlias = Callable[..., Any]  # of t and state
Actuators: TypeAlias = Sequence[Any]
Event: TypeAlias = Callable[[float, State], float]
CaseTable: TypeAlias = Mapping[str, Any] | Callable[[int], Mapping[str, Any]] | Any  # or a DataFrame
Keep: TypeAlias = str | Sequence[str] | Callable[[Solution], Any]  # sequence: names of channels
Progress: TypeAlias = bool | Callable[[float], object]

Formulation: TypeAlias = Literal["tangent", "null-space", "maggi-kane"]
Redundancy: TypeAlias = Literal["drop", "refuse"]
ImpactLaw: TypeAlias = Literal["newton", "poisson"]
Folds: TypeAlias = Literal["keep", "free"]
Frame: TypeAlias = Literal["ground", "body"]
Axis: TypeAlias = Literal["x", "y", "z"]
TableKind: TypeAlias = Literal["cubic", "linear", "previous", "pchip"]
Method: TypeAlias = Integrator | type[Integrator] | str
Methods: TypeAlias = Sequence[str | Callable[..., Integrator]] | Mapping[str, str | Callable[..., Integrator]]
StepKernel: TypeAlias = tuple[Any, Floats, Callable[[int, int], int]]  # with its numbers, and floats of memory


class Points:
    """Attributes of a constraint or force with a point on each body, for stubs."""

    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]


class Axes:
    """Attributes of one with an axis on each body."""

    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]


class JointLoads:
    """Attributes of a load on a joint coordinate, for stubs."""

    function: JointLaw
    period: float | None

    @property
    def joint(self) -> Attachment:
        """The joint."""

    @property
    def which(self) -> int:
        """The index of the coordinate."""

    @property
    def geometry(self) -> Any:
        """Where the coordinate is measured."""


class References:
    """Attributes of one that measures an angle between two directions."""

    reference_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]


Item = TypeVar("Item", bound=Attachment)
Class = TypeVar("Class", bound=type)
Function = TypeVar("Function", bound=Callable[..., Any])
