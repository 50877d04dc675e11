"""Values of arguments: numbers, arrays, motions and tables as plain data, and back."""

import numpy as np

from ..errors import InvalidArgument
from ..motions.elementary import Piecewise
from ..motions.expressions import Smooth
from ..motions.piecewise import Pieces
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from ..motions.tables import Table, is_data
from . import expressions
from .expressions import Misread

EXPRESSION = "expression"  # the key of a motion whose parts have names of their own
TABLE = ("times", "values")  # keys of a table, and
KIND = "kind"
PIECES = ("knots", "coefficients")  # keys of a piecewise polynomial, and
BEYOND = "beyond"
MOTION = "a number, an expression of the time such as '0.1 * sin(2 * t)', or { times = [...], values = [...] }"


class Unwritable(Exception):
    """What a file can't hold: its description."""


def encode(value):
    """Plain data of a value; raises `Unwritable`."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "fi":
        return value.tolist()
    if isinstance(value, Motion):
        return _encode_motion(value)
    if isinstance(value, Signal):
        return _encode_signal(value)
    if isinstance(value, Smooth):
        return _encode_smooth(value)
    if isinstance(value, Table):
        found = {"times": value.times.tolist(), "values": value.values.tolist()}
        return found | ({} if value.kind == "cubic" else {KIND: value.kind})
    if is_data(value):
        motions = Piecewise.each(value)
        return _encode_smooth(motions[0]) if len(motions) == 1 else [_encode_smooth(motion) for motion in motions]
    if isinstance(value, (tuple, list)):
        return [encode(part) for part in value]
    if callable(value):
        raise Unwritable(f"the function {_name_of(value)}")
    raise Unwritable(f"{value!r}")


def _name_of(function):
    return getattr(function, "__qualname__", repr(function))


def _encode_motion(motion):
    if motion.given:
        raise Unwritable(f"the function {', '.join(map(_name_of, motion.given))}")
    return _encode_smooth(motion.smooth)


def _encode_signal(signal):
    if isinstance(signal.source, Table):
        return encode(signal.source)
    if signal.is_function:
        raise Unwritable(f"the function {_name_of(signal.source)}")
    found = [_encode_smooth(motion) for motion in signal.motions]
    return found[0] if signal.width == 1 else found


def _encode_smooth(motion):
    text, parts = expressions.write(motion)
    parts = {name: _encode_pieces(part) if isinstance(part, Pieces) else part for name, part in parts.items()}
    if text in parts and len(parts) == 1:  # data alone
        return parts[text]
    return {EXPRESSION: text, **parts} if parts else text


def _encode_pieces(pieces):
    found = {"knots": pieces.knots.tolist(), "coefficients": pieces.c.tolist()}
    return found | ({} if pieces.beyond is False else {BEYOND: pieces.beyond})


def is_number(value):
    """Whether plain data is a number."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def decode_number(value, names):
    """A number of plain data: one, or an expression of names that doesn't depend on time."""
    if isinstance(value, str):
        found = expressions.read(value, names)
        if isinstance(found, Smooth):
            raise Misread("it depends on the time t, and must be a number.")
        return found
    if not is_number(value):
        raise Misread("it must be a number, or an expression of parameters such as '2 * length'.")
    if isinstance(value, int) and abs(value) > 2**63:
        raise Misread("the number is too large.")
    return value


def decode_array(value, names):
    """A number, or nested lists of numbers, of plain data."""
    if isinstance(value, list):
        return [decode_array(part, names) for part in value]
    try:
        return decode_number(value, names)
    except Misread as error:
        raise Misread(f"{error} Arrays are lists of numbers such as [0.0, 0.0, 1.0].") from None


def decode_motion(value, names):
    """What a prescribed quantity, or a load, is given by: a number, a motion, a `Table`."""
    if isinstance(value, str):
        return expressions.read(value, names)
    if isinstance(value, dict):
        return _decode_table(value, names)
    if is_number(value):
        return value
    raise Misread(f"it must be {MOTION}.")


def decode_vector(value, names):
    """What a load of three numbers is given by: a list of three, or a table of vectors."""
    if isinstance(value, list):
        return [decode_motion(part, names) for part in value]
    if isinstance(value, dict) and EXPRESSION not in value:
        return _decode_table(value, names)
    raise Misread(f"it must be three values, each {MOTION}; or such a table of vectors.")


def _decode_table(value, names):
    """A motion of a table of plain data."""
    if EXPRESSION in value:
        return _decode_parts(value, names)
    for known, more, make in ((TABLE, KIND, _table), (PIECES, BEYOND, _pieces)):
        if set(value) - {more} == set(known):
            try:
                return make(value, names)
            except (InvalidArgument, ValueError, IndexError) as error:
                raise Misread(str(error)) from error
    raise Misread(
        "such a table has the keys times, values and kind; or knots, coefficients and beyond; or expression and its "
        f"parts; got {', '.join(value) or 'none'}."
    )


def _table(value, names):
    return Table(*(decode_array(value[key], names) for key in TABLE), value.get(KIND, "cubic"))


def _pieces(value, names):
    knots, c = (np.array(decode_array(value[key], names), float) for key in PIECES)
    beyond = value.get(BEYOND, False)
    if knots.ndim != 1 or knots.size < 2 or c.ndim != 2 or len(c) != knots.size - 1 or not c.shape[1]:
        raise Misread("coefficients must be a list for each piece between knots, the constant one first.")
    if not (isinstance(beyond, bool) or beyond == "periodic"):
        raise Misread(f"beyond must be true, false or 'periodic', got {beyond!r}.")
    return Piecewise._of(Pieces(knots, c, beyond))


def _decode_parts(value, names):
    """The motion of an expression whose parts are named beside it, each after those that it uses."""
    known = dict(names)
    for name, part in value.items():
        if name != EXPRESSION:
            if not isinstance(part, (str, dict, int, float)) or isinstance(part, bool):
                raise Misread(f"{name} must be {MOTION}.")
            found = decode_motion(part, known)
            known[name] = Piecewise(found) if isinstance(found, Table) else found
    if not isinstance(value[EXPRESSION], str):
        raise Misread("expression must be text.")
    return expressions.read(value[EXPRESSION], known)
