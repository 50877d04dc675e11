"""Predicates of numbers for kernels that serve one case and lanes alike; of lanes (lanes.py) one answer serves all.

serves(k, x, limit)  whether x is a pivot: limit k k < x k < inf; of lanes always, since each is judged later
some(x)              whether x is not zero, in any lane
most(x)              x; of lanes the largest
or_one(x)            x where it is above zero, else one, in each lane
whole(x)             the integer that x is, in the first lane
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .compiled import DEBUG
from .simd import number_type

_f64, _i32 = ir.DoubleType(), ir.IntType(32)


@intrinsic
def serves(typing, k, x, limit):
    """Whether x is a pivot, k being the diagonal entry before elimination: limit k k < x k < inf.

    Of lanes always: a pivot that doesn't serve leaves a small share, or what is not finite, which is judged in each.
    """
    number = number_type(k, x)

    def generate(context, builder, signature, arguments):
        if number is not types.float64:
            return context.get_constant(types.boolean, True)
        k, x, limit = arguments
        least, size = builder.fmul(builder.fmul(limit, k), k), builder.fmul(x, k)
        above = builder.fcmp_ordered("<", least, size)
        return builder.and_(above, builder.fcmp_ordered("<", size, ir.Constant(_f64, float("inf"))))

    return types.boolean(number, number, types.float64), generate


@intrinsic
def some(typing, x):
    """Whether x is not zero, in any lane."""
    number = number_type(x)

    def generate(context, builder, signature, arguments):
        x = arguments[0]
        if number is types.float64:
            return builder.fcmp_unordered("!=", x, ir.Constant(_f64, 0.0))
        zero = builder.fcmp_unordered("!=", x, ir.Constant(x.type, [0.0] * x.type.count))
        return builder.icmp_unsigned("!=", builder.bitcast(zero, ir.IntType(x.type.count)), ir.IntType(x.type.count)(0))

    return types.boolean(number), generate


some.plain = bool  # for the plain Python function of a kernel that asks: `twin`


@intrinsic
def or_one(typing, x):
    """X where it is above zero, else one."""
    number = number_type(x)

    def generate(context, builder, signature, arguments):
        x = arguments[0]
        zero, one = (ir.Constant(x.type, i if number is types.float64 else [i] * x.type.count) for i in (0.0, 1.0))
        return builder.select(builder.fcmp_ordered(">", x, zero), x, one)

    return number(number), generate


@intrinsic
def most(typing, x):
    """x; of lanes the largest."""
    number = number_type(x)

    def generate(context, builder, signature, arguments):
        x = arguments[0]
        if number is types.float64:
            return x
        found, *others = [builder.extract_element(x, _i32(i)) for i in range(x.type.count)]
        for other in others:
            found = builder.select(builder.fcmp_ordered(">", other, found), other, found)
        return found

    return types.float64(number), generate


@intrinsic
def whole(typing, x):
    """The integer that x is; of lanes the first one's."""
    number = number_type(x)

    def generate(context, builder, signature, arguments):
        x = arguments[0] if number is types.float64 else builder.extract_element(arguments[0], _i32(0))
        return builder.fptosi(x, ir.IntType(64))

    return types.int64(number), generate


if DEBUG:

    def serves(k, x, limit):
        """Whether x is a pivot."""
        return limit * k * k < x * k < np.inf

    def some(x):
        """Whether x is not zero."""
        return x != 0.0

    def or_one(x):
        """X where it is above zero, else one."""
        return x if x > 0.0 else 1.0

    def most(x):
        """The number itself."""
        return x

    whole = int
