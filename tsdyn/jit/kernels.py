"""How kernels are compiled and called: the only file that uses Numba's decorators and code generation.

Kernels are compiled without Numba's runtime, so a kernel that would allocate or count references does not compile.
What is chosen at run time (a primitive, a method, a formulation) is called by address, all arguments being 64-bit
integers, floats and addresses of arrays; no new scene or plug-in ever recompiles a caller.

With TSDYN_DEBUG=1 in the environment nothing is compiled: every kernel is the plain Python function that it was
written as, addresses are indices into a table, and a debugger or a print works anywhere.
"""

import dis
import platform
from hashlib import sha256

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import RequireLiteralValue
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model
from numba.np.arrayobj import populate_array

from ..errors import InvalidConstraint
from .compiled import DEBUG, Callback, callback, entry, letters, table
from .compiler import OPTIONS, Callee, is_ours

__all__ = ["Callback", "callback", "entry"]  # what is to be found here, too
RAISE = dis.opmap["RAISE_VARARGS"]
ANY = 1 << 40  # the length of arrays whose length a kernel doesn't need


def kernel(function, allocates=False, inline=True):
    """Compile a function that other kernels call; it is compiled into each of them.

    With allocates=True it may allocate and raise, indices are checked, and it is not inlined: for functions of time.

    Examples
    --------
    >>> import tsdyn as ts
    >>> @ts.kernel
    ... def cube(x):
    ...     return x * x * x
    >>> cube(2.0)
    8.0
    """
    if allocates:
        options = {**OPTIONS, "_nrt": True, "boundscheck": True}
    elif RAISE in function.__code__.co_code[::2]:  # every second byte is an operation
        raise InvalidConstraint(
            f"{function.__qualname__}: a kernel can't raise or assert; write nan where there is no value."
        )
    else:
        options = {**OPTIONS, "forceinline": inline}
        if is_ours(function.__module__) and not DEBUG:
            return Callee(function, options)
    return function if DEBUG else numba.njit(**options)(function)


def long_kernel(function):
    """`kernel` for what is long and not called often: it is called where it is used, which compiles in less time."""
    return kernel(function, inline=False)


def twin(function):
    """Return the plain Python function of a kernel, calling the plain functions of the kernels that it calls."""
    function = getattr(function, "py_func", function)
    inner = {
        name: twin(value)
        for name in function.__code__.co_names
        if hasattr(value := function.__globals__.get(name), "py_func")
    }
    if not inner:
        return function
    return type(function)(
        function.__code__,
        {**function.__globals__, **inner},
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )


def specialised(template, name, owner, **constants):
    """Copy a function under another name, with some of its globals replaced by constants or kernels.

    The copy claims to stand where `owner` does, so that it is cached, and its cache entry replaced, with the owner.
    """
    code = template.__code__.replace(co_filename=owner.__code__.co_filename, co_name=name, co_qualname=name)
    copy = type(template)(code, {**template.__globals__, **constants}, name)
    copy.__qualname__, copy.__module__ = name, owner.__module__
    return copy


_i64, _f64 = ir.IntType(64), ir.DoubleType()
_vector = types.Array(types.float64, 1, "C")
_matrix = types.Array(types.float64, 2, "C")
_integers = types.Array(types.int64, 1, "C")


