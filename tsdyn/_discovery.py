"""Import every module of a folder and export the public classes that it defines."""

import pkgutil
from importlib import import_module

from .calls import hint
from .errors import UnknownAttribute


def export_all(package, path, namespace, *bases):
    """Put into `namespace` each class of the package's modules that descends from a class named in `bases`."""
    names = []
    for module in pkgutil.iter_modules(path):
        content = import_module(f"{package}.{module.name}")
        for name, value in vars(content).items():
            own = isinstance(value, type) and value.__module__ == content.__name__ and not name.startswith("_")
            if own and any(ancestor.__name__ in bases for ancestor in value.__mro__[1:]):
                namespace[name] = value
                names.append(name)
    return names


def refusing(where, known, *inner):
    """Make the `__getattr__` of a module: what is missing is refused with what may have been meant, also of `inner`."""

    def __getattr__(name):
        if name.startswith("_"):
            raise AttributeError(f"{where} has no {name}")
        for module in inner:
            if name in module.__all__:
                raise UnknownAttribute(
                    f"{where} has no {name}; here it is {where}.{module.__name__.split('.')[-1]}.{name}."
                )
        raise UnknownAttribute(f"{where} has no {name}{hint(where, name, known)}")

    return __getattr__


def listing(known, kind, example):
    """Make the public function that returns every class of a kind; `known` returns them by name."""

    def registered():
        return tuple(known().values())

    registered.__annotations__["return"] = f"tuple[type[{kind}], ...]"
    registered.__doc__ = f"""Return every class of {kind} known, built in or plugged in.

    Examples
    --------
    >>> import tsdyn as ts
    >>> {example}
    True
    """
    return registered
