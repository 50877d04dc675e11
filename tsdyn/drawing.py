"""How results show themselves: tables as text and in notebooks; colours, axes and files of figures."""

from __future__ import annotations

import html
import inspect
from contextlib import contextmanager
from functools import wraps
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .calls import fitting
from .errors import InvalidArgument, MissingDependency

if TYPE_CHECKING:
    from .hints import Callable, Function, Iterable, Iterator, Sequence

# from the palette of Okabe and Ito, distinct for every colour vision
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


def aligned(rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)) -> list[str]:
    """Lines of a table whose columns are aligned, those in `left` to the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    pads = [str.ljust if i in left else str.rjust for i in range(len(widths))]
    cells = [[pad(cell, width) for pad, cell, width in zip(pads, row, widths, strict=True)] for row in rows]
    return ["  ".join(line).rstrip() for line in cells]


class Tabulated(Drawn):
    """Base of results that are a table: `_shown()` gives lines above it, its rows, the first of heads, lines below."""

    _left: tuple[int, ...] = (0,)  # columns that are aligned to the left

    def _shown(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        raise NotImplementedError

    def __str__(self) -> str:
        above, rows, below = self._shown()
        return "\n".join([*above, *aligned(rows, self._left), *below])

    def _repr_html_(self) -> str:
        """The table in a notebook."""
        above, rows, below = self._shown()
        notes = "<br>".join(map(_escaped, filter(None, below)))
        return html_table(rows[1:], "\n".join(filter(None, above)), *rows[:1]) + (notes and f"<p>{notes}</p>")


class Listing(list[Any]):
    """A list whose text, and picture in a notebook, is a table: `heads`, and `_cells` of an entry."""

    heads: tuple[str, ...] = ()

    def _cells(self, entry: Any) -> Sequence[str]:
        raise NotImplementedError

    def __str__(self) -> str:
        rows = [self.heads, *map(self._cells, self)]
        return "\n".join(aligned(rows, range(len(self.heads))))

    def _repr_html_(self) -> str:
        """The table in a notebook."""
        return html_table(map(self._cells, self), heads=self.heads)


def html_table(rows: Iterable[Sequence[str]], caption: str = "", heads: Sequence[str] = (), named: bool = False) -> str:
    """A table of texts for notebooks; named: the first one of each row is a head."""
    lines = [[f"<th>{_escaped(cell)}</th>" for cell in heads]] if heads else []
    for row in rows:
        tags = ["th" if named else "td", *["td"] * (len(row) - 1)]
        lines.append([f"<{tag}>{_escaped(cell)}</{tag}>" for tag, cell in zip(tags, row, strict=True)])
    body = "".join(f"<tr>{''.join(line)}</tr>" for line in lines)
    caption = "<br>".join(map(_escaped, caption.splitlines()))
    return f"<table>{caption and f'<caption>{caption}</caption>'}{body}</table>"


def _escaped(text):
    return html.escape(text).replace("  ", "&emsp;")


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


# What all figures share: axes, and curves of many points.

ZERO = 1e-17  # what an error of exactly zero is drawn as: below any other
SHOWN = {  # first argument: what it must be
    "solution": "a Solution, which ts.simulate returns",
    "linearisation": "a Linearisation, which scene.linearise() returns",
    "ensemble": "an Ensemble, which ts.ensemble returns",
}
POINTS = 400  # intervals of time, the largest error of each of which is drawn


def axes_of(ax: Any, rows: int = 1, columns: int = 1, **options: Any) -> Any:
    """The caller's axes, or new ones of pyplot's: one, or an array (rows, columns) where there are several."""
    demand_matplotlib()
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(rows, columns, layout="constrained", **options)[1]


def figure_of(*needed: str) -> Callable[[Function], Function]:
    """Decorate what draws: a wrong call is refused, as is a first argument without the attributes that it needs."""

    def decorate(draw):
        name = next(iter(inspect.signature(draw).parameters))

        @wraps(draw)
        def checked(*arguments, **keywords):
            given = arguments[:1] or [keywords[name] for _ in range(name in keywords)]
            for shown in given:  # by `dir`, since `hasattr` computes properties
                if not {*needed} <= {*dir(shown)} or isinstance(shown, type):
                    raise InvalidArgument(f"{draw.__name__}: {name} must be {SHOWN[name]}, got {shown!r}.")
            return draw(*arguments, **keywords)

        return fitting(checked)

    return decorate


def bare(ax: Any) -> None:
    """Without the frame above and to the right, with a faint grid."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, color="#dddddd", linewidth=0.6)


def largest(t: Any, error: Any) -> tuple[Any, Any]:
    """Points of a curve: the largest error of each interval of time, zeros lifted to where a log axis has them."""
    size = max(1, -(-t.size // POINTS))
    at = [start + int(error[start : start + size].argmax()) for start in range(0, t.size, size)]
    return t[at], np.maximum(error[at], ZERO)
