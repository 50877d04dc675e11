"""Validation of users' numbers: no silent rounding, parsing or truncation; of files: regular, of a bounded size."""

from __future__ import annotations

import contextlib
import difflib
import inspect
import math
import os
import stat
from functools import lru_cache, wraps
from typing import TYPE_CHECKING

import numpy as np

from .errors import CONTROL, InvalidArgument, StorageError, UnknownAttribute

if TYPE_CHECKING:
    from .hints import Place


# Files that are read whole: regular ones (no device, pipe or folder), of a bounded size.

FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # a pipe without a writer opens at once
NO_LINKS = getattr(os, "O_NOFOLLOW", 0)


def opened(path: Place, largest: int | None = None, flags: int = 0) -> int:
    """The descriptor of a regular file of at most so many bytes.

    Raises
    ------
    StorageError
        If it is something else, too large, or can't be opened.
    """
    try:
        handle = os.open(path, FLAGS | flags)
    except (OSError, ValueError) as error:
        raise StorageError(f"{path} can't be read: {getattr(error, 'strerror', None) or error}.") from error
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            what = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
            raise StorageError(f"{path} can't be read: it is {what}, not a regular file.")
        if largest is not None and found.st_size > largest:
            raise StorageError(
                f"{path} is too large: it has {found.st_size} bytes, and such a file may have {largest} at most."
            )
    except BaseException:
        os.close(handle)
        raise
    return handle


def read(path: Place, largest: int | None = None, flags: int = 0) -> bytes:
    """The bytes of a regular file; arguments and errors as of `opened`."""
    with os.fdopen(opened(path, largest, flags), "rb") as file:
        size = os.fstat(file.fileno()).st_size
        try:
            content = file.read((size if largest is None else largest) + 1)  # one of /proc says that it has none
        except (OSError, MemoryError) as error:
            raise StorageError(f"{path} can't be read: {getattr(error, 'strerror', None) or 'no memory'}.") from error
    if len(content) > (size if largest is None else largest):
        raise StorageError(f"{path} can't be read: it has more bytes than it says, or is being written.")
    return content


def demand_regular(path: Place) -> None:
    """Raise StorageError unless a path is that of a regular file; for libraries that open it themselves."""
    os.close(opened(path))


# Validation of users' numbers: no silent rounding, parsing or truncation. Validation of what files hold.

EXACT = 2**53  # integers below it are floats
FEW = 50  # numbers that a list serves faster than an array: 0.4 us instead of 2
MANY = 30  # names that a message lists
LONG = 200  # characters of a value that a message shows


def checked_once(function):
    """Decorate a check: arguments of the values and types of earlier ones have its result, if they can be hashed."""
    known = lru_cache(typed=True)(function)

    @wraps(function)
    def check(*arguments):
        try:
            return known(*arguments)
        except TypeError:
            return function(*arguments)

    return check


def floats(value):
    """Return real numbers as an array of floats; an empty one for text, booleans, complex or ragged input."""
    try:
        array = np.asarray(value)
        return array.astype(float) if array.dtype.kind in "iuf" else np.empty((0,))
    except (TypeError, ValueError, OverflowError):
        return np.empty((0,))


def number(value):
    """Return one real number as a float, NaN for anything else."""
    if type(value) is float:
        return value
    if type(value) is int and -EXACT < value < EXACT:
        return float(value)
    array = floats(value)
    return float(array) if array.shape == () else math.nan


def positive(value, what, error=InvalidArgument):
    """Return a positive finite float, or raise `error`."""
    return _fitting(value, lambda x: x > 0.0, f"{what} must be a positive finite number", error)


def not_negative(value, what, error=InvalidArgument):
    """Return a finite float >= 0, or raise `error`."""
    return _fitting(value, lambda x: x >= 0.0, f"{what} must be a finite number that is not negative", error)


def finite(value, what, error=InvalidArgument):
    """Return a finite float, or raise `error`."""
    return _fitting(value, math.isfinite, f"{what} must be a finite number", error)


def shown(value):
    """Return what a message shows of a wrong value: numbers of NumPy as plain ones, of long ones the beginning."""
    try:
        text = repr(_plain(value))
    except Exception as error:  # a list that holds itself, a repr that raises
        text = f"<{type(value).__name__} without a repr: {type(error).__name__}>"
    return clipped(text)


def shown_for_handle(value):
    """Return what a message shows of what is given in place of a handle: of a name, how to get the handle."""
    return f"the name {value!r}; pass the object itself, scene[{value!r}]" if isinstance(value, str) else shown(value)


def clipped(text):
    """Return what a message quotes of a text, such as one of a file: of a long one the beginning."""
    return text if len(text) <= LONG else f"{text[:LONG]} ..."


def reason(error):
    """Return the kind of an error and what it says, for the message of another one."""
    return clipped(f"{type(error).__name__}: {error}")


def _plain(value):
    if isinstance(value, np.generic) or type(value) is np.ndarray:
        value = value.tolist()
    return type(value)(map(_plain, value)) if type(value) in (list, tuple) else value


def _fitting(value, fits, rule, error):
    result = number(value)
    if not (math.isfinite(result) and fits(result)):
        raise error(f"{rule}, got {shown(value)}.")
    return result


def vector3(value, what, error):
    """Return three finite floats as an array (3,), or raise `error`."""
    array = floats(value)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise error(f"{what} must be three finite numbers, got {shown(value)}.")
    return array


