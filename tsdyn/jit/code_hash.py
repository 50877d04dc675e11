"""Hash of everything that determines the machine code of a function.

Numba stamps a cached kernel with the content of its own file only, so an edit of a callee in another file returns stale
machine code. This hash follows references instead: byte code and constants of the function itself and of every
function, class, constant and module that it names, at any depth. An edit changes the hash of the kernels that depend on
it, and of no others.
"""

import contextlib
import enum
import hashlib
import pickle
import platform
import sys
import types
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numba
from llvmlite import ir

_COMPILERS = ("numba", "llvmlite", "numpy")  # their versions name the folder of kernels
_LIBRARIES = (*_COMPILERS, "math", "cmath", "scipy")  # nothing of them is followed
_PACKAGE = __name__.partition(".")[0]
_known = {}  # function: hash; the function is kept alive, so that the key stays its own


@cache
def versions():
    """The versions of all that compiles."""
    found = {"Python": platform.python_version().rpartition(".")[0]}
    for name in _COMPILERS:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


@cache
def platform_hash():
    """Hash the versions of all that compiles, and the package's own code generation."""
    return hashlib.sha256(f"{versions()}{_generator_hash()}".encode()).hexdigest()[:16]


@cache
def _generator_hash():
    """Hash the package's own code generation."""
    digest = hashlib.sha256(repr(sys.version_info[:2]).encode())  # of byte code
    for file in sorted(Path(__file__).parent.glob("*.py")):  # code that no function names: types and their lowering
        content = file.read_bytes()
        if b"from numba.extending import" in content:
            digest.update(content)
    return digest.hexdigest()


def is_ours(module):
    """Whether a module is one of tsdyn's. A user's kernel may be anything that Numba compiles, such as a recursion."""
    return (module or "").partition(".")[0] == _PACKAGE


def deep_hash(function):
    """Hash a function with all the code, constants and modules that its compiled form depends on.

    Versions of what compiles are left out: kernels that came with tsdyn may serve with other ones.
    """
    digest = hashlib.sha256(_generator_hash().encode())
    digest.update(_function_hash(_plain(function), ()))
    return digest.hexdigest()[:24]


def types_hash(kinds):
    """Hash Numba's types with the names of their fields."""
    digest = hashlib.sha256()
    for kind in kinds:
        _add_type(digest, kind)
    return digest.hexdigest()[:12]


def _plain(value):
    """The Python function of a dispatcher or of an intrinsic; whatever else as it is."""
    if isinstance(value, (types.FunctionType, type)):
        return value
    return getattr(value, "py_func", getattr(value, "__wrapped__", value))


def _function_hash(function, above):
    """Hash a function; `above` are the functions whose hashes are being made."""
    if function in above:
        return f"recursion {above.index(function) - len(above)}".encode()
    ours = is_ours(function.__module__)  # a global of a user's may change
    if ours and function in _known:
        return _known[function]
    digest, above = hashlib.sha256(), (*above, function)
    digest.update(f"{function.__module__}\0".encode())  # a stored kernel imports the modules of its callees
    _add_code(digest, function.__code__, function.__globals__, above, function.__doc__)
    for default in (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).items()):
        _add(digest, default, above)
    for cell in function.__closure__ or ():
        with contextlib.suppress(ValueError):  # an empty cell
            _add(digest, cell.cell_contents, above)
    result = digest.digest()
    if ours:
        _known[function] = result
    return result


def _add_code(digest, code, namespace, above, docstring=None):
    digest.update(code.co_code)
    documented = docstring is not None and code.co_consts[:1] == (docstring,)  # no machine code depends on it
    for constant in code.co_consts[documented:]:
        if isinstance(constant, types.CodeType):
            _add_code(digest, constant, namespace, above)
        else:
            digest.update(repr(constant).encode())
    modules = []
    for name in code.co_names:
        digest.update(f"{name}\0".encode())
        if name in namespace:
            value = namespace[name]
            _add(digest, value, above)
            if _has_attributes_of_interest(value):
                modules.append(value)
    for module in modules:  # what is reached as module.name, or package.module.name
        for name in code.co_names:
            value = vars(module).get(name)
            if _has_attributes_of_interest(value):
                if value not in modules:
                    _add(digest, value, above)
                    modules.append(value)
            elif name in vars(module):
                _add(digest, value, above)


def _has_attributes_of_interest(value):
    return isinstance(value, types.ModuleType) and value.__name__.partition(".")[0] not in _LIBRARIES


def _add(digest, value, above):
    options = getattr(value, "targetoptions", None)  # of a dispatcher: whether it may allocate, is inlined, ...
    if options:
        digest.update(repr(sorted(options.items())).encode())
    value = _plain(value)
    digest.update(f"{type(value).__qualname__}\0".encode())
    if isinstance(value, types.FunctionType):
        digest.update(_function_hash(value, above))
    elif isinstance(value, types.ModuleType):
        _add_module(digest, value)
    elif isinstance(value, type):
        _add_class(digest, value, above)
    elif isinstance(value, numba.types.Type):
        _add_type(digest, value)
    elif isinstance(value, (tuple, list)):
        digest.update(str(len(value)).encode())
        for item in value:
            _add(digest, item, above)
    elif isinstance(value, dict):
        for key, item in value.items():
            _add(digest, key, above)
            _add(digest, item, above)
    elif type(value).__module__.startswith("llvmlite"):  # its pickle changes when it has been used
        digest.update((str(value) if isinstance(value, ir.Type) else type(value).__name__).encode())
    else:
        try:
            digest.update(pickle.dumps(value, protocol=5))
        except Exception:  # an object without a value of its own: its type has to do
            digest.update(f"{type(value).__module__}\0".encode())


def _add_module(digest, module):
    home = module.__name__.partition(".")[0]
    known = "" if home in _COMPILERS else getattr(module, "__version__", "")
    digest.update(f"{module.__name__} {known}\0".encode())
    file = getattr(module, "__file__", None) or ""
    if file.endswith(".py") and home not in (*_LIBRARIES, _PACKAGE):
        with contextlib.suppress(OSError):
            digest.update(Path(file).read_bytes())


def _add_class(digest, kind, above):
    digest.update(f"{kind.__module__}.{kind.__qualname__}\0".encode())
    if issubclass(kind, enum.Enum):
        digest.update(repr([(name, member.value) for name, member in kind.__members__.items()]).encode())
    elif hasattr(kind, "_fields"):
        digest.update(repr(kind._fields).encode())
    elif issubclass(kind, numba.types.Type):  # its model and lowering are registered beside it, and named nowhere
        _add_module(digest, sys.modules[kind.__module__])


def _add_type(digest, kind):
    """Add a Numba type: its name, and the names of fields, which a tuple's own name leaves out."""
    digest.update(f"{kind}\0".encode())
    _add_module(digest, sys.modules[type(kind).__module__])
    kind = getattr(kind, "kind", kind)  # a named tuple in memory
    if isinstance(kind, numba.types.BaseNamedTuple):  # a stored kernel imports its class
        digest.update(f"{kind.instance_class.__module__} {kind.fields}".encode())
    if isinstance(kind, numba.types.BaseTuple):
        for field in kind.types:
            _add_type(digest, field)
