"""Volume, centroid and second moments of a closed triangle mesh, and the check that it is closed."""

import numpy as np

from ..errors import InvalidArgument
from ..validation import floats
from .tolerances import FLAT


def moments(vertices, faces):
    """Volume, m^3, centroid (3,), m, and the integral of x x^T about it (3, 3), m^5.

    Each triangle and a point inside the mesh span a tetrahedron of signed volume d / 6, d = a.(b x c), with

        integral of x x^T = d / 120 (a a^T + b b^T + c c^T + s s^T),  s = a + b + c

    Raises
    ------
    InvalidArgument
        If the mesh is not closed, not oriented or without volume.
    """
    x, triangles = _checked(vertices, faces)
    middle = 0.5 * (x.min(axis=0) + x.max(axis=0))
    size = np.abs(x - middle).max()
    corners = ((x - middle) / size)[triangles]
    a, b, c = corners.transpose(1, 0, 2)
    d = np.einsum("fi,fi->f", a, np.cross(b, c))
    volume = d.sum() / 6.0
    if abs(volume) <= FLAT:
        raise InvalidArgument("from_mesh: the mesh encloses no volume; all of its faces lie in a plane, or cancel out.")
    if volume < 0.0:
        raise InvalidArgument("from_mesh: all faces are oriented inward; reverse them: faces[:, ::-1].")
    total = corners.sum(axis=1)
    centroid = d @ total / (24.0 * volume)
    second = np.einsum("f,fki,fkj->ij", d, corners, corners) + np.einsum("f,fi,fj->ij", d, total, total)
    second = second / 120.0 - volume * np.outer(centroid, centroid)
    return volume * size**3, middle + size * centroid, 0.5 * (second + second.T) * size**5


def _checked(vertices, faces):
    """Return vertices (v, 3) and triangles (f, 3) of a closed mesh with consistent orientation."""
    x, given = floats(vertices), np.asarray(faces)
    if x.ndim != 2 or x.shape[1:] != (3,) or not np.isfinite(x).all():
        raise InvalidArgument("from_mesh: vertices must be finite numbers of shape (v, 3), in m.")
    if given.ndim != 2 or given.shape[1:] != (3,) or given.dtype.kind not in "iu" or not len(given):
        raise InvalidArgument(
            f"from_mesh: faces must be whole numbers of shape (f, 3), the vertices of each triangle; got shape "
            f"{given.shape}. Cut faces of more corners into triangles."
        )
    triangles = given.astype(np.int64)
    if triangles.min() < 0 or triangles.max() >= len(x):
        i = int(np.flatnonzero((triangles < 0).any(axis=1) | (triangles >= len(x)).any(axis=1))[0])
        raise InvalidArgument(f"from_mesh: face {i} is {given[i].tolist()}, and there are {len(x)} vertices, from 0.")
    ends = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    if (ends[:, 0] == ends[:, 1]).any():
        i = int(np.flatnonzero(ends[:, 0] == ends[:, 1])[0]) // 3
        raise InvalidArgument(f"from_mesh: face {i} has a vertex twice, {given[i].tolist()}; leave it out.")
    forth, back = (ends[:, i] * len(x) + ends[:, 1 - i] for i in (0, 1))
    known, first, times = np.unique(forth, return_index=True, return_counts=True)
    if (times > 1).any():
        edge = ends[first[np.argmax(times > 1)]]
        raise InvalidArgument(
            f"from_mesh: faces {_faces_with(ends, edge)} go along the edge {edge.tolist()} the same way; reverse "
            "one, or remove a duplicate face."
        )
    open_ = np.flatnonzero(~np.isin(back, known))
    if open_.size:
        raise InvalidArgument(
            f"from_mesh: the mesh is not closed: the edge {ends[open_[0]].tolist()} of face {open_[0] // 3} belongs to "
            f"no other face ({open_.size} such edges). Vertices at the same place must have the same index: "
            "np.unique(vertices, axis=0, return_inverse=True) merges them."
        )
    return x, triangles


def _faces_with(ends, edge):
    """Return the faces that run along an edge in its direction."""
    return (np.flatnonzero((ends == edge).all(axis=1)) // 3).tolist()
