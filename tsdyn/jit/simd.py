"""Vectors of four floats in one register: SIMD code on every processor, generated here for Numba.

    four(array, i)       the floats array[i : i + 4]          put(array, i, f)   write them there
    splat(x)             x four times                         lanes(a, b, c)     (a, b, c, 0)
    fma(f, g, h)         f g + h, rounded once where the processor can       larger(f, g)   of |f| and g, one by one
    add(f, g), sub(f, g), times(f, g)                         first(f), second(f), third(f)   one of them
    total(f)             their sum
    cross(f, g)          of the first three; the fourth is 0
    get(array, i), let(array, i, x)                           one number, i not counted from the end
    fetch(array, i, n)                                        have array[i : i + n] brought into the cache

Numba vectorises loops, and none of ours is long enough. Used with lengths of four throughout, so it is safe.
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model

from .kernels import DEBUG, kernel

_WIDTH = 4
_f64, _i32 = ir.DoubleType(), ir.IntType(32)
_quad = ir.VectorType(_f64, _WIDTH)


class _Four(types.Type):
    def __init__(self):
        super().__init__(name="Four")


FOUR = _Four()


@register_model(_Four)
class _FourModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _quad)


def _pointer(context, builder, kind, array, index):
    data = context.make_array(kind)(context, builder, value=array).data
    return builder.bitcast(builder.gep(data, [index]), _quad.as_pointer())


@intrinsic
def four(typing, array, index):
    """The floats array[index : index + 4]; array is one-dimensional and contiguous."""

    def generate(context, builder, signature, arguments):
        pointer = _pointer(context, builder, signature.args[0], *arguments)
        return builder.load(pointer, align=8)

    return FOUR(array, types.int64), generate


@intrinsic
def put(typing, array, index, value):
    """array[index : index + 4] = value."""

    def generate(context, builder, signature, arguments):
        pointer = _pointer(context, builder, signature.args[0], *arguments[:2])
        builder.store(arguments[2], pointer, align=8)
        return context.get_dummy_value()

    return types.none(array, types.int64, FOUR), generate


def _spread(builder, value):
    one = builder.insert_element(ir.Constant(_quad, ir.Undefined), value, _i32(0))
    return builder.shuffle_vector(one, ir.Constant(_quad, ir.Undefined), ir.Constant(ir.VectorType(_i32, 4), [0] * 4))


@intrinsic
def splat(typing, value):
    """(value, value, value, value)."""

    def generate(context, builder, signature, arguments):
        return _spread(builder, arguments[0])

    return FOUR(types.float64), generate


@intrinsic
def lanes(typing, a, b, c):
    """(a, b, c, 0)."""

    def generate(context, builder, signature, arguments):
        result = ir.Constant(_quad, [0.0] * 4)
        for i, value in enumerate(arguments):
            result = builder.insert_element(result, value, _i32(i))
        return result

    return FOUR(types.float64, types.float64, types.float64), generate


def _binary(name, what):
    @intrinsic
    def operation(typing, f, g):
        def generate(context, builder, signature, arguments):
            return getattr(builder, name)(*arguments)

        return FOUR(FOUR, FOUR), generate

    operation.__doc__ = what
    return operation


add, sub, times = _binary("fadd", "f + g."), _binary("fsub", "f - g."), _binary("fmul", "f g, one by one.")


@intrinsic
def fma(typing, f, g, h):
    """F g + h."""

    def generate(context, builder, signature, arguments):
        product = builder.fmul(arguments[0], arguments[1], flags=("contract",))
        return builder.fadd(product, arguments[2], flags=("contract",))

    return FOUR(FOUR, FOUR, FOUR), generate


@intrinsic
def larger(typing, f, g):
    """The larger of |f| and g, one by one."""

    def generate(context, builder, signature, arguments):
        bits = ir.VectorType(ir.IntType(64), _WIDTH)
        all_but_sign = ir.Constant(bits, [(1 << 63) - 1] * _WIDTH)
        size = builder.bitcast(builder.and_(builder.bitcast(arguments[0], bits), all_but_sign), _quad)
        return builder.select(builder.fcmp_unordered(">", size, arguments[1]), size, arguments[1])

    return FOUR(FOUR, FOUR), generate


def _extract(place, what):
    @intrinsic
    def operation(typing, f):
        def generate(context, builder, signature, arguments):
            return builder.extract_element(arguments[0], _i32(place))

        return types.float64(FOUR), generate

    operation.__doc__ = what
    return operation


first, second, third, fourth = (_extract(i, f"Float {i + 1} of four.") for i in range(4))


@intrinsic
def total(typing, f):
    """The sum of the four."""

    def generate(context, builder, signature, arguments):
        a, b, c, d = (builder.extract_element(arguments[0], _i32(i)) for i in range(4))
        return builder.fadd(builder.fadd(a, c), builder.fadd(b, d))

    return types.float64(FOUR), generate


@intrinsic
def cross(typing, f, g):
    """F x g of the first three; the fourth is g[3] f[3] - f[3] g[3] = 0 for finite ones."""

    def generate(context, builder, signature, arguments):
        def turned(value):
            places = ir.Constant(ir.VectorType(_i32, 4), [1, 2, 0, 3])
            return builder.shuffle_vector(value, ir.Constant(_quad, ir.Undefined), places)

        a, b = arguments
        return turned(builder.fsub(builder.fmul(a, turned(b)), builder.fmul(turned(a), b)))

    return FOUR(FOUR, FOUR), generate


@intrinsic
def get(typing, array, index):
    """array[index], index >= 0 and within: nothing is looked after."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, value=arguments[0]).data
        return builder.load(builder.gep(data, [arguments[1]]))

    return array.dtype(array, types.int64), generate


