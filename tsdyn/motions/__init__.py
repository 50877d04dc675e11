"""Prescribed functions of time: their values, derivatives and Taylor series (`ts.motions`).

Imports jit and maths.

Begin with expressions.py: smooth motions such as `Sine` and `Polynomial`. prescribed.py converts the arguments of
drivers to a `Motion`, signals.py those of time-dependent loads; tables.py and piecewise.py hold data and splines, and
program.py evaluates motions in kernels.
"""

from .expressions import Constant, Exponential, Piecewise, Polynomial, Ramp, Sine, Smooth, time

__all__ = ["Constant", "Exponential", "Piecewise", "Polynomial", "Ramp", "Sine", "Smooth", "time"]


def __dir__():
    """What users use, for completion."""
    return sorted(__all__)
