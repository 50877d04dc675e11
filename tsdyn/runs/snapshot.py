"""The state of a run between two slices: what a run that goes on begins with, to the bit.

All that kernels see is in the context and in the `Run` of a memory: arrays and records. Tables of records and what
holds addresses are made anew by the process that goes on; all else is saved.
"""

import numpy as np

from ..jit.kernels import Record

ADDRESSES = ("kernels", "rub", "anew")  # fields of them


def parts(memory):
    """The arrays and records of a memory by name, to be read and written in place."""
    return {**_parts("context", memory.context), **_parts("run", memory.run)}


def saved(memory):
    """Copies of them."""
    return {name: array.copy() for name, array in parts(memory).items()}


def restore(memory, arrays):
    """Write them back."""
    for name, array in parts(memory).items():
        array[...] = arrays[name]


def _parts(name, value):
    if isinstance(value, tuple):
        found = {}
        for field, part in value._asdict().items():
            if field not in ADDRESSES:
                found.update(_parts(f"{name}.{field}", part))
        return found
    if isinstance(value, Record):
        return {name: np.frombuffer(value, np.uint8)}
    return {} if value.dtype.names else {name: value}
