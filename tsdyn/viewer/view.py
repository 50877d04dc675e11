"""`solution.view`: the animation of a run as one HTML page, in a notebook, in the browser, or in a file."""

from __future__ import annotations

import html
import json
import os
import sys
import tempfile
import webbrowser
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from ..errors import InvalidArgument
from .run_data import run_data

SCRIPTS = ("poses.js", "instances.js", "stage.js", "player.js")
SUFFIXES = (".html", ".htm")
HEIGHT = 520  # of the frame in a notebook, pixels


class View:
    """A page that notebooks show inline.

    Attributes
    ----------
    html : str
        The whole page.
    """

    def __init__(self, page: str) -> None:
        self.html = page

    def save(self, path: str | Path) -> Path:
        """Write the page to a file; return its path."""
        return write(self.html, path)

    def _repr_html_(self) -> str:
        """Return the page in a frame of its own."""
        style = f"width: 100%; height: {HEIGHT}px; border: 0"
        return f'<iframe srcdoc="{html.escape(self.html)}" style="{style}" allowfullscreen></iframe>'

    def __repr__(self) -> str:
        return f"<View: an HTML page of {len(self.html) / 1e6:.2g} MB; .save(path) writes it>"


def show(solution: Any, path: str | Path | None, shapes: Any, trails: Any) -> Path | View:
    """What `Solution.view` does."""
    path = None if path is None else page_path(path)
    page = page_of(run_data(solution, shapes, trails))
    if path is not None:
        return write(page, path)
    if in_notebook():
        return View(page)
    handle, name = tempfile.mkstemp(prefix="tsdyn-", suffix=".html")
    os.close(handle)
    file = write(page, name)
    if not (has_display() and webbrowser.open(file.as_uri())):
        print(f"The animation is in {file}; open it in a browser.")
    return file


def page_of(data: dict[str, Any]) -> str:
    """The page of the data of a run."""
    run = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts = {
        "title": html.escape(data["title"]),
        "style": source("page.css"),
        "run": run,
        "three": source("three.js"),
        "scripts": "\n".join(source(name) for name in SCRIPTS),
    }
    before, *rest = source("page.html").split("{{")
    pieces = [piece.partition("}}") for piece in rest]
    return before + "".join(parts[name] + after for name, _, after in pieces)


@cache
def source(name: str) -> str:
    """The text of a file of the page."""
    return (resources.files(__package__) / "page" / name).read_text(encoding="utf-8")


def write(page: str, path: str | Path) -> Path:
    """Write a page to a file; return its path.

    Raises
    ------
    InvalidArgument
        If the file can't be written, or has another suffix than .html or .htm.
    """
    path = page_path(path)
    try:
        path.write_text(page, encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidArgument(f"view: the page can't be written to {path}: {reason}.") from error
    return path


def page_path(path: str | Path) -> Path:
    """The path of a page, of suffix .html if it has none; raises InvalidArgument for another one than .html or .htm."""
    try:
        path = Path(path)
        path = path if path.suffix else path.with_suffix(".html")
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"view: the page can't be written to {path}: {error}.") from error
    if path.suffix.lower() not in SUFFIXES:
        raise InvalidArgument(
            f"view: the animation is an HTML page; its path must end in .html, got {str(path)!r}. solution.plot(path) "
            "writes a figure."
        )
    return path


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


def has_display() -> bool:
    """Whether a window can be opened here; a browser within the terminal would hold the program up."""
    if os.environ.get("BROWSER") or sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
