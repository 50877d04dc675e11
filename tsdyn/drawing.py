"""What figures share: colours, whether matplotlib is there, and how a figure is written to a file."""

from __future__ import annotations

from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .calls import fitting
from .errors import InvalidArgument, MissingDependency

if TYPE_CHECKING:
    from collections.abc import Iterator

# from the palette of Okabe and Ito, told apart whatever the colour vision
BLUE, VERMILION, GREEN = "#0072B2", "#D55E00", "#009E73"
GREY = "#6b6b6b"
PICTURES = (".png", ".pdf", ".svg", ".jpg", ".jpeg", ".eps", ".ps", ".tif", ".tiff", ".webp", ".pgf")


def is_picture(given: Any) -> bool:
    """Whether an argument is the path of a picture, and no name."""
    return isinstance(given, PathLike) or (isinstance(given, str) and given.lower().endswith(PICTURES))


def demand_matplotlib(what: str = "the figure") -> None:
    """Raise MissingDependency where matplotlib, or Pillow, is not installed; `what` needs it."""
    try:
        import matplotlib  # noqa: F401
        import PIL  # noqa: F401
    except ImportError as error:
        raise MissingDependency(f"{what} needs matplotlib: pip install 'tsdyn[plot]'") from error


@contextmanager
def new_figure(width: float, height: float) -> Iterator[Any]:
    """Draw in the body of a `with` into a figure of this size, inches, that looks the same whatever style is set.

    Without pyplot, it affects neither the caller's backend nor open figures.
    """
    demand_matplotlib()
    from matplotlib import style
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with style.context("default"):
        figure = Figure(figsize=(width, height), dpi=200, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


class Drawn:
    """Base of results that draw themselves by `figure()`."""

    def plot(self, path: str | Path | None = None) -> Any:
        """Draw it; return the matplotlib Figure, written to `path` if given.

        Raises
        ------
        MissingDependency
            If matplotlib is not installed.
        InvalidArgument
            If the figure can't be written there.
        """
        drawn = self.figure()
        if path is not None:
            save(drawn, path)
        return drawn


@fitting
def save(figure: Any, path: str | Path) -> Path:
    """Write a figure to a file, in the format that its suffix names, PNG if it has none; return the file's path.

    Raises
    ------
    InvalidArgument
        If the path is none, the folder doesn't exist or can't be written to, or the format is unknown.

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
    if not hasattr(figure, "savefig"):
        raise InvalidArgument(f"save: figure must be a matplotlib Figure, such as axes.figure, got {figure!r}.")
    from matplotlib import style

    try:
        path = Path(path)
        path = path if path.suffix else path.with_suffix(".png")
        with style.context("default"):
            figure.savefig(path)
    except (OSError, TypeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidArgument(f"the figure can't be written to {path}: {reason}") from error
    return path
