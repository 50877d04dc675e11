"""Compilation of a user's functions where their owner is added, so that they are refused there."""

from ..elements.element import address, checked_parameters
from ..elements.force import Force
from ..jit.code_hash import is_ours
from ..motions.prescribed import Motion
from ..motions.signals import Signal


def demand_compilable(item):
    """Compile the user's functions of a constraint or force.

    Raises
    ------
    InvalidConstraint, InvalidForce
        If Numba can't compile one; what Numba says is the cause.
    """
    if not isinstance(item, Force):
        for part in item.parts:
            for value in checked_parameters(part, Motion, "Motions"):
                if isinstance(value, Motion):
                    value.addresses  # noqa: B018  compiled when asked for
        return
    for value in checked_parameters(item, Signal, "loads"):
        if isinstance(value, Signal) and value.is_function:
            value.address  # noqa: B018
    if item.kernels is not item.own_kernels or not is_ours(type(item).__module__):
        address(item.kernels, "force", item.name, item.error)
