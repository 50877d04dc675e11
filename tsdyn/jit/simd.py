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

Arrays of lanes (lanes.py) have the same operations: each of their numbers is that of several cases.
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model

from .kernels import DEBUG, kernel
from .resident import joined

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


def _fours(*kinds):
    """The type of four of these numbers, or of what the operation on these takes: FOUR, or that of their lanes."""
    found = [four for kind in kinds if (four := getattr(kind, "four", None)) is not None]
    return min(found, key=lambda four: four.count, default=FOUR)


def number_type(*kinds):
    """The type of one of four."""
    return getattr(_fours(*kinds), "lane", types.float64)


def _each(builder, kind, operation, values):
    """What the operation on vectors makes of four numbers: of one register, or of the registers of lanes."""
    if kind is FOUR:
        return operation(*values)
    parts = [operation(*(builder.extract_value(value, i) for value in values)) for i in range(kind.count)]
    return joined(builder, parts)


def _parts(builder, kind, value):
    """Each of four, or of three."""
    if kind is FOUR:
        return [builder.extract_element(value, _i32(i)) for i in range(_WIDTH)]
    return [builder.extract_value(value, i) for i in range(kind.count)]


def _pointer(context, builder, kind, array, index):
    """Where array[index] is, and its type."""
    data = context.make_array(kind)(context, builder, value=array).data
    element = context.get_value_type(kind.dtype)
    place = builder.gep(data, [index], source_etype=element)
    place.type = ir.PointerType()  # of no type: a bitcast of Numba's typed pointer would leave it as it is
    return place, element


@intrinsic
def four(typing, array, index):
    """The floats array[index : index + 4]; array is one-dimensional and contiguous."""
    kind = _fours(array.dtype)

    def generate(context, builder, signature, arguments):
        pointer, element = _pointer(context, builder, signature.args[0], *arguments)
        if kind is FOUR:
            return builder.load(pointer, align=8, typ=_quad)
        places = [builder.gep(pointer, [_i32(i)], source_etype=element) for i in range(kind.count)]
        return joined(builder, [builder.load(place, typ=element) for place in places])

    return kind(array, types.int64), generate


@intrinsic
def put(typing, array, index, value):
    """array[index : index + 4] = value."""
    kind = _fours(array.dtype, value)

    def generate(context, builder, signature, arguments):
        pointer, element = _pointer(context, builder, signature.args[0], *arguments[:2])
        if kind is FOUR:
            builder.store(arguments[2], pointer, align=8)
        else:
            for i, part in enumerate(_parts(builder, kind, arguments[2])):
                builder.store(part, builder.gep(pointer, [_i32(i)], source_etype=element))
        return context.get_dummy_value()

    return types.none(array, types.int64, kind), generate


def spread(builder, value, width=_WIDTH):
    """A register of so many times the value."""
    kind = ir.VectorType(_f64, width)
    one = builder.insert_element(ir.Constant(kind, ir.Undefined), value, _i32(0))
    return builder.shuffle_vector(
        one, ir.Constant(kind, ir.Undefined), ir.Constant(ir.VectorType(_i32, width), [0] * width)
    )


@intrinsic
def splat(typing, value):
    """(value, value, value, value)."""
    kind = _fours(number_type(value))

    def generate(context, builder, signature, arguments):
        return spread(builder, arguments[0]) if kind is FOUR else joined(builder, arguments * kind.count)

    return kind(number_type(value)), generate


@intrinsic
def lanes(typing, a, b, c):
    """(a, b, c, 0)."""
    kind, number = getattr(_fours(a, b, c), "three", FOUR), number_type(a, b, c)

    def generate(context, builder, signature, arguments):
        if kind is not FOUR:
            return joined(builder, arguments)
        result = ir.Constant(_quad, [0.0] * 4)
        for i, value in enumerate(arguments):
            result = builder.insert_element(result, value, _i32(i))
        return result

    return kind(number, number, number), generate


def _binary(name, what):
    @intrinsic
    def operation(typing, f, g):
        kind = _fours(f, g)

        def generate(context, builder, signature, arguments):
            return _each(builder, kind, getattr(builder, name), arguments)

        return kind(kind, kind), generate

    operation.__doc__ = what
    return operation


