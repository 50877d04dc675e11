"""What figures share: colours, whether matplotlib is there, and how a figure is written to a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .errors import InvalidArgument, MissingDependency

# from the palette of Okabe and Ito, told apart whatever the colour vision
BLUE, VERMILION, GREEN = "#0072B2", "#D55E00", "#009E73"
GREY = "#6b6b6b"


def demand_matplotlib():
    """Raise MissingDependency where matplotlib is not installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise MissingDependency("the figure needs matplotlib: pip install 'tsdyn[plot]'") from error


def save(figure: Any, path: str | Path) -> Path:
    """Write a figure to a file, in the format that its suffix names, PNG if it has none; return the file's path.

    Raises
    ------
    InvalidArgument
        If the folder doesn't exist or can't be written to, or the format is unknown.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from matplotlib.figure import Figure
    >>> import tsdyn as ts
    >>> with TemporaryDirectory() as folder:
    ...     print(ts.plots.save(Figure(), Path(folder) / "errors").name)
    errors.png
    """
    from matplotlib import style

    path = Path(path)
    if not path.suffix:
        path = path.with_suffix(".png")
    try:
        with style.context("default"):
            figure.savefig(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidArgument(f"the figure can't be written to {path}: {reason}") from error
    return path
