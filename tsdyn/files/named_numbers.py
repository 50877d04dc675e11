"""The table `parameters` of a scene file: numbers by name, and the scene of the file with other ones."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, Self

from ..errors import InvalidArgument, InvalidFile
from ..validation import number, shown
from . import toml_text
from .build import build
from .reading import Mistakes

OF_RUNS = ("run", "ensemble", "output")  # tables that are no part of a scene


class TableNumbers(SimpleNamespace):
    """Numbers of the table as attributes."""


class NamedNumbers:
    """What a scene of a file is made of, to make it again with other numbers.

    Parameters
    ----------
    document : dict
        Plain data of the file.
    mistakes : Mistakes
        Those of the file: none.
    allow_code : bool
        As of `build`.
    values : dict
        Numbers of the table by name.
    """

    def __init__(self, document: dict[str, Any], mistakes: Any, allow_code: bool, values: dict[str, float]) -> None:
        self.document = {key: value for key, value in document.items() if key not in OF_RUNS}
        self.name, self.places, self.allow_code = mistakes.name, mistakes.places, allow_code
        self.values = TableNumbers(**values)

    def __deepcopy__(self, memo: Any) -> Self:
        return self  # never changed

    def made(self, make: Any, changes: dict[str, Any]) -> Any:
        """The scene with other numbers, by name; raises InvalidArgument where the file has mistakes with these."""
        numbers = {name: number(value) for name, value in changes.items()}
        for name, value in numbers.items():
            if not math.isfinite(value):
                raise InvalidArgument(f"{name}, of [parameters], must be a finite number, got {shown(changes[name])}.")
        table = self.document["parameters"] | numbers
        document, mistakes = self.document | {"parameters": table}, Mistakes(self.name, self.places)
        scene, values = build(document, make, mistakes, self.allow_code)
        try:
            mistakes.demand_none()
        except InvalidFile as error:
            said = ", ".join(f"{name} = {value:.6g}" for name, value in numbers.items())
            raise InvalidArgument(f"with {said}, {error}") from error
        scene._named = NamedNumbers(document, mistakes, self.allow_code, values)
        return scene

    def text(self) -> str:
        """The file as TOML text, without what is no part of a scene."""
        return toml_text.write(self.document)
