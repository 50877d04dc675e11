"""A process that compiles kernels for another one: `python -m tsdyn._worker`.

It reads a kernel a line, module and name, compiles it into the cache on disk, and answers with a line: nothing, or why
not. It ends when there is nothing more to read.
"""

import gc
import signal
import sys
from collections.abc import Mapping
from importlib import import_module

from ._compiled import Callback, load


def find(module, name):
    """The kernel of this name: an attribute of the module, or a callback of one of its classes. None if there is none.

    Only of tsdyn's own modules: to import others may have effects.
    """
    if module.partition(".")[0] != __package__.partition(".")[0]:
        return None
    value = import_module(module)
    for part in name.split("."):
        for kernels in (getattr(value, "kernels", None), getattr(value, "own_kernels", None)):
            for kernel in kernels.values() if isinstance(kernels, Mapping) else ():
                if kernel.py_func.__qualname__ == name:
                    return kernel
        value = getattr(value, part, None)
    return value if isinstance(value, Callback) or hasattr(value, "overloads") else None


def main():
    """Compile what is asked for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started this one
    gc.set_threshold(100_000, 20, 20)
    answers, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        problem = ""
        try:
            load(find(*line.split()))
        except Exception as error:
            problem = f"{type(error).__name__}: {error}".splitlines()[0]
        print(problem, file=answers, flush=True)


if __name__ == "__main__":
    main()
