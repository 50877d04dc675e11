"""Arrays of kernels: on the stack, aligned to cache lines, over memory that somebody else owns, spread as arguments."""

import platform

import numpy as np
from llvmlite import ir
from numba import RequireLiteralValue, types
from numba.extending import intrinsic

from .compiled import DEBUG

# Arrays aligned to cache lines, so that no vector of four floats straddles two lines.

LINE = 64  # bytes


def zeros(count):
    """So many floats, zero."""
    room = np.zeros(count + LINE // 8)
    first = -room.ctypes.data % LINE // 8
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
