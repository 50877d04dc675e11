"""Functions of a user that an ensemble calls: whether they take what they are given, and what they raise."""

import inspect

from ..errors import InvalidArgument, TsdynError


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


def called(function, what, argument):
    """What a function gives; raises InvalidArgument, with what the function raises as the cause."""
    try:
        return function(argument)
    except TsdynError:
        raise
    except Exception as error:
        raise InvalidArgument(f"{what} raised {type(error).__name__}: {str(error).rstrip('.')}.") from error
