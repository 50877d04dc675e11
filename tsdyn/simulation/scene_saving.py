"""`Scene.save`."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..calls import fitting
from ..errors import InvalidArgument, StorageError

if TYPE_CHECKING:
    from ..hints import Place, Scene


@fitting
def save(scene: Scene, path: Place) -> Path:
    """Write the scene to a TOML file, from which `ts.load` returns it to the bit.

    Parameters
    ----------
    path : str or PathLike
        Ends in .toml. A file that is there is replaced.

    Returns
    -------
    Path

    Raises
    ------
    InvalidArgument
        If the scene has what a file can't hold: functions, named each, or a class of your own that keeps its arguments
        under other names.
    StorageError
        If the file can't be written.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import tsdyn as ts
    >>> stone = (scene := ts.Scene(gravity=(0, 0, -10))).add_point_mass(mass=0.5, position=(0, 0, 2), name="stone")
    >>> print(scene.save(mkdtemp() + "/stone.toml").read_text().strip())
    version = 1
    gravity = [0.0, 0.0, -10.0]
    <BLANKLINE>
    [[body]]
    name = "stone"
    type = "PointMass"
    mass = 0.5
    position = [0.0, 0.0, 2.0]
    """
    from ..files import scene_text

    if not isinstance(path, (str, os.PathLike)) or Path(path).suffix.lower() != ".toml":
        raise InvalidArgument(f"a scene is saved to a path that ends in .toml, got {path!r}.")
    return write_text(path, scene_text.write(scene, type(scene)))


def write_text(path: Place, text: str) -> Path:
    """Write a text file whole or not at all; raises StorageError."""
    path = Path(path)
    partial = path.with_name(f"{path.name}-partial-{os.getpid()}")
    try:
        partial.unlink(missing_ok=True)  # a link, perhaps
        with open(partial, "x", encoding="utf-8", newline="\n") as file:
            file.write(text)
        os.replace(partial, path)
    except (OSError, UnicodeError) as error:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise StorageError(f"{path} can't be written: {getattr(error, 'strerror', None) or error}.") from error
    return path
