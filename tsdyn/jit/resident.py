"""Workspaces that kernels find by one address: named tuples of arrays and of records.

A `Record` holds single numbers under names, in place of an array with an index for each:

    class Control(Record):
        floor: float  # |Phi| that rounding leaves
        steps: int

    class Work(NamedTuple):
        q: np.ndarray
        control: Control

Kernels read and write `work.control.floor` and `work.control.steps += 1`, and so does Python. `records(Control, rows)`
is an array of them.
"""

import ctypes
from functools import cache
from hashlib import sha256

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model, typeof_impl

from .arrays import array_over
from .compiled import DEBUG
from .compilers import current

_i64 = ir.IntType(64)
known_types = {}  # dtype: Numba's type of a number, where Numba knows none of itself
_NUMBERS = {float: (ctypes.c_double, types.float64), int: (ctypes.c_int64, types.int64)}


class _RecordType(type(ctypes.Structure)):
    def __init__(cls, *arguments):
        super().__init__(*arguments)
        cls._fields_ = [(name, _NUMBERS[kind][0]) for name, kind in getattr(cls, "__annotations__", {}).items()]


class Record(ctypes.Structure, metaclass=_RecordType):
    """Numbers with names, zero at first: floats and integers of 64 bits, as a subclass annotates them."""

    def clear(self):
        """Set all to zero."""
        ctypes.memset(ctypes.addressof(self), 0, ctypes.sizeof(self))

    def as_dict(self):
        """The numbers by name."""
        return {name: getattr(self, name) for name in type(self).__annotations__}

    if DEBUG:  # numbers come from arrays there, which ctypes refuses

        def __setattr__(self, name, value):
            """Set a number."""
            super().__setattr__(name, type(self).__annotations__[name](value))


def records(layout, rows=()):
    """An array of records of a layout, from rows of numbers: `array[i].name`; in Python `array["name"]`, too."""
    kinds = {float: np.float64, int: np.int64}
    dtype = np.dtype((np.record, [(name, kinds[kind]) for name, kind in layout.__annotations__.items()]))
    return np.array([tuple(row) for row in rows], dtype)


def row_of(layout, **values):
    """A row for `records`, by names; zero where nothing is given."""
    assert values.keys() <= layout.__annotations__.keys()
    return [values.get(name, 0) for name in layout.__annotations__]


@typeof_impl.register(Record)
def _type_of_record(value, context):
    kinds = type(value).__annotations__.items()  # all of eight bytes, so that the layout is known without LLVM
    fields = [
        (name, {"type": _NUMBERS[kind][1], "offset": 8 * i, "alignment": 8}) for i, (name, kind) in enumerate(kinds)
    ]
    return types.Record(fields, 8 * len(fields), aligned=True)


def resident(value, header=()):
    """Put a named tuple into memory for the kernels that use its `loader`; return its address, and what keeps it there.

    Passing the tuple itself takes 0.2 us an array in each call. The header's integers stand before it.
    """
    if DEBUG:
        return value, None
    image = np.array([*header, *image_of(value)], np.int64)
    return image.ctypes.data + 8 * len(header), (image, value)


def image_of(value):
    """The words of an array (the address of its numbers, its lengths), of a record (its address), or of a tuple."""
    if isinstance(value, tuple):
        return [word for field in value for word in image_of(field)]
    if isinstance(value, Record):
        return [ctypes.addressof(value)]
    assert value.flags.c_contiguous
    return [value.ctypes.data, *value.shape]


def _words(kind):
    """How many words the image of a type takes."""
    if isinstance(kind, types.Array):
        return 1 + kind.ndim
    return 1 if isinstance(kind, types.Record) else sum(map(_words, kind))


class Seen(types.Type):
    """A named tuple of arrays and records that is in memory; a kernel reads of it what it uses, when it uses it."""

    def __init__(self, kind):
        self.kind = kind
        super().__init__(name=f"Seen({kind.instance_class.__name__} {sha256(str(kind).encode()).hexdigest()[:12]})")
        _expose(self, kind.fields)


@register_model(Seen)
class _SeenModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _i64)


def _type_of_field(seen, name):
    """The type of a field: an array, a record, or again something seen."""
    if name not in seen.kind.fields:
        return None
    field = seen.kind.types[seen.kind.fields.index(name)]
    return Seen(field) if isinstance(field, types.BaseTuple) else field


def _read_field(context, builder, seen, address, name):
    at = seen.kind.fields.index(name)
    field = seen.kind.types[at]
    place = builder.add(address, _i64(8 * sum(map(_words, seen.kind.types[:at]))))
    if isinstance(field, types.BaseTuple):
        return place
    words = builder.inttoptr(place, ir.PointerType())
    if isinstance(field, types.Record):
        return builder.inttoptr(_word(builder, words, 0), context.get_value_type(field))
    pointer, *shape = (_word(builder, words, i) for i in range(1 + field.ndim))
    return array_over(context, builder, field, builder.inttoptr(pointer, ir.PointerType()), shape)


_expose = current().attributes(Seen, _type_of_field, _read_field)


def _word(builder, words, i):
    """A word of memory that no kernel changes, which says so to the compiler."""
    word = builder.load(builder.gep(words, [_i64(i)], source_etype=_i64), typ=_i64)
    word.set_metadata("invariant.load", builder.module.add_metadata([]))
    return word


@cache
def _array_type(dtype, dimensions):
    return types.Array(known_types.get(dtype) or numba.from_dtype(dtype), dimensions, "C")


def _type_of(value):
    """As `numba.typeof` says of what is in a workspace, in a third of the time."""
    if isinstance(value, tuple):
        return types.NamedTuple([_type_of(field) for field in value], type(value))
    if isinstance(value, np.ndarray):
        return _array_type(value.dtype, value.ndim)
    return _type_of_record(value, None)


def record_at(layout):
    """Make the kernel that gives sight of a `Record` of a layout by its address."""
    if DEBUG:
        return lambda value: value
    kind = _type_of_record(layout(), None)

    @intrinsic
    def view(typing, address):
        def generate(context, builder, signature, arguments):
            return builder.inttoptr(arguments[0], context.get_value_type(kind))

        return kind(types.int64), generate

    return view


def loader(example):
    """Make the kernel that gives sight of a named tuple of example's type by its address.

    Passed as a value it would be hundreds of words for every kernel, most of them unused, and slow to compile.
    """
    if DEBUG:
        return lambda value: value
    kind = Seen(_type_of(example))

    @intrinsic
    def load(typing, address):
        def generate(context, builder, signature, arguments):
            return arguments[0]

        return kind(types.int64), generate

    return load
