"""Docstrings of public classes, completed from their bases: an argument is described once, where it belongs.

A class describes the arguments that are its own. Descriptions of the others, and of the errors raised, come from the
docstrings of its bases; arguments that place markers are described by their markers.
"""

from __future__ import annotations

import inspect
import re
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

SECTION = re.compile(r"^(\w+)\n-+\n", flags=re.MULTILINE)


def complete_docstring(cls: type, standard: Iterable[str] = (), raises: str = "") -> None:
    """Complete the sections Parameters and Raises of a class that has a docstring of its own.

    `standard` has further entries of Parameters, `raises` is the section Raises of a class none of whose bases has one.
    """
    if not vars(cls).get("__doc__"):
        return
    head, sections = _split(cls.__doc__)
    bases = [_split(base.__doc__ or "")[1] for base in cls.__mro__[1:]]
    entries = [entry for known in (sections, *bases) for entry in _entries(known.get("Parameters", ""))]
    parameters = "\n".join(_in_order([*entries, *standard], inspect.signature(cls.__init__).parameters))
    raises = next((known["Raises"] for known in (sections, *bases) if "Raises" in known), raises)
    first = {"Parameters": parameters, "Raises": raises}
    sections = first | {title: text for title, text in sections.items() if title not in first}
    shown = [f"{title}\n{'-' * len(title)}\n{text}" for title, text in sections.items() if text]
    cls.__doc__ = "\n\n".join([head, *shown])


def entries_of(texts: Iterable[str], arguments: Iterable[str]) -> list[str]:
    """The entries of arguments, in order, in the sections Parameters of some docstrings."""
    entries = [entry for text in texts for entry in _entries(_split(text)[1]["Parameters"])]
    return _in_order(entries, list(arguments))


@cache  # a base is asked by each of its subclasses, at import
def _split(text: str) -> tuple[str, dict[str, str]]:
    """Return the text before the first section, and the sections by title."""
    head, *parts = SECTION.split(inspect.cleandoc(text))
    titles, bodies = parts[::2], parts[1::2]
    return head.strip(), {title: body.strip() for title, body in zip(titles, bodies, strict=True)}


def _entries(section: str) -> list[str]:
    """Return the entries of a section: a line of names, with the indented lines after it."""
    return [entry for entry in re.split(r"\n(?=\S)", section) if entry]


def _in_order(entries: list[str], arguments: Iterable[str]) -> list[str]:
    """Return the first entry of each argument, in order, without repetition; entries of other names are left out."""
    named = [(entry, re.findall(r"\w+", entry.split("\n")[0].split(" :")[0])) for entry in entries]
    found = []
    for argument in arguments:
        naming = [entry for entry, names in named if argument in names and {*names} <= {*arguments}]
        found += [entry for entry in naming[:1] if entry not in found]
    return found