@intrinsic
def let(typing, array, index, value):
    """array[index] = value, likewise."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, value=arguments[0]).data
        builder.store(arguments[2], builder.gep(data, [arguments[1]]))
        return context.get_dummy_value()

    return types.none(array, types.int64, array.dtype), generate


@intrinsic
def _fetch(typing, array, index):
    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, value=arguments[0]).data
        byte = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, _i32, _i32, _i32])
        prefetch = builder.module.declare_intrinsic("llvm.prefetch", (byte,), kind)
        place = builder.bitcast(builder.gep(data, [arguments[1]]), byte)
        builder.call(prefetch, [place, _i32(0), _i32(3), _i32(1)])
        return context.get_dummy_value()

    return types.none(array, types.int64), generate


@kernel
def fetch(array, index, count):
    """Have array[index : index + count] brought into the cache, whether it is there or not."""
    for i in range(index, index + count, 8):
        _fetch(array, i)


if DEBUG:

    def fetch(array, index, count):
        """Nothing."""

    def get(array, index):
        """array[index]."""
        return array[index]

    def let(array, index, value):
        """array[index] = value."""
        array[index] = value

    def four(array, index):
        """The floats array[index : index + 4]."""
        return array[index : index + _WIDTH].copy()

    def put(array, index, value):
        """array[index : index + 4] = value."""
        array[index : index + _WIDTH] = value

    def splat(value):
        """Four times the value."""
        return np.full(_WIDTH, value)

    def lanes(a, b, c):
        """(a, b, c, 0)."""
        return np.array([a, b, c, 0.0])

    def cross(f, g):
        """The vector product of the first three."""
        return np.append(np.cross(f[:3], g[:3]), 0.0)

    add, sub, times, total = np.add, np.subtract, np.multiply, np.sum

    def fma(f, g, h):
        """F g + h."""
        return f * g + h

    def larger(f, g):
        """The larger of |f| and g."""
        return np.maximum(np.abs(f), g)

    first, second, third, fourth = (lambda f, i=i: f[i] for i in range(_WIDTH))
