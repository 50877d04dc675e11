"""Masks: a truth value of each lane, and what is chosen by them; logarithms and exponentials of all lanes at once.

below(x, y)          x < y in each lane               choose(m, f, g)     f where the mask is set, g elsewhere
both(m, n), either(m, n), opposite(m)                 every(m), any_of(m)  of all lanes: a plain truth value
exponent(x), scaled(x, n)    n with 1 <= x / 2^n < 2, and x 2^n, x and n of lanes, n whole
"""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model

from .arrays import joined
from .kernels import kernel
from .lanes import FourLanes, Lane, of_register

_i64 = ir.IntType(64)
_MANTISSA, _BIAS = 52, 1023  # bits of a float's fraction; what is added to its exponent


class Mask(types.Type):
    """A truth value of each lane."""

    def __init__(self, width):
        self.width = width
        super().__init__(name=f"Mask({width})")


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), kind.width))


@intrinsic
def below(typing, x, y):
    """Whether x < y, in each lane; one of them may be a plain number."""
    kind = next(each.lane for each in (x, y) if isinstance(each, Lane))

    def generate(context, builder, signature, arguments):
        return builder.fcmp_ordered("<", *arguments)

    return Mask(kind.width)(kind, kind), generate


@intrinsic
def choose(typing, mask, f, g):
    """F in the lanes of the mask, g in the others: numbers, or three or four of them."""
    kind = next((each for each in (f, g) if isinstance(each, FourLanes)), None)
    kind = kind or next(each.lane for each in (f, g) if isinstance(each, Lane))

    def generate(context, builder, signature, arguments):
        mask, f, g = arguments
        if isinstance(kind, Lane):
            return builder.select(mask, f, g)
        parts = [
            builder.select(mask, builder.extract_value(f, i), builder.extract_value(g, i)) for i in range(kind.count)
        ]
        return joined(builder, parts)

    return kind(mask, kind, kind), generate


def _binary(name, what):
    @intrinsic
    def operation(typing, m, n):
        def generate(context, builder, signature, arguments):
            return getattr(builder, name)(*arguments)

        return m(m, n), generate

    operation.__doc__ = what
    return operation


both, either = _binary("and_", "Of two masks."), _binary("or_", "Of two masks.")


@intrinsic
def opposite(typing, m):
    """The lanes that the mask leaves out."""

    def generate(context, builder, signature, arguments):
        return builder.not_(arguments[0])

    return m(m), generate


def _judged(sign, all_of, what):
    @intrinsic
    def operation(typing, m):
        def generate(context, builder, signature, arguments):
            bits = ir.IntType(m.width)
            return builder.icmp_unsigned(sign, builder.bitcast(arguments[0], bits), bits(-1 if all_of else 0))

        return types.boolean(m), generate

    operation.__doc__ = what
    return operation


every, any_of = _judged("==", True, "Whether all lanes are set."), _judged("!=", False, "Whether any lane is set.")


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


@intrinsic
def floor(typing, x):
    """The largest whole number that is not above x."""

    def generate(context, builder, signature, arguments):
        return of_register(builder, "floor", arguments[0])

    return x.lane(x.lane), generate


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
