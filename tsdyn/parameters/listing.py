"""The parameters of a scene: a mapping of names to values, with units."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UnknownParameter
from ..validation import counted, nearest

if TYPE_CHECKING:
    from ..hints import Floats

DIGITS = 6  # shown


class ParameterList(Mapping[str, "float | Floats"]):
    """The parameters of a scene by name, "object.attribute": numbers and arrays in SI units.

    Attributes
    ----------
    units : dict
        Unit of each; "1" for pure numbers, "" where the class of a plug-in doesn't describe the attribute.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.5, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> parameters = scene.parameters()
    >>> parameters["rod.length"], parameters.units["rod.length"]
    (1.0, 'm')
    >>> print(parameters)
    gravity       [0, 0, -10]  m/s^2
    bob.mass              1.5  kg
    bob.position    [1, 0, 0]  m
    bob.velocity    [0, 0, 0]  m/s
    rod.point_b     [0, 0, 0]  m
    rod.length              1  m
    """

    def __init__(self, values: dict[str, Any], units: dict[str, str]) -> None:
        self._values, self.units = values, units

    def __getitem__(self, name: str) -> float | Floats:
        try:
            return self._values[name]
        except (KeyError, TypeError):
            known = nearest(name, self._values)
            raise UnknownParameter(f"the scene has no parameter {name!r}{known}") from None

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def get(self, name: str, default: Any = None) -> Any:
        """The value of a parameter, or a default where there is none."""
        return self._values.get(name, default)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def _rows(self):
        return [(name, shown(value), self.units[name]) for name, value in self._values.items()]

    def __str__(self) -> str:
        rows = self._rows()
        names, values = (max(len(row[i]) for row in rows) for i in (0, 1))
        return "\n".join(f"{name:{names}}  {value:>{values}}  {unit}".rstrip() for name, value, unit in rows)

    def __repr__(self) -> str:
        return f"<{counted(len(self), 'parameter')}>\n{self}"

    def _repr_html_(self) -> str:
        """Return a table, for notebooks."""
        cells = ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in self._rows()]
        head = "<tr><th>parameter</th><th>value</th><th>unit</th></tr>"
        return f"<table>{head}{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def shown(value: Any) -> str:
    """Return a number or an array as short text; a matrix that is diagonal by its diagonal."""
    array = np.asarray(value, dtype=float)
    if array.ndim == 0:
        return f"{float(array):.{DIGITS}g}"
    if array.ndim == 2:
        diagonal = np.diag(np.diag(array))
        return f"diag {shown(np.diag(array))}" if (array == diagonal).all() else f"[{', '.join(map(shown, array))}]"
    return f"[{', '.join(f'{x + 0.0:.{DIGITS}g}' for x in array.tolist())}]"
