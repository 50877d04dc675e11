"""tsdyn: constrained rigid-body dynamics on the constraint manifold, by Haug's tangent-space ODE."""

from __future__ import annotations

from pathlib import Path as _Path
from typing import TYPE_CHECKING

_here = _Path(__file__).parent
if not (_here / "constraints").is_dir():  # a checkout: they stand beside this folder
    __path__.append(str(_here.parent))

from . import constraints, forces, integrators, motions, shapes  # noqa: E402
from ._version import __version__ as __version__  # noqa: E402
from .elements.bodies import Body, PointMass  # noqa: E402
from .elements.element import Angle, Displacement  # noqa: E402
from .elements.force import Force  # noqa: E402
from .elements.friction import JointFriction  # noqa: E402
from .elements.joint import Joint  # noqa: E402
from .elements.markers import Parameters, Point, Turn, Vector  # noqa: E402
from .elements.primitive import Primitive  # noqa: E402
from .errors import (  # noqa: E402
    CompilerWarning,
    ImportLosses,
    InconsistentState,
    InvalidArgument,
    InvalidBody,
    InvalidCall,
    InvalidConstraint,
    InvalidFile,
    InvalidForce,
    MissingDependency,
    NoEquilibrium,
    RedundantConstraints,
    SingularConfiguration,
    Status,
    StepFailure,
    StorageError,
    TsdynError,
    UnknownAttribute,
    UnknownParameter,
)
from .jit.kernels import kernel  # noqa: E402
from .methods.collocation import CollocationTableau  # noqa: E402
from .methods.integrator import (  # noqa: E402
    Adaptive,
    Collocation,
    DiagonallyImplicit,
    ExplicitNystrom,
    ExplicitRungeKutta,
    Integrator,
)
from .methods.tableau import ImplicitTableau, NystromTableau, RungeKuttaTableau  # noqa: E402
from .motions.prescribed import Motion  # noqa: E402
from .motions.tables import Table  # noqa: E402
from .observables.state import State  # noqa: E402
from .simulation.load import LOADERS as _LOADERS  # noqa: E402
from .simulation.load import load, resume  # noqa: E402
from .simulation.prepared_run import Run, prepare, simulate  # noqa: E402
from .simulation.run_options import RunOptions  # noqa: E402
from .simulation.scene import Scene  # noqa: E402
from .simulation.solution import Solution  # noqa: E402


def _ensemble_of(*given):
    from .ensembles.ensemble import load

    return load(*given)


_LOADERS["tsdyn ensemble"] = _ensemble_of

__all__ = [
    "Adaptive",
    "Angle",
    "Body",
    "Change",
    "Collocation",
    "CollocationTableau",
    "CompilerWarning",
    "DiagonallyImplicit",
    "Displacement",
    "Ensemble",
    "ExplicitNystrom",
    "ExplicitRungeKutta",
    "Force",
    "ImplicitTableau",
    "ImportLosses",
    "InconsistentState",
    "Integrator",
    "InvalidArgument",
    "InvalidBody",
    "InvalidCall",
    "InvalidConstraint",
    "InvalidFile",
    "InvalidForce",
    "Joint",
    "JointFriction",
    "MissingDependency",
    "Motion",
    "NoEquilibrium",
    "NystromTableau",
    "Parameters",
    "Point",
    "PointMass",
    "Primitive",
    "RedundantConstraints",
    "Run",
    "RunOptions",
    "RungeKuttaTableau",
    "Scene",
    "SingularConfiguration",
    "Solution",
    "State",
    "Status",
    "StepFailure",
    "StorageError",
    "Table",
    "TsdynError",
    "Turn",
    "UnknownAttribute",
    "UnknownParameter",
    "Vector",
    "benchmark",
    "compare",
    "constraints",
    "ensemble",
    "forces",
    "impact",
    "integrators",
    "kernel",
    "load",
    "motions",
    "plots",
    "prepare",
    "profile",
    "resume",
    "shapes",
    "simulate",
    "testing",
]


if TYPE_CHECKING:
    from . import plots, testing
    from .ensembles.ensemble import ensemble
    from .ensembles.results import Ensemble
    from .measuring.benchmark import benchmark
    from .measuring.compare import compare
    from .measuring.profile import profile
    from .simulation.hybrid import Change
    from .simulation.impacts import impact
else:
    from .calls import refusing as _refusing

    _refuse = _refusing("ts", __all__, constraints, forces, integrators, motions)
    _LATER = {
        "Ensemble": ".ensembles.results",
        "benchmark": ".measuring.benchmark",
        "compare": ".measuring.compare",
        "ensemble": ".ensembles.ensemble",
        "Change": ".simulation.hybrid",
        "impact": ".simulation.impacts",
        "plots": ".plots",
        "profile": ".measuring.profile",
        "testing": ".testing",
    }

    def __getattr__(name):
        """What is loaded when it is asked for: no run needs it."""
        if name not in _LATER:
            return _refuse(name)
        from importlib import import_module

        found = import_module(_LATER[name], __name__)
        return found if _LATER[name] == f".{name}" else getattr(found, name)


def __dir__() -> list[str]:
    """What users use, for completion."""
    return sorted([*__all__, "__version__"])
