"""How kernels are compiled and called. This package alone uses the decorators and code generation of Numba.

Kernels are compiled without Numba's runtime, so a kernel that would allocate or count references does not compile.
What is chosen at run time (a primitive, a method, a formulation) is called by address, all arguments being 64-bit
integers, floats and addresses of arrays; no new scene or plug-in ever recompiles a caller.

With TSDYN_DEBUG=1 in the environment nothing is compiled: every kernel is the plain Python function that it was
written as, addresses are indices into a table, and a debugger or a print works anywhere.
"""

import dis

import numba
from llvmlite import ir
from numba import NumbaError, types
from numba.extending import intrinsic

from ..errors import InvalidConstraint
from .code_hash import is_ours
from .compiled import DEBUG, OPTIONS, Callback, Callee, callback, entry, is_copy, letters, table
from .compilers import current
from .resident import (
    ANY,
    HAS_CYCLES,
    Record,
    Seen,
    complex_stack,
    complex_stack2,
    complex_vector,
    cycles,
    data_of,
    image_of,
    integers,
    loader,
    matrix,
    record_at,
    records,
    resident,
    row_of,
    seen,
    stack,
    stack2,
    vector,
)

__all__ = [  # what is to be found here, too
    "ANY",
    "HAS_CYCLES",
    "Callback",
    "NumbaError",
    "Record",
    "callback",
    "complex_stack",
    "complex_stack2",
    "complex_vector",
    "cycles",
    "data_of",
    "entry",
    "image_of",
    "integers",
    "loader",
    "matrix",
    "record_at",
    "records",
    "resident",
    "row_of",
    "seen",
    "stack",
    "stack2",
    "vector",
]
_FLOAT = letters["d"]
RAISE = dis.opmap["RAISE_VARARGS"]


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
        options = {**OPTIONS, "boundscheck": True}
    elif RAISE in function.__code__.co_code[::2]:  # every second byte is an operation
        raise InvalidConstraint(
            f"{function.__qualname__}: a kernel can't raise or assert; write nan where there is no value."
        )
    else:
        options = {**OPTIONS, "forceinline": inline}
    if not DEBUG and (is_copy(function) or (is_ours(function.__module__) and not allocates)):
        return Callee(function, options, allocates)
    return function if DEBUG else numba.njit(**options, **current().options(allocates))(function)


def long_kernel(function):
    """`kernel` for what is long and not called often: it is called where it is used, which compiles in less time."""
    return kernel(function, inline=False)


def twin(function):
    """Return the plain Python function of a kernel, calling the plain functions of the kernels that it calls."""
    function = getattr(function, "py_func", function)
    known = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    inner = {name: twin(value) for name, value in known.items() if hasattr(value, "py_func")}
    inner |= {name: value.plain for name, value in known.items() if hasattr(value, "plain")}
    if not inner:
        return function
    return type(function)(
        function.__code__,
        {**function.__globals__, **inner},
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )


def part(function):
    """Mark what a template calls and what needs the same constants: `specialised` copies it along."""
    function.is_part = True
    return function


def specialised(template, name, owner, make=kernel, **constants):
    """Copy a function under another name, with some of its globals replaced by constants or kernels.

    The copy claims to stand where `owner` does, so that it is cached, and its cache entry replaced, with the owner.
    Each `part` that it calls is copied in the same way and made a kernel by `make`.
    """
    known = template.__globals__
    parts = {called: _copied(known[called], owner, make, constants) for called in _parts_of(template)}
    code = template.__code__.replace(co_filename=owner.__code__.co_filename, co_name=name, co_qualname=name)
    copy = type(template)(code, {**known, **constants, **parts}, name)
    copy.__qualname__, copy.__module__ = name, owner.__module__
    copy.is_copy = is_ours(known["__name__"])  # whatever module it claims to be of
    return copy


_copies = {}  # kernels of parts


def _copied(template, owner, make, constants):
    """The kernel of a part: one for all loops in which what it names of the constants is the same."""
    named = list(_named(template, constants))
    if all(is_ours(getattr(value, "py_func", template).__module__) for _, value in named):
        owner = template
    values = ((name, value if callable(value) else repr(value)) for name, value in named)
    key = template, make, owner.__module__, *values
    if key not in _copies:
        _copies[key] = make(specialised(template, template.__qualname__, owner, make, **constants))
    return _copies[key]


def _parts_of(template):
    """Names of the parts that a template calls."""
    return [name for name in template.__code__.co_names if getattr(template.__globals__.get(name), "is_part", False)]


def _named(template, constants):
    """The constants that a template, and the parts that it calls, name."""
    yield from ((name, constants[name]) for name in template.__code__.co_names if name in constants)
    for part in _parts_of(template):
        yield from _named(template.__globals__[part], constants)


def caller(signature, result="i", linked=None):
    """Make the kernel that calls a `Callback` of this signature: call(address, *arguments).

    Arrays, records, and what a loader gives, are passed as they are. Where an array isn't of floats, but of lanes or
    complex numbers, the kernel `linked` is called with the same arguments.
    """
    if DEBUG:
        return lambda address, *arguments: table[address](*arguments)
    native = {"i": ir.IntType(64), "d": ir.DoubleType(), "p": ir.IntType(64)}

    @intrinsic
    def call(typing, address, *arguments):
        wanted = [
            given if isinstance(given, (types.Array, types.Record, Seen)) else letters[letter]
            for letter, given in zip(signature, arguments, strict=True)
        ]
        own = None
        if linked is not None and any(isinstance(kind, types.Array) and kind.dtype != _FLOAT for kind in wanted):
            own = numba.typeof(linked).get_call_type(typing, tuple(wanted), {})

        def generate(context, builder, sig, values):
            given = [builder.extract_value(values[1], i) for i in range(len(wanted))]
            if own is not None:
                return context.get_function(numba.typeof(linked), own)(builder, given)
            words = []
            for kind, value in zip(wanted, given, strict=True):
                if isinstance(kind, types.Array):
                    data = context.make_array(kind)(context, builder, value=value).data
                    value = builder.ptrtoint(data, native["p"])  # something seen is its address
                elif isinstance(kind, types.Record):
                    value = builder.ptrtoint(value, native["p"])
                words.append(value)
            # the one typed pointer: llvmlite reads the signature of a call by address from it
            target = ir.PointerType(ir.FunctionType(native[result], [native[c] for c in signature]))
            return builder.call(builder.inttoptr(values[0], target), words)

        return letters[result](types.int64, types.StarArgTuple(wanted)), generate

    return call
