"""Lanes: a number of several cases in one register; kernels run unchanged on their arrays."""

import math
import operator
from functools import cache

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model, type_callable

from .kernels import kernel
from .predicates import below, choose, floor, of_register
from .resident import joined, known_types, make_stacker, make_viewer
from .resident import zeros as numbers
from .simd import FOUR, spread

# Lanes: a number of several cases in one register, and arrays of such numbers, on which kernels run unchanged.
#
# A kernel that is given arrays of lanes is compiled for them: its source is that of one case. What it compares or
# branches on must be the same in all lanes, so numbers of lanes can't be compared but by masks (predicates.py).
#
#     lane_type(width)     of a number of so many cases        zeros(count, width)     an array of them, zero
#     makers(width)        stack, vector, matrix, ... of them by the names of what they stand for in resident.py

_f64 = ir.DoubleType()
WIDTHS = 4, 8  # lanes that there are types for


def _as(typing, kind):
    """What Numba says of the conversion of such a number to a float: exact of a float, safe of an integer."""
    return typing.can_convert(kind, types.float64)


class Lane(types.Type):
    """A number of several cases; `threes`: in arrays of which no more than three of four numbers are used."""

    def __init__(self, width, threes=False):
        self.width, self.bitwidth, self.threes = width, 64 * width, threes
        super().__init__(name=f"Lane({width}{', threes' * threes})")
        self.lane = lane_type(width) if threes else self
        self.four = FourLanes(self.lane, 3 if threes else 4)

    def __reduce__(self):
        """By what it is made of: Numba's own way of a stored type can't follow one that refers to itself."""
        return Lane, (self.width, self.threes)

    def can_convert_from(self, typing, other):
        """Plain numbers are the same in all lanes."""
        if isinstance(other, Lane):
            return _as(typing, types.float64)
        return _as(typing, types.int32) if isinstance(other, (types.Integer, types.Float)) else None

    def unify(self, typing, other):
        """A variable that is a plain number and one of lanes is one of lanes."""
        return self.lane if isinstance(other, (types.Integer, types.Float, Lane)) else None


class FourLanes(types.Type):
    """Four numbers of lanes, or the first three of four."""

    def __init__(self, lane, count):
        self.lane, self.count, self.four = lane, count, self
        super().__init__(name=f"FourLanes({lane.width}, {count})")

    def __reduce__(self):
        """As of `Lane`."""
        return FourLanes, (self.lane, self.count)

    @property
    def three(self):
        """The type of three."""
        return FourLanes(self.lane, 3)

    def can_convert_from(self, typing, other):
        """Four plain numbers are the same in all lanes; a fourth may be left out."""
        fits = other.count > self.count if isinstance(other, FourLanes) else other is FOUR
        return _as(typing, types.int32) if fits else None

    def unify(self, typing, other):
        """As of `Lane`."""
        return self if other is FOUR or (isinstance(other, FourLanes) and other.count > self.count) else None


@register_model(Lane)
class _LaneModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(_f64, kind.width))


@register_model(FourLanes)
class _FourLanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.ArrayType(ir.VectorType(_f64, kind.lane.width), kind.count))


@cache
def lane_type(width, threes=False):
    """The type of a number of so many cases."""
    return Lane(width, threes)


def _dtype(width, threes):
    return np.dtype([("threes" if threes else "lanes", np.float64, (width,))])


known_types.update({_dtype(width, threes): lane_type(width, threes) for width in WIDTHS for threes in (False, True)})


def zeros(count, width, threes=False):
    """So many numbers of lanes, zero: `values_of` them is (count, width)."""
    return numbers(count * width).view(_dtype(width, threes))


def is_laned(array):
    """Whether it is an array of lanes."""
    return array.dtype in known_types


def values_of(array):
    """The numbers of an array of lanes as (count, width) floats."""
    return array[array.dtype.names[0]]


@cache
def makers(width, threes=True):
    """What makes arrays in kernels, for numbers of lanes: by the names of resident.py."""
    kind, cell = lane_type(width, threes), ir.VectorType(_f64, width)
    stack, stack2 = make_stacker(kind, cell)
    vector, matrix = (make_viewer(types.Array(kind, n, "C")) for n in (1, 2))
    return {"stack": stack, "stack2": stack2, "vector": vector, "matrix": matrix}


@lower_cast(Lane, Lane)
def _keep(context, builder, given, kind, value):
    return value


@lower_cast(FourLanes, FourLanes)
def _leave_fourth(context, builder, given, kind, value):
    return joined(builder, [builder.extract_value(value, i) for i in range(kind.count)])


@lower_cast(types.Integer, Lane)
@lower_cast(types.Float, Lane)
def _spread_number(context, builder, given, kind, value):
    return spread(builder, context.cast(builder, value, given, types.float64), kind.width)


@lower_cast(type(FOUR), FourLanes)
def _spread_four(context, builder, given, kind, value):
    ones = [builder.extract_element(value, ir.Constant(ir.IntType(32), i)) for i in range(kind.count)]
    return joined(builder, [spread(builder, one, kind.lane.width) for one in ones])


