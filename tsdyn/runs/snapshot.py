"""The state of a run between two slices: what a run that goes on begins with, to the bit.

All that kernels see is in the context and in the `Run` of a memory: arrays and records. What follows from the scene and
the method (tables, programs, addresses, places in memory) is laid out anew by the process that goes on; all else is
saved. What comes from a file is checked before kernels see it: shapes, and each number that is a place or a count.
"""

import numpy as np

from ..jit.kernels import Record
from ..motions.state_program import LENGTH
from ..validation import EXACT, damaged, demand

LAID_OUT = (  # fields that follow from scene and method, or are filled in before they are read
    "system", "graph", "kernels", "friction_solver", "reselection", "joints", "watched", "loaded", "path", "tableau",
    "block", "own", "trial", "table",
)  # fmt: skip
OWN = {  # numbers of records, likewise
    "Orders": ("top", "room", "lowest", "highest", "refined", "sweeps"),
    "Numbers": (
        "first_order", "adaptive", "steps_wanted", "chart_interval", "dense", "last_stage", "stage_at", "rows",
        "history", "blocks",
    ),
}  # fmt: skip
REMEMBERED = "context.system.remembered"  # reals of the forces that remember something


def demand_noted(noted, rows):
    """Raise ValueError unless each line names rows (of so many), or none by -1: what `note_selection` writes."""
    demand((((noted >= 0.0) & (noted < rows)).all(axis=1) | (noted == -1.0).all(axis=1)).all(), "the redundant rows")


def parts(memory):
    """The arrays and records of a memory by name, to be read and written in place."""
    return {**_parts("context", memory.context), **_parts("run", memory.run)}


def saved(memory):
    """Copies of them."""
    system = memory.context.system
    found = {name: _array(part).copy() for name, part in parts(memory).items()}
    return {**found, REMEMBERED: system.reals[system.memory]}


def restore(memory, arrays, limits):
    """Write them back; limits: of numbers of the `Run`, by name.

    Raises
    ------
    StorageError
        If shapes differ, or a place is beyond an array.
    """
    system, rows = memory.context.system, len(memory.context.graph.row)
    found, most = {**parts(memory), REMEMBERED: system.reals[system.memory]}, max(rows, memory.context.work.Phi.size)
    with damaged("the checkpoint"):
        for name, part in found.items():
            given, own = arrays[name], _array(part)
            demand(given.shape == own.shape and given.dtype == own.dtype, name)
            if isinstance(part, Record):
                _restore_record(name, part, given, limits)
            elif own.dtype.kind == "i" and own.size:
                demand(given.min() >= 0 and given.max() <= max(most, own.size) and given[0] < max(own.size, 2), name)
        for at, program in _programs(memory.context):
            arrays["context.expansion.loads"][at : at + len(program)] = program
        for name, part in found.items():
            _array(part)[...] = arrays[name]
        system.reals[system.memory] = arrays[REMEMBERED]


def _restore_record(name, record, given, limits):
    """Check the numbers of a record, and put its own ones in the place of those that a file has no say in."""
    kind, own = type(record), OWN.get(type(record).__name__, ())
    found = kind.from_buffer_copy(given)
    for field, what in kind.__annotations__.items():
        if field in own:
            setattr(found, field, getattr(record, field))
            continue
        low, high = (0, limits[field]) if field in limits else (-EXACT, EXACT)
        high = record.highest if (kind.__name__, field) == ("Orders", "next") else high
        demand(what is float or low <= getattr(found, field) <= high, f"{name}.{field}")
    given[...] = np.frombuffer(found, np.uint8)


def _programs(context):
    """The programs of traced functions among the series of loads: where each begins, and a copy of it."""
    expansion = getattr(context, "expansion", None)
    for kind in () if expansion is None else expansion.forces[expansion.forces["run"] != 0]:
        at = int(kind["values"])
        yield at, expansion.loads[at : at + int(expansion.loads[at + LENGTH])].copy()


def _array(part):
    return np.frombuffer(part, np.uint8) if isinstance(part, Record) else part


def _parts(name, value):
    if isinstance(value, tuple):
        found = {}
        for field, part in value._asdict().items():
            if field not in LAID_OUT:
                found.update(_parts(f"{name}.{field}", part))
        return found
    return {} if not isinstance(value, Record) and value.dtype.names else {name: value}
