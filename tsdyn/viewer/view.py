"""`solution.view` and `scene.view`: one HTML page, in a notebook, in the browser, or in a file; or a GIF."""

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

SCRIPTS = ("poses.js", "instances.js", "stage.js", "names.js", "player.js")
PAGES, GIF = (".html", ".htm"), ".gif"
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
        """Write the page to a file, of suffix .html; return its path."""
        return write(self.html.encode(), page_path(path, PAGES))

    def _repr_html_(self) -> str:
        """Return the page in a frame of its own."""
        style = f"width: 100%; height: {HEIGHT}px; border: 0"
        return f'<iframe srcdoc="{html.escape(self.html)}" style="{style}" allowfullscreen></iframe>'

    def __repr__(self) -> str:
        return f"<View: an HTML page of {len(self.html) / 1e6:.2g} MB; .save(path) writes it>"


def show(data: dict[str, Any], path: str | Path | None) -> Path | View:
    """Write a page or a GIF of `run_data` or `scene_data`, or show it in a notebook or the browser."""
    path = None if path is None else page_path(path)
    if path is not None and path.suffix.lower() == GIF:
        from .painting import animation

        if not path.resolve().parent.is_dir():  # painting takes seconds
            raise InvalidArgument(f"view: {path} can't be written: there is no such folder.")
        return write(animation(data), path)
    page = page_of(data)
    if path is not None:
        return write(page.encode(), path)
    if in_notebook():
        return View(page)
    handle, name = tempfile.mkstemp(prefix="tsdyn-", suffix=".html")
    os.close(handle)
    file = write(page.encode(), Path(name))
    if not (has_display() and webbrowser.open(file.as_uri())):
        print(f"The page is in {file}; open it in a browser.")
    return file


def page_of(data: dict[str, Any]) -> str:
    """The page of the data of a run or a scene."""
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


def write(content: bytes, path: Path) -> Path:
    """Write a page or a GIF to a file; return its path; raises InvalidArgument if it can't be written."""
    try:
        path.write_bytes(content)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidArgument(f"view: {path} can't be written: {reason}.") from error
    return path


def page_path(path: str | Path, suffixes: tuple[str, ...] = (*PAGES, GIF)) -> Path:
    """The path of an animation, of suffix .html if it has none; raises InvalidArgument for another one than these."""
    try:
        path = Path(path)
        path = path if path.suffix else path.with_suffix(".html")
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"view: {path} can't be written: {error}.") from error
    if path.suffix.lower() not in suffixes:
        kinds = (
            "an HTML page or a GIF; its path must end in .html or .gif" if GIF in suffixes else "an HTML page (.html)"
        )
        raise InvalidArgument(f"view: this is {kinds}, got {str(path)!r}. solution.plot(path) writes a figure.")
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
