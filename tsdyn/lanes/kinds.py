"""Loops over the instances of a kind, for lanes: copies of the templates with arrays of lanes in place of arrays."""

import numpy as np

from ..elements.element import address
from ..elements.loops import constraint_rows, constraint_series, force_series, law_check, template
from ..elements.markers import PARAMETERS
from ..errors import InvalidConstraint, InvalidForce
from ..jit.compiled import Callback
from ..jit.kernels import specialised
from ..jit.lanes import makers
from ..model.packed_forces import members_of
from .sums import torque

CONSTRAINT_LOOPS = {
    "reduced": constraint_rows.reduced,
    "values": constraint_rows.values,
    "series": constraint_series.series,
}
FORCE_LOOPS = ("series", force_series.series), ("margin", law_check.margin)
_NAMES = [name for name in vars(template) if name.isupper() or name.startswith("kernel_")]
_known = {}  # (callback, width): that of lanes


def _loop(one, loop, markers, width):
    """The `Callback` that runs a kind for so many lanes, made of that for one case."""
    if (one, width) not in _known:
        function, threes = one.py_func, all(marker.code != PARAMETERS for marker in markers)
        names = {name: function.__globals__[name] for name in _NAMES if name in function.__globals__}
        names |= makers(width, threes) | {"torque": torque}
        copy = specialised(loop, f"{function.__qualname__}_{width}_lanes", function, **names)
        _known[one, width] = Callback(copy, one.signature)
    return _known[one, width]


def constraint_loops(kinds, width):
    """Addresses of the loops of constraints for lanes, (kinds, 3): reduced, values, series.

    Raises InvalidConstraint where Numba can't compile one.
    """
    found = []
    for kind in kinds:
        own = {name: _loop(kind.kernels[name], loop, kind.markers, width) for name, loop in CONSTRAINT_LOOPS.items()}
        found.append([address(own, name, kind.__name__, InvalidConstraint) for name in own])
    return np.array(found, np.int64).reshape(-1, len(CONSTRAINT_LOOPS))


def force_loops(packed, width):
    """Addresses of the loops of forces for lanes, (kinds, 2), in the order of System.forces: series, margin or 0.

    Raises InvalidForce where Numba can't compile one.
    """
    found = []
    for row in packed.system.forces:
        force = members_of(row, packed.loads)[0].force
        loops = FORCE_LOOPS if force.positive else FORCE_LOOPS[:1]
        own = {name: _loop(force.kernels[name], loop, force.markers, width) for name, loop in loops}
        found.append([address(own, name, force.name, InvalidForce) if name in own else 0 for name, _ in FORCE_LOOPS])
    return np.array(found, np.int64).reshape(-1, len(FORCE_LOOPS))
