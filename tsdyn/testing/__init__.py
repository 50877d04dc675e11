"""Checks of plug-ins (`ts.testing`): constraints, forces and integrators against the properties they must have.

Imports simulation and below.

Begin with plug_in_checks.py: Phi_q, gamma and series of a constraint, and the same of a force, against complex steps
and truncated power series. integrator_checks.py fits the order of a method and checks its adaptive steps.
"""

from ..errors import CheckFailed
from .integrator_checks import check_integrator
from .plug_in_checks import check_force, check_primitive

__all__ = ["CheckFailed", "check_force", "check_integrator", "check_primitive"]


def __dir__():
    """What users use, for completion."""
    return sorted(__all__)
