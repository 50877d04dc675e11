"""Mistakes in a file, gathered and reported at once, each with its line, the value and what to write instead."""

import reprlib

from ..errors import InvalidFile

SHOWN = 50
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60


class Mistakes:
    """What is wrong in a file.

    Parameters
    ----------
    name : str
        Of the file, in messages.
    places : Places
    """

    def __init__(self, name, places):
        self.name, self.places, self.found = name, places, {}

    def add(self, path, message):
        """Add a mistake at a path, once."""
        self.found.setdefault((path, message), (*self.places.line_and_column(path), message))

    def add_value(self, path, what, value, reason):
        """Add a value that is wrong, with the reason."""
        self.add(path, f"{what} = {_SHORT.repr(value)}: {reason}")

    def demand_none(self):
        """Raise InvalidFile if there are any, in the order of the file."""
        if not self.found:
            return
        found = sorted(self.found.values())
        more = f"\n  and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        lines = "\n".join(f"  {self.name}:{line}:{column}: {message}" for line, column, message in found[:SHOWN])
        count = f"{len(found)} mistake{'s' if len(found) > 1 else ''}"
        raise InvalidFile(f"{self.name} has {count}:\n{lines}{more}", tuple(found))