def _array(context, builder, kind, pointer, shape):
    """An array over memory that somebody else owns."""
    array = context.make_array(kind)(context, builder)
    size = context.get_constant(types.intp, kind.dtype.bitwidth // 8)
    strides = [size]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    data = builder.bitcast(pointer, array.data.type)
    populate_array(array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None, parent=None)
    return array._getvalue()


def _literal(value):
    if not isinstance(value, types.IntegerLiteral):
        raise RequireLiteralValue("the size of a stack array is a constant")
    return value.literal_value


def _stacker(kind, cell):
    """Make the kernels of vectors and matrices of some kind of number on the stack; their content is undefined."""

    @intrinsic(prefer_literal=True)
    def one(typing, n):
        length = _literal(n)

        def generate(context, builder, signature, arguments):
            pointer = cgutils.alloca_once(builder, ir.ArrayType(cell, length))
            return _array(context, builder, signature.return_type, pointer, [context.get_constant(types.intp, length)])

        return types.Array(kind, 1, "C")(n), generate

    @intrinsic(prefer_literal=True)
    def two(typing, n, m):
        shape = _literal(n), _literal(m)

        def generate(context, builder, signature, arguments):
            pointer = cgutils.alloca_once(builder, ir.ArrayType(cell, shape[0] * shape[1]))
            lengths = [context.get_constant(types.intp, s) for s in shape]
            return _array(context, builder, signature.return_type, pointer, lengths)

        return types.Array(kind, 2, "C")(n, m), generate

    return one, two


# stack(n) is a vector of n floats on the stack, stack2(n, m) a matrix; n and m are constants
stack, stack2 = _stacker(types.float64, _f64)
complex_stack, complex_stack2 = _stacker(types.complex128, ir.LiteralStructType([_f64, _f64]))


def _viewer(kind):
    @intrinsic
    def view(typing, address, *shape):
        def generate(context, builder, signature, arguments):
            pointer = builder.inttoptr(arguments[0], _f64.as_pointer())
            parts = cgutils.unpack_tuple(builder, arguments[1]) if len(arguments) == 2 else list(arguments[1:])
            return _array(context, builder, kind, pointer, list(parts))

        return kind(types.int64, types.StarArgTuple([types.intp] * len(shape))), generate

    return view


vector = _viewer(_vector)
matrix = _viewer(_matrix)
integers = _viewer(_integers)


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


def resident(value, header=()):
    """A named tuple of arrays in memory, for kernels that `loader` makes: its address, and what keeps it there.

    To call a kernel with the tuple itself takes 0.2 us an array, each time. The header's integers stand before it.
    """
    if DEBUG:
        return value, None
    image = np.array([*header, *image_of(value)], np.int64)
    return image.ctypes.data + 8 * len(header), (image, value)


def image_of(value):
    """Of each array the address of its numbers, then its lengths; of a tuple those of its fields in turn."""
    if isinstance(value, tuple):
        return [word for field in value for word in image_of(field)]
    assert value.flags.c_contiguous
    return [value.ctypes.data, *value.shape]


def _words(kind):
    """How many words the image of a type takes."""
    return 1 + kind.ndim if isinstance(kind, types.Array) else sum(map(_words, kind))


class _Seen(types.Type):
    """A named tuple of arrays that is in memory; a kernel reads of it what it uses, when it uses it."""

    def __init__(self, kind):
        self.kind = kind
        super().__init__(name=f"Seen({kind.instance_class.__name__} {sha256(str(kind).encode()).hexdigest()[:12]})")


@register_model(_Seen)
class _SeenModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _i64)


@infer_getattr
class _SeenFields(AttributeTemplate):
    key = _Seen

    def generic_resolve(self, seen, name):
        """The type of a field: an array, or again something seen."""
        if name in seen.kind.fields:
            field = seen.kind.types[seen.kind.fields.index(name)]
            return field if isinstance(field, types.Array) else _Seen(field)
        return None


@lower_getattr_generic(_Seen)
def _seen_field(context, builder, seen, address, name):
    at = seen.kind.fields.index(name)
    field = seen.kind.types[at]
    place = builder.add(address, _i64(8 * sum(map(_words, seen.kind.types[:at]))))
    if not isinstance(field, types.Array):
        return place
    words = builder.inttoptr(place, _i64.as_pointer())
    pointer, *shape = (_word(builder, words, i) for i in range(1 + field.ndim))
    return _array(context, builder, field, builder.inttoptr(pointer, _f64.as_pointer()), shape)


def _word(builder, words, i):
    """A word of memory that no kernel changes, which says so to the compiler."""
    word = builder.load(builder.gep(words, [_i64(i)]))
    word.set_metadata("invariant.load", builder.module.add_metadata([]))
    return word


def loader(example):
    """Make the kernel that gives sight of a named tuple of example's type by its address.

    Passed as a value it would be hundreds of words for every kernel, most of them unused, and slow to compile.
    """
    if DEBUG:
        return lambda value: value
    kind = _Seen(numba.typeof(example))

    @intrinsic
    def load(typing, address):
        def generate(context, builder, signature, arguments):
            return arguments[0]

        return kind(types.int64), generate

    return load


def caller(signature, result="i"):
    """Make the kernel that calls a `Callback` of this signature: call(address, *arguments), arrays as they are."""
    if DEBUG:
        return lambda address, *arguments: table[address](*arguments)
    native = {"i": _i64, "d": _f64, "p": _i64}

    @intrinsic
    def call(typing, address, *arguments):
        wanted = [
            given if isinstance(given, types.Array) else letters[letter]
            for letter, given in zip(signature, arguments, strict=True)
        ]

        def generate(context, builder, sig, values):
            given = cgutils.unpack_tuple(builder, values[1])
            words = []
            for kind, value in zip(wanted, given, strict=True):
                if isinstance(kind, types.Array):
                    data = context.make_array(kind)(context, builder, value=value).data
                    value = builder.ptrtoint(data, _i64)
                words.append(value)
            target = ir.FunctionType(native[result], [native[c] for c in signature]).as_pointer()
            return builder.call(builder.inttoptr(values[0], target), words)

        return letters[result](types.int64, types.StarArgTuple(wanted)), generate

    return call


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

    def data_of(array):
        """The array itself."""
        return array
