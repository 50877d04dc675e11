"""The scene and the arguments of a run as bytes that hold no code.

Only classes of tsdyn and of NumPy's arrays are read back; a class or a function of a user's is named in place of being
loaded, so that a file runs nothing.
"""

import io
import pickle

from ..errors import StorageError

_OTHERS = {
    "builtins": {"set", "frozenset", "slice", "complex", "range"},
    "collections": {"OrderedDict"},
    "copyreg": {"_reconstructor"},
    "numpy": {"dtype", "ndarray"},
    "numpy._core.multiarray": {"_reconstruct", "scalar"},
    "numpy.core.multiarray": {"_reconstruct", "scalar"},
    "numpy._core.numeric": {"_frombuffer"},
}


class Foreign(Exception):
    """Something that only its owner can pass again; its name."""


def dumps(value):
    """The value as bytes; raises `Foreign` if it holds a function or a class of a user's."""
    try:
        payload = pickle.dumps(value, protocol=5)
    except Exception as error:  # lambdas and local functions
        raise Foreign(str(error)) from None
    loads(payload)
    return payload


def loads(payload):
    """The value; raises `Foreign`."""
    return _Unpickler(io.BytesIO(payload)).load()


class _Unpickler(pickle.Unpickler):
    def find_class(self, module, name):
        """A class of tsdyn, or what NumPy needs for an array."""
        package = __package__.partition(".")[0]
        known = module.partition(".")[0] == package or name in _OTHERS.get(module, ())
        if not known or "." in name:
            raise Foreign(f"{module}.{name}")
        found = super().find_class(module, name)
        if module.partition(".")[0] == package and not isinstance(found, type):
            raise StorageError(f"{module}.{name} is no class, so a file has no business with it.")
        return found
