"""The processor that kernels are compiled for.

By default it is the best of a few named sets of instructions that this processor has, PORTABLE: machines of one set
share kernels and the bits of results. TSDYN_TARGET names another one, or `native`: what Numba compiles for.
"""

import contextlib
import os
import platform
import sys
import warnings
from functools import cache

import llvmlite.binding as llvm
import numba

from ..errors import CompilerWarning

MACHINE = platform.machine().lower()
_V2 = "cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3"
_V3 = *_V2, "avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"
PORTABLE = (  # by LLVM's name, the best first: what the processor needs to have, as LLVM calls it
    {"x86-64-v3": _V3, "x86-64-v2": _V2}
    if MACHINE in ("x86_64", "amd64")
    else {"apple-m1" if sys.platform == "darwin" else "generic": ()}
    if MACHINE in ("arm64", "aarch64")
    else {}
)


@cache
def available():
    """Names of the portable targets that this processor has, the best first."""
    has = {}
    with contextlib.suppress(RuntimeError):  # a processor that LLVM doesn't know
        has = llvm.get_host_cpu_features()
    return [name for name, needed in PORTABLE.items() if all(has.get(feature) for feature in needed)]


@cache
def portable():
    """The name of the portable target that tsdyn compiles for, or None for Numba's own."""
    choice, config = os.environ.get("TSDYN_TARGET", ""), numba.config
    if choice in available():
        return choice
    if choice not in ("", "native"):
        names = ", ".join([*available(), "native"])
        warnings.warn(f"TSDYN_TARGET={choice} is ignored: this processor has {names}.", CompilerWarning, stacklevel=2)
    asked = config.CPU_NAME is not None or config.CPU_FEATURES is not None or not config.ENABLE_AVX
    return None if choice == "native" or asked or not available() else available()[0]


@cache
def of_numba():
    """What Numba compiles for: system, processor, features."""
    name, features = numba.config.CPU_NAME, numba.config.CPU_FEATURES
    if features is None:
        with contextlib.suppress(RuntimeError):
            features = llvm.get_host_cpu_features().flatten()
    avx = [] if numba.config.ENABLE_AVX else ["no AVX"]
    return llvm.get_process_triple(), name or llvm.get_host_cpu_name(), features or "", *avx, *_libraries()


@cache
def chosen():
    """What tsdyn compiles for, likewise."""
    return (f"{MACHINE}-{sys.platform}", portable(), "", *_libraries()) if portable() else of_numba()


def _libraries():
    """Intel's mathematical functions of registers, which Numba uses where they are installed."""
    config = numba.config  # USING_SVML is found by Numba, no variable of the environment sets it
    return ["SVML"] if config.USING_SVML else []
