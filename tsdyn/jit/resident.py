"""Arrays of kernels; workspaces that kernels find by one address: named tuples of arrays and of records.

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
import platform
from functools import cache
from hashlib import sha256

import numba
import numpy as np
from llvmlite import ir
from numba import RequireLiteralValue, types
from numba.extending import intrinsic, models, register_model, typeof_impl

from .compiled import DEBUG
from .compilers import current

# Arrays aligned to cache lines, so that no vector of four floats straddles two lines.

# Arrays of kernels: on the stack, aligned to cache lines, over memory that somebody else owns, spread as arguments.

LINE = 64  # bytes
_byte = ctypes.c_char


def where(array):
    """The address of an array's numbers, in a quarter of the time of `array.ctypes.data`; zero where there are none."""
    return ctypes.addressof(_byte.from_buffer(array)) if array.size else 0


def zeros(count):
    """So many floats, zero."""
    room = np.zeros(count + LINE // 8)
    first = -where(room) % LINE // 8
    return room[first : first + count]


# Arrays of kernels: on the stack, and over memory that somebody else owns.

ANY = 1 << 40  # the length of arrays whose length a kernel doesn't need
_i64, _f64 = ir.IntType(64), ir.DoubleType()
_vector = types.Array(types.float64, 1, "C")
_matrix = types.Array(types.float64, 2, "C")
_integers = types.Array(types.int64, 1, "C")
_complex = types.Array(types.complex128, 1, "C")


def array_over(context, builder, kind, pointer, shape):
    """An array over memory that somebody else owns."""
    array = context.make_array(kind)(context, builder)
    array.itemsize = context.get_constant(types.intp, kind.dtype.bitwidth // 8)
    strides, count = [array.itemsize], context.get_constant(types.intp, 1)
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    for length in shape:
        count = builder.mul(count, length, flags=["nsw"])
    array.data = builder.bitcast(pointer, array.data.type)
    array.shape, array.strides, array.nitems = joined(builder, shape), joined(builder, strides), count
    array.meminfo, array.parent = ir.Constant(array.meminfo.type, None), ir.Constant(array.parent.type, None)
    return array._getvalue()


def joined(builder, parts):
    """An array of values in registers."""
    result = ir.Constant(ir.ArrayType(parts[0].type, len(parts)), ir.Undefined)
    for i, part in enumerate(parts):
        result = builder.insert_value(result, part, i)
    return result


def _on_stack(builder, kind):
    """Memory on the stack, one for all passes of a loop."""
    with builder.goto_entry_block():
        pointer = builder.alloca(kind)
        builder.store(ir.Constant(kind, None), pointer)
    return pointer


def _literal(value):
    if not isinstance(value, types.IntegerLiteral):
        raise RequireLiteralValue("the size of a stack array is a constant")
    return value.literal_value


def make_stacker(kind, cell):
    """Make the kernels of vectors and matrices of some kind of number on the stack; their content is undefined."""

    @intrinsic(prefer_literal=True)
    def one(typing, n):
        length = _literal(n)

        def generate(context, builder, signature, arguments):
            pointer = _on_stack(builder, ir.ArrayType(cell, length))
            return array_over(
                context, builder, signature.return_type, pointer, [context.get_constant(types.intp, length)]
            )

        return types.Array(kind, 1, "C")(n), generate

    @intrinsic(prefer_literal=True)
    def two(typing, n, m):
        shape = _literal(n), _literal(m)

        def generate(context, builder, signature, arguments):
            pointer = _on_stack(builder, ir.ArrayType(cell, shape[0] * shape[1]))
            lengths = [context.get_constant(types.intp, s) for s in shape]
            return array_over(context, builder, signature.return_type, pointer, lengths)

        return types.Array(kind, 2, "C")(n, m), generate

    return one, two


# stack(n) is a vector of n floats on the stack, stack2(n, m) a matrix; n and m are constants
stack, stack2 = make_stacker(types.float64, _f64)
complex_stack, complex_stack2 = make_stacker(types.complex128, ir.LiteralStructType([_f64, _f64]))


def make_viewer(kind):
    """Make the kernel that views memory as an array of some kind."""

    @intrinsic
    def view(typing, address, *shape):
        def generate(context, builder, signature, arguments):
            pointer = builder.inttoptr(arguments[0], ir.PointerType())
            lengths = [builder.extract_value(arguments[1], i) for i in range(len(shape))]
            return array_over(context, builder, kind, pointer, lengths)

        return kind(types.int64, types.StarArgTuple([types.intp] * len(shape))), generate

    return view


vector = make_viewer(_vector)
matrix = make_viewer(_matrix)
integers = make_viewer(_integers)
complex_vector = make_viewer(_complex)


@intrinsic
def data_of(typing, array):
    """The address of an array's first number."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, value=arguments[0]).data
        return builder.ptrtoint(data, _i64)

    return types.int64(array), generate


HAS_CYCLES = platform.machine().lower() in ("x86_64", "amd64")


@intrinsic
def cycles(typing):
    """The processor's time stamp, a few nanoseconds to read; zero where HAS_CYCLES says that none may be read."""

    def generate(context, builder, signature, arguments):
        if not HAS_CYCLES:
            return context.get_constant(types.int64, 0)
        function = builder.module.declare_intrinsic("llvm.readcyclecounter", (), ir.FunctionType(_i64, ()))
        return builder.call(function, ())

    return types.int64(), generate


if DEBUG:

    def stack(n):
        """A vector of n floats."""
        return np.zeros(n)

    def stack2(n, m):
        """An n x m matrix."""
        return np.zeros((n, m))

    def complex_stack(n):
        """A vector of n complex numbers."""
        return np.zeros(n, complex)

    def complex_stack2(n, m):
        """An n x m complex matrix."""
        return np.zeros((n, m), complex)

    def vector(array, n):
        """The array itself: in debug mode nothing is passed by address."""
        return array[:n] if array.ndim == 1 else array.reshape(-1)[:n]

    def matrix(array, n, m):
        """The array as an n x m matrix."""
        return array.reshape(-1)[: n * m].reshape(n, m)

    integers = vector

    def complex_vector(array, n):
        """The array, of 2 n floats, as n complex numbers."""
        return array[: 2 * n].view(complex)

    def data_of(array):
        """The array itself."""
        return array


# Numbers of an array as arguments of a call: function(t, *spread(numbers, COUNT)) in a kernel.


@intrinsic(prefer_literal=True)
def spread(typing, numbers, count):
    """The first `count` numbers, a constant, as a tuple."""
    length, number = count.literal_value, numbers.dtype

    def generate(context, builder, signature, arguments):
        data = context.make_array(numbers)(context, builder, value=arguments[0]).data
        kind = context.get_value_type(number)
        places = [builder.gep(data, [ir.IntType(64)(i)], source_etype=kind) for i in range(length)]
        if not length:
            return context.get_dummy_value()
        return joined(builder, [builder.load(place, typ=kind) for place in places])

    return types.UniTuple(number, length)(numbers, count), generate


if DEBUG:

    def spread(numbers, count):
        """The first `count` numbers, a constant."""
        return tuple(numbers[:count])


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
    return where(image) + 8 * len(header), (image, value)


@intrinsic
def seen(typing, value):
    """The address of the image of a named tuple of arrays, on the stack: for kernels that are called by address."""

    def generate(context, builder, signature, arguments):
        words = []
        for i, kind in enumerate(value.types):
            array = context.make_array(kind)(context, builder, value=builder.extract_value(arguments[0], i))
            shape = [builder.extract_value(array.shape, axis) for axis in range(kind.ndim)]
            words += [builder.ptrtoint(array.data, _i64), *shape]
        image = builder.bitcast(_on_stack(builder, ir.ArrayType(_i64, len(words))), ir.PointerType(_i64))
        for i, word in enumerate(words):
            builder.store(word, builder.gep(image, [_i64(i)]))
        return builder.ptrtoint(image, _i64)

    return types.int64(value), generate


if DEBUG:

    def seen(value):
        """The named tuple itself."""
        return value


def image_of(value):
    """The words of an array (the address of its numbers, its lengths), of a record (its address), or of a tuple."""
    words = []
    _append_image(value if isinstance(value, tuple) else (value,), words)
    return words


def _append_image(values, words):
    for value in values:
        if isinstance(value, tuple):
            _append_image(value, words)
        elif isinstance(value, Record):
            words.append(ctypes.addressof(value))
        else:
            words += where(value), *value.shape


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
