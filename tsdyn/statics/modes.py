"""Modes of the linearised system: frequencies, damping ratios, and shapes as twists of bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting_methods
from ..elements.names import named
from ..errors import InvalidArgument, InvalidBody

if TYPE_CHECKING:
    from ..hints import Floats, PointMass


@fitting_methods
class Modes:
    """Modes in order of |lambda|; a conjugate pair of eigenvalues is one mode, and a pair of zeros.

    Attributes
    ----------
    eigenvalues : ndarray (j,) complex, 1/s
        Imaginary parts are not negative.
    frequency : ndarray (j,), Hz
        Natural frequency |lambda| / (2 pi).
    damped_frequency : ndarray (j,), Hz
        Im lambda / (2 pi).
    damping_ratio : ndarray (j,)
        -Re lambda / |lambda|: negative if the mode grows, 1 if it decays without oscillation; NaN where lambda is zero.
    shapes : ndarray (j, k) complex
        Variations of the coordinates. M-norm 1, the largest entry real and positive.
    coordinates : tuple of str
    """

    def __init__(self, values: Any, shapes: Any, twists: Any, bodies: Any, coordinates: tuple[str, ...]) -> None:
        size = np.abs(values)
        self.eigenvalues, self.shapes, self.coordinates = values, shapes, coordinates
        self.frequency, self.damped_frequency = size / (2.0 * np.pi), values.imag / (2.0 * np.pi)
        self.damping_ratio: Floats = np.where(size > 0.0, (0.0 - values.real) / np.where(size > 0.0, size, 1.0), np.nan)
        self._twists, self._bodies = twists, bodies

    def __len__(self) -> int:
        return len(self.eigenvalues)

    def twist(self, body: PointMass | str) -> Any:
        """Displacement of the centroid (m) and rotation (rad) of a body in each mode, (j, 6) complex.

        Axes are those of the ground, or, in steady motion, turning with it. The rotation of a point mass is zero.
        """
        if isinstance(body, str):
            body = named(self._bodies, body, "body", InvalidBody)
        if not any(body is one for one in self._bodies):
            raise InvalidBody(f"{body!r} is not a body of this scene.")
        return self.shapes @ self._twists[[one is body for one in self._bodies].index(True)].T

    def __repr__(self) -> str:
        return f"<Modes: {len(self)} of {len(self.coordinates)} coordinates>"

    def __str__(self) -> str:
        lines = ["Modes", "  frequency (Hz)  damping ratio  largest in"]
        for one in range(len(self)):
            name = self.coordinates[int(np.abs(self.shapes[one]).argmax())]
            lines.append(f"  {self.frequency[one]:14.6g}  {self.damping_ratio[one]:13.6g}  {name}")
        return "\n".join(lines)


def modes_of(pairs, twists, bodies, coordinates):
    """The `Modes` of eigenpairs; twists (bodies, 6, k)."""
    if not len(coordinates):
        raise InvalidArgument("modes: the scene has no degrees of freedom.")
    first, zero = np.flatnonzero(pairs.values.imag >= 0.0), int((pairs.values == 0.0).sum())
    first = first[zero // 2 :] if zero else first
    first[: zero - zero // 2] = np.arange(zero - zero // 2)  # zeros are first, and a pair of them is one mode, too
    values, shapes = pairs.values[first], pairs.vectors[:, first].T
    lead = shapes[np.arange(len(first)), np.abs(shapes).argmax(axis=1)]
    return Modes(values, shapes * (np.abs(lead) / lead)[:, None], twists, bodies, coordinates)
