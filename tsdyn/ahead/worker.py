"""A process that compiles kernels for another one: `python -m tsdyn.ahead.worker`.

It reads a kernel a line, module and name, compiles it into the cache on disk, and answers with a line: nothing, or why
not. It ends when there is nothing more to read.
"""

import gc
import signal
import sys
from functools import cache
from importlib import import_module

from ..elements import force, primitive
from ..jit.code_hash import is_ours
from ..jit.compiled import is_declared, load


def find(module, name):
    """The kernel of this module and name, of tsdyn's own; None where there is none."""
    if not is_ours(module):
        return None
    found = _loops().get((module, name)) or getattr(import_module(module), name, None)
    return found if is_declared(found) else None


@cache
def _loops():
    """{(module, name): kernel} of constraints and forces."""
    kinds = {**primitive.registered(), **force.registered()}.values()
    kernels = [
        kernel
        for kind in kinds
        if is_ours(kind.__module__)
        for kernel in getattr(kind, "own_kernels", kind.kernels).values()
    ]
    return {(kernel.py_func.__module__, kernel.py_func.__qualname__): kernel for kernel in kernels}


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