add, sub, times = _binary("fadd", "f + g."), _binary("fsub", "f - g."), _binary("fmul", "f g, one by one.")


@intrinsic
def fma(typing, f, g, h):
    """F g + h."""
    kind = _fours(f, g, h)

    def generate(context, builder, signature, arguments):
        def sum_up(f, g, h):
            return builder.fadd(builder.fmul(f, g, flags=("contract",)), h, flags=("contract",))

        return _each(builder, kind, sum_up, arguments)

    return kind(kind, kind, kind), generate


@intrinsic
def larger(typing, f, g):
    """The larger of |f| and g, one by one."""
    kind = _fours(f, g)

    def generate(context, builder, signature, arguments):
        def choose(f, g):
            bits = ir.VectorType(ir.IntType(64), f.type.count)
            all_but_sign = ir.Constant(bits, [(1 << 63) - 1] * f.type.count)
            size = builder.bitcast(builder.and_(builder.bitcast(f, bits), all_but_sign), f.type)
            return builder.select(builder.fcmp_unordered(">", size, g), size, g)

        return _each(builder, kind, choose, arguments)

    return kind(kind, kind), generate


def _extract(place, what):
    @intrinsic
    def operation(typing, f):
        kind = _fours(f)

        def generate(context, builder, signature, arguments):
            parts = _parts(builder, kind, arguments[0])
            return parts[place] if place < len(parts) else ir.Constant(parts[0].type, [0.0] * parts[0].type.count)

        return number_type(f)(kind), generate

    operation.__doc__ = what
    return operation


first, second, third, fourth = (_extract(i, f"Float {i + 1} of four.") for i in range(4))


@intrinsic
def total(typing, f):
    """The sum of the four."""
    kind = _fours(f)

    def generate(context, builder, signature, arguments):
        a, b, c, *d = _parts(builder, kind, arguments[0])
        return builder.fadd(builder.fadd(a, c), builder.fadd(b, d[0]) if d else b)

    return number_type(f)(kind), generate


@intrinsic
def cross(typing, f, g):
    """F x g of the first three; the fourth is g[3] f[3] - f[3] g[3] = 0 for finite ones."""
    kind = getattr(_fours(f, g), "three", FOUR)

    def turned(builder, value):
        places = ir.Constant(ir.VectorType(_i32, 4), [1, 2, 0, 3])
        return builder.shuffle_vector(value, ir.Constant(_quad, ir.Undefined), places)

    def generate(context, builder, signature, arguments):
        a, b = arguments
        if kind is FOUR:
            twice = turned(builder, b), turned(builder, a)
            return turned(builder, builder.fsub(builder.fmul(a, twice[0]), builder.fmul(twice[1], b)))
        a, b, parts = _parts(builder, kind, a), _parts(builder, kind, b), []
        for i, j in ((1, 2), (2, 0), (0, 1)):
            parts.append(builder.fsub(builder.fmul(a[i], b[j]), builder.fmul(a[j], b[i])))
        return joined(builder, parts)

    return kind(kind, kind), generate


@intrinsic
def get(typing, array, index):
    """array[index], index >= 0 and within: bounds aren't checked."""

    def generate(context, builder, signature, arguments):
        place, element = _pointer(context, builder, signature.args[0], *arguments)
        return builder.load(place, typ=element)

    return getattr(array.dtype, "lane", array.dtype)(array, types.int64), generate


@intrinsic
def let(typing, array, index, value):
    """array[index] = value, likewise."""

    def generate(context, builder, signature, arguments):
        place, _ = _pointer(context, builder, signature.args[0], *arguments[:2])
        builder.store(arguments[2], place)
        return context.get_dummy_value()

    return types.none(array, types.int64, array.dtype), generate


@intrinsic
def _fetch(typing, array, index):
    def generate(context, builder, signature, arguments):
        place, _ = _pointer(context, builder, signature.args[0], *arguments)
        pointer = ir.PointerType()
        kind = ir.FunctionType(ir.VoidType(), [pointer, _i32, _i32, _i32])
        prefetch = builder.module.declare_intrinsic("llvm.prefetch", (pointer,), kind)
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