def finite_vector(value, n, what):
    """Return n finite floats as an array (n,), or raise InvalidArgument."""
    array = floats(value)
    finite = all(map(math.isfinite, array.ravel().tolist())) if array.size < FEW else np.isfinite(array).all()
    if array.shape != (n,) or not finite:
        raise InvalidArgument(f"{what} must be {n} finite numbers, one for each coordinate, got {shown(value)}.")
    return array


def finite_times(value, what):
    """Return one or more finite times as an array (k,), or raise InvalidArgument."""
    array = np.atleast_1d(floats(value))
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise InvalidArgument(f"{what} must be a finite time in s, or a vector of them, got {shown(value)}.")
    return array


def whole(value, what):
    """Return a positive whole number, None for None, or raise InvalidArgument."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 1 <= value < 2**63:
        raise InvalidArgument(f"{what} must be a positive whole number, got {shown(value)}.")
    return int(value)


def sequence(value, what, error):
    """Return the items of a sequence as a list, or raise `error`; text is no sequence."""
    try:
        if not isinstance(value, str):
            return list(value)
    except TypeError:
        pass
    raise error(f"{what}, got {shown(value)}.")


def one_of(value, options, what, error=InvalidArgument):
    """Return one of some names, or raise `error`."""
    if not isinstance(value, str) or value not in options:
        raise error(f"{what} must be {' or '.join(map(repr, options))}, got {shown(value)}.")
    return value


def label(name, what, error):
    """Return a name as text, "" for None, or raise `error`."""
    if name is None:
        return ""
    if isinstance(name, (str, int, np.integer)) and not isinstance(name, bool) and not CONTROL.search(str(name)):
        return str(name)
    raise error(f"{what}: name must be text without control characters, got {name!r}.")


def counted(count, noun, nouns=None):
    """Return a count with its noun: 1 row, 2 rows."""
    return f"{count} {noun if count == 1 else nouns or noun + 's'}"


def listed(names, most=8):
    """Return names one after the other, and how many more there are than some."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def close(name, known):
    """Return up to three known names similar to a wrong one."""
    return difflib.get_close_matches(str(name), known, 3)


def nearest(name, known):
    """Return the end of a sentence on a wrong name: similar known names."""
    near = close(name, known)
    return f"; did you mean {' or '.join(near)}?" if near else "."


def unknown_parameter(name, known):
    """Return the end of a sentence on a name of no parameter: similar ones, and those that there are."""
    names = list(known)
    more = f" and {len(names) - MANY} more; tsdyn info --parameters lists all" if len(names) > MANY else ""
    return f"{nearest(name, names)} It has {', '.join(names[:MANY])}{more}."


def unknown_name(what, name, known):
    """Return the error of an unknown name."""
    return InvalidArgument(f"unknown {what} {name!r}; there are {', '.join(map(repr, known))}{nearest(name, known)}")


def demand_known(owner, attribute, known):
    """Refuse to set a public attribute that the owner does not have."""
    if attribute.startswith("_") or attribute in known or hasattr(type(owner), attribute):
        return
    public = [name for name in {*known, *dir(type(owner))} if not name.startswith("_")]
    raise UnknownAttribute(f"{owner!r} has no attribute {attribute!r} to set{nearest(attribute, public)}")


@contextlib.contextmanager
def damaged(what):
    """A block that takes what a file holds: StorageError in place of what Python says where something doesn't fit."""
    try:
        yield
    except StorageError:
        raise
    except (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, RecursionError, MemoryError) as error:
        raise StorageError(f"{what} is damaged, or lacks something: {reason(error).rstrip('.')}.") from error


def demand(fits, what):
    """Raise ValueError unless something of a file fits."""
    if not fits:
        raise ValueError(f"{what}: no run leaves such values")


def demand_arguments(function, what, names):
    """Raise InvalidArgument unless a function can be called with so many arguments by position."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # of a builtin
        return
    try:
        signature.bind(*names)
    except TypeError as error:
        name = getattr(function, "__name__", type(function).__name__)
        raise InvalidArgument(
            f"{what} is called with ({', '.join(names)}), and {name}{signature} can't be: {error}. Others than "
            f"{'this argument' if len(names) == 1 else 'these arguments'} need defaults."
        ) from None


def is_count(value):
    """Whether a value is a whole number of things that a run may have."""
    return _is_whole(value) and value >= 0


def _is_whole(value):
    """Whether a value is a whole number that floats and 64-bit integers hold."""
    return type(value) is int and abs(value) <= EXACT


def demand_numbers(table, known, absent=()):
    """Raise ValueError unless a table has these names alone, each with a number or a truth value; None for `absent`."""
    demand(isinstance(table, dict) and table.keys() == set(known), "the names of numbers")
    for name, value in table.items():
        demand((value is None and name in absent) or isinstance(value, (bool, float)) or _is_whole(value), name)


def demand_record(record, kinds):
    """Raise KeyError, TypeError or ValueError unless a table of JSON has these names, each a value of its type."""
    for name, kind in kinds.items():
        value = record[name]
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise TypeError(f"{name} is {type(value).__name__}")
        demand(not isinstance(value, int) or _is_whole(int(value)), name)


FORMULA = tuple("=+-@\t\r")  # what a spreadsheet takes a cell for that begins so


def text_cell(text):
    """Text for a cell of CSV: with a quote before what a spreadsheet would run as a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text