def _typed(function, count):
    """Let the function take so many numbers, at least one of them of lanes."""

    def kind_of(*arguments):
        kind = next((each for each in arguments if isinstance(each, Lane)), None)
        plain = (Lane, types.Integer, types.Float)
        if kind is None or not all(isinstance(each, plain) for each in arguments):
            return None
        return kind.lane(*[kind.lane] * count)

    type_callable(function)(lambda context: (lambda x: kind_of(x)) if count == 1 else (lambda x, y: kind_of(x, y)))


def _operation(name, *functions):
    def generate(context, builder, signature, arguments):
        return getattr(builder, name)(*arguments)

    for function in functions:
        _typed(function, 2)
        lower_builtin(function, Lane, Lane)(generate)


_operation("fadd", operator.add, operator.iadd)
_operation("fsub", operator.sub, operator.isub)
_operation("fmul", operator.mul, operator.imul)
_operation("fdiv", operator.truediv, operator.itruediv)


def _of_registers(name, count, *functions):
    def generate(context, builder, signature, arguments):
        return of_register(builder, name, *arguments)

    for function in functions:
        _typed(function, count)
        lower_builtin(function, *[Lane] * count)(generate)


_of_registers("sqrt", 1, math.sqrt, np.sqrt)
_of_registers("fabs", 1, abs, np.abs)


def _larger(sign):
    def generate(context, builder, signature, arguments):
        a, b = arguments
        return builder.select(builder.fcmp_ordered(sign, b, a), b, a)

    return generate


for _function, _sign in ((max, ">"), (min, "<")):
    _typed(_function, 2)
    lower_builtin(_function, Lane, Lane)(_larger(_sign))


def _negate(context, builder, signature, arguments):
    return builder.fneg(arguments[0])


_typed(operator.neg, 1)
lower_builtin(operator.neg, Lane)(_negate)


def _one_by_one(function, count, *same):
    """Functions that are called for each lane."""

    def generate(context, builder, signature, arguments):
        typing = context.typing_context
        known = typing.resolve_value_type(function)
        called = context.get_function(known, typing.resolve_function_type(known, (types.float64,) * count, {}))
        result = ir.Constant(arguments[0].type, ir.Undefined)
        for i in range(signature.return_type.width):
            at = ir.Constant(ir.IntType(32), i)
            one = called(builder, [builder.extract_element(a, at) for a in arguments])
            result = builder.insert_element(result, one, at)
        return result

    for name in (function, *same):
        _typed(name, count)
        lower_builtin(name, *[Lane] * count)(generate)


_one_by_one(math.sin, 1, np.sin)
_one_by_one(math.cos, 1, np.cos)
_one_by_one(math.exp, 1, np.exp)
_one_by_one(math.log, 1, np.log)
_one_by_one(math.atan2, 2, np.arctan2)
_one_by_one(operator.pow, 2)


# Logarithms and exponentials of all lanes at once.
#
# exponent(x), scaled(x, n)    n with 1 <= x / 2^n < 2, and x 2^n, x and n of lanes, n whole

_i64 = ir.IntType(64)
_MANTISSA, _BIAS = 52, 1023  # bits of a float's fraction; what is added to its exponent


@intrinsic
def exponent(typing, x):
    """N with 1 <= x / 2^n < 2, of positive normal x."""

    def generate(context, builder, signature, arguments):
        wide = ir.VectorType(_i64, x.width)
        bits = builder.lshr(builder.bitcast(arguments[0], wide), ir.Constant(wide, [_MANTISSA] * x.width))
        bits = builder.sub(bits, ir.Constant(wide, [_BIAS] * x.width))
        return builder.sitofp(bits, arguments[0].type)

    return x.lane(x.lane), generate


@intrinsic
def scaled(typing, x, n):
    """X 2^n, n whole and from -1022 to 1023."""

    def generate(context, builder, signature, arguments):
        value, n = arguments
        wide = ir.VectorType(_i64, x.width)
        bits = builder.add(builder.fptosi(n, wide), ir.Constant(wide, [_BIAS] * x.width))
        power = builder.bitcast(builder.shl(bits, ir.Constant(wide, [_MANTISSA] * x.width)), value.type)
        return builder.fmul(value, power)

    return x.lane(x.lane, x.lane), generate


@kernel
def binary_log(x):
    """log2 x of positive normal x, to 1e-9: 2 / ln 2 artanh((m - 1) / (m + 1)) of the fraction m."""
    n = exponent(x)
    m = scaled(x, -n)
    high = below(1.4142135623730951, m)
    m, n = choose(high, 0.5 * m, m), choose(high, n + 1.0, n)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    series = 1.0 + z * (1.0 / 3.0 + z * (0.2 + z * (1.0 / 7.0 + z * (1.0 / 9.0 + z * (1.0 / 11.0)))))
    return n + 2.8853900817779268 * s * series


@kernel
def binary_power(y):
    """2^y to 1e-9, y from -1000 to 1000."""
    y = max(-1000.0, min(1000.0, y))  # in this order not-a-number is left out
    n = floor(y + 0.5)
    f = 0.6931471805599453 * (y - n)
    e = 1.0 + f / 5.0 * (1.0 + f / 6.0 * (1.0 + f / 7.0))
    return scaled(1.0 + f * (1.0 + f / 2.0 * (1.0 + f / 3.0 * (1.0 + f / 4.0 * e))), n)
