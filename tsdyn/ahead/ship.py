"""Kernels for a platform wheel: `python -m tsdyn.ahead.ship FOLDER`, which setup.py runs.

A folder for each portable target that this processor has, or for that of TSDYN_TARGET alone: all of tsdyn's own kernels
as the cache on disk has them, those of the self-tests, and the versions that compiled them.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from ..errors import TsdynError
from ..jit import compilers
from ..jit.code_hash import versions
from ..jit.compiled import signature_of
from ..jit.target import available, portable
from .all_kernels import compile_kernels, named


def ship(folder):
    """Fill the folder with the kernels of this process's target.

    Raises
    ------
    TsdynError
        If the target is not portable, or a kernel can't be compiled.
    """
    if compilers.CHOICE or not portable():
        raise TsdynError(
            f"Kernels are shipped for a portable target, of which this processor has {available() or 'none'}: unset "
            "TSDYN_JIT and NUMBA_CPU_NAME, and give such a target, or nothing, as TSDYN_TARGET."
        )
    _, _, failed = compile_kernels(everything=True)
    if failed:
        raise TsdynError(f"Kernels can't be shipped, since some can't be compiled: {failed}.")
    backend = compilers.current()
    backend.compile_probes()
    home = Path(folder) / portable()
    home.mkdir(parents=True, exist_ok=True)
    kernels = [backend.stored_file(kernel.py_func, signature_of(kernel)) for kernel in named(everything=True).values()]
    for file in (*kernels, *backend.probe_files()):
        shutil.copyfile(file, home / file.name)
    (home / backend.MADE).write_text(json.dumps(versions()), encoding="utf-8")


def main(folder):
    """Ship the kernels of every target, each from a process of its own."""
    if "TSDYN_TARGET" in os.environ or not available():
        return ship(folder)
    for name in available():
        environment = {**os.environ, "TSDYN_TARGET": name}
        subprocess.run([sys.executable, "-m", __spec__.name, folder], env=environment, check=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
