"""Checks of plug-ins (`ts.testing`): constraints, forces and integrators against the properties they must have.

Imports simulation and below.

Begin with primitive_checks.py: Phi_q, gamma and series of a constraint against complex steps and truncated power
series; force_checks.py does the same for forces. integrator_checks.py fits the order of a method
and checks its adaptive steps.
"""

from ..errors import CheckFailed
from .force_checks import check_force
from .integrator_checks import check_integrator
from .primitive_checks import check_primitive

__all__ = ["CheckFailed", "check_force", "check_integrator", "check_primitive"]


def __dir__():
    """What users use, for completion."""
    return sorted(__all__)
