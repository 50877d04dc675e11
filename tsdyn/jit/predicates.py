"""Predicates of numbers for kernels that serve one case and lanes alike; of lanes (lanes.py) one answer serves all.

serves(k, x, limit)  whether x is a pivot: limit k k < x k < inf; of lanes always, since each is judged later
some(x)              whether x is not zero, in any lane
most(x)              x; of lanes the largest
whole(x)             the integer that x is, in the first lane
floor(x)             the largest whole number that is not above x, in each lane

Masks are a truth value of each lane; of one case a plain one, and a kernel has no branch more for them.

below(x, y)          x < y in each lane               choose(m, f, g)     f where the mask is set, g elsewhere
both(m, n), either(m, n), opposite(m)                 every(m), any_of(m)  of all lanes: a plain truth value
within(k, top)       k <= top in each lane; of one case always, since its loops end at its own top
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model

from .compiled import DEBUG
from .resident import joined
from .simd import FOUR, number_type

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


def of_register(builder, name, *values):
    """A function that LLVM has for numbers and for registers of them, of these."""
    kind = values[0].type
    wanted = ir.FunctionType(kind, [kind] * len(values))
    full = f"llvm.{name}." + (f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64")
    function = builder.module.globals.get(full) or ir.Function(builder.module, wanted, full)
    return builder.call(function, values)


@intrinsic
def floor(typing, x):
    """The largest whole number that is not above x, a float."""
    number = number_type(x)

    def generate(context, builder, signature, arguments):
        return of_register(builder, "floor", arguments[0])

    return number(number), generate


class Mask(types.Type):
    """A truth value of each lane."""

    def __init__(self, width):
        self.width = width
        super().__init__(name=f"Mask({width})")

    def unify(self, typing, other):
        """Numbers that turn out to be of lanes were plain at first, and so was their truth value."""
        return self if other is types.boolean else None


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), kind.width))


def _mask_type(kind):
    """Of the comparison of such numbers."""
    return types.boolean if kind is types.float64 else Mask(kind.width)


@intrinsic
def below(typing, x, y):
    """Whether x < y, in each lane; one of them may be a plain number."""
    kind = number_type(x, y)

    def generate(context, builder, signature, arguments):
        return builder.fcmp_ordered("<", *arguments)

    return _mask_type(kind)(kind, kind), generate


@intrinsic
def within(typing, k, top):
    """Whether k <= top, in each lane; of one case always, since its loops end at its own top."""
    kind = number_type(top)

    def generate(context, builder, signature, arguments):
        return ir.Constant(ir.IntType(1), 1) if kind is types.float64 else builder.fcmp_ordered("<=", *arguments)

    return _mask_type(kind)(kind, kind), generate


@intrinsic
def choose(typing, mask, f, g):
    """F in the lanes of the mask, g in the others: numbers, or three or four of them."""
    fours = [each for each in (f, g) if each is FOUR or hasattr(each, "count")]
    kind = min(fours, key=lambda four: getattr(four, "count", 5)) if fours else number_type(f, g)

    def generate(context, builder, signature, arguments):
        mask, f, g = arguments
        if not hasattr(kind, "count"):
            return builder.select(mask, f, g)
        pairs = [(builder.extract_value(f, i), builder.extract_value(g, i)) for i in range(kind.count)]
        return joined(builder, [builder.select(mask, *pair) for pair in pairs])

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
            if m is types.boolean:
                return arguments[0]
            bits = ir.IntType(m.width)
            return builder.icmp_unsigned(sign, builder.bitcast(arguments[0], bits), bits(-1 if all_of else 0))

        return types.boolean(m), generate

    operation.__doc__ = what
    return operation


every, any_of = _judged("==", True, "Whether all lanes are set."), _judged("!=", False, "Whether any lane is set.")

if DEBUG:

    def serves(k, x, limit):
        """Whether x is a pivot."""
        return limit * k * k < x * k < np.inf

    def some(x):
        """Whether x is not zero."""
        return x != 0.0

    def most(x):
        """The number itself."""
        return x

    whole, floor = int, np.floor

    def below(x, y):
        """Whether x < y."""
        return x < y

    def within(k, top):
        """Whether k <= top."""
        return k <= top

    def choose(mask, f, g):
        """F if the mask is set, else g."""
        return f if mask else g

    def opposite(m):
        """Not m."""
        return not m

    def every(m):
        """The mask itself."""
        return m

    both, either, any_of = (lambda m, n: m and n), (lambda m, n: m or n), every
