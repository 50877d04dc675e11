"""Which cases can share arrays: those whose numbers change nothing that is found from them beforehand."""

from ..elements.bodies import PointMass
from ..jit.code_hash import is_ours
from ..model.packed import classes
from ..motions.signals import Signal


def serves(family, kept, names):
    """Return True if cases with other values of these parameters, all where names is None, can share arrays."""
    packed = family.packed
    driven = {kind for kind, row in zip(classes(packed), packed.system.kinds, strict=True) if row.phi_t}
    if kept.sampled:
        return False
    fields = family.fields.values() if names is None else map(family.field, names)
    for owner in {id(field.owner): field.owner for field in fields}.values():
        if owner is family.template or isinstance(owner, PointMass):
            continue
        load = family.load_of(owner)
        if load is not None and any(isinstance(value, Signal) for value in load.parameters):
            return False  # numbers beside a function of time are written into the memory of the series
        kinds = {type(part) for part in getattr(owner, "parts", ())}
        if load is None and (kinds & driven or not all(is_ours(kind.__module__) for kind in (type(owner), *kinds))):
            return False
    return True


def have_same_zeros(parameters, base):
    """Whether numbers of constraints are zero where others are: masks of columns depend on these."""
    if parameters is base:
        return True
    changed = [(new, old) for new, old in zip(parameters, base, strict=True) if new is not old]
    return all((x == 0.0) == (y == 0.0) for new, old in changed for x, y in zip(new, old, strict=True))
