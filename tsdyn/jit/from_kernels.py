"""Python functions that kernels call by address, as they call a `Callback`."""

import ctypes

from .compiled import DEBUG, table

KINDS = {"i": ctypes.c_int64, "d": ctypes.c_double, "p": ctypes.c_void_p}


class PythonCallback:
    """A Python function with an `address`; it is given addresses of arrays, in debug mode the arrays.

    An exception of it is lost: the function has to answer for its own.
    """

    def __init__(self, function, signature):
        self._kept = ctypes.CFUNCTYPE(ctypes.c_int64, *(KINDS[c] for c in signature))(function)
        self.address = ctypes.cast(self._kept, ctypes.c_void_p).value
        if DEBUG:
            table.append(function)
            self.address = len(table) - 1
