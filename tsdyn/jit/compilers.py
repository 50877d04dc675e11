"""Which of two compiles kernels: tsdyn's own way (backend.py), or Numba's as it comes (stock.py).

The own way takes half the time, and needs parts of Numba that may change. Where one is absent, or fails, or where
TSDYN_JIT=stock asks for it, kernels are compiled by Numba's public interface: with the same results to the bit.
"""

import json
import os
import platform
import warnings
from functools import cache

import numba
from numba import NumbaError

from ..errors import CompilerWarning
from . import stock
from .code_hash import is_ours, versions

CHOICE = os.environ.get("TSDYN_JIT", "")
_chosen = []


def current():
    """The module that compiles: `backend` or `stock`."""
    if not _chosen:
        _chosen.append(stock)
        if CHOICE not in ("", "stock"):
            warnings.warn(
                f"TSDYN_JIT={CHOICE} is unknown and ignored; TSDYN_JIT=stock has Numba compile kernels as it comes.",
                CompilerWarning,
                stacklevel=2,
            )
        if CHOICE != "stock":
            try:
                from . import backend

                backend.check()
                _chosen[0] = backend
            except Exception as error:  # whatever another Numba makes of it
                _tell(error)
    return _chosen[0]


def described():
    """Which way kernels are compiled, in words."""
    way = "its public interface alone" if current() is stock else "tsdyn's own passes"
    return f"Numba {numba.__version__}, {way}"


def machine():
    """The processor as machine code is made for it, and what has made it where that isn't the Numba that is here."""
    return [platform.machine(), *current().target(), *made_by()]


def shipped():
    """The folder of kernels that came with tsdyn, where they serve; None otherwise."""
    return None if current() is stock else current().shipped()


@cache
def made_by():
    """Names and versions of what has compiled the shipped kernels; none where that is here, or nothing is shipped."""
    made = shipped() and json.loads((shipped() / current().MADE).read_text(encoding="utf-8"))
    return [f"{name} {number}" for name, number in made.items()] if made and made != versions() else []


def attempt(function, own, plain):
    """Return own(); plain() with Numba as it comes, and from then on, where tsdyn's own way fails."""
    if current() is stock:
        return plain()
    try:
        return current().tested(own)
    except Exception as error:
        if isinstance(error, NumbaError) and not is_ours(function.__module__):
            raise  # a user's code that doesn't compile
        backend, _chosen[0] = _chosen[0], stock
        try:
            found = plain()
        except Exception:  # it isn't tsdyn's way that fails
            _chosen[0] = backend
            raise error from None
        _tell(error)
        return found


def callback_frames():
    """How the functions begin in which LLVM calls Python back; all of them where that isn't known."""
    return getattr(current(), "CALLBACK_FRAMES", "")


def _tell(error):
    cause = " ".join(f"{type(error).__name__}: {error}".split())[:300]
    warnings.warn(
        f"Numba {numba.__version__} compiles kernels as it comes, since tsdyn's own way fails with it ({cause}). "
        "Results are the same to the bit; a first run takes two to three times as long, a new process half a second "
        "more. An older Numba or a newer tsdyn mends it; TSDYN_JIT=stock in the environment accepts it.",
        CompilerWarning,
        stacklevel=3,
    )
