"""Numbers of an array as arguments of a call: function(t, *spread(numbers, COUNT)) in a kernel."""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .arrays import joined
from .compiled import DEBUG


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
