"""What a law of a run finds, and sizes of scenes that laws refer to."""

from typing import NamedTuple

import numpy as np


class Finding(NamedTuple):
    """What a law found."""

    law: str
    size: float
    limit: float
    where: str = ""

    @property
    def broken(self):
        """True if the size exceeds the limit, or is no number."""
        return not self.size <= self.limit

    def __str__(self):
        where = f" ({self.where})" if self.where else ""
        return f"{self.law}: {self.size:.2e}, at most {self.limit:.2e}{where}"


def some(count, most):
    """Return indices of the first, the last, and some between, `most` at most."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))


def extent(solution):
    """Size of a scene, m: distances of the bodies from their middle at the start, and their radii of gyration."""
    bodies = solution.scene.bodies
    places = np.array([solution.position(body)[0] for body in bodies])
    radii = [radius_of_gyration(body) for body in bodies]
    return float(np.linalg.norm(places - places.mean(axis=0), axis=1).max() + max(radii, default=0.0))


def radius_of_gyration(body):
    """About an axis of mean inertia, times the square root of 3, m; zero of a point mass."""
    return np.sqrt(np.trace(np.asarray(body.inertia)) / body.mass) if body.dimension == 7 else 0.0
