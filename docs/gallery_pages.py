"""Pages of the gallery: an example each, with its picture, its text and its source."""

import ast
import io
import re
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from docs.class_pages import write_text
from docs.class_pictures import save_small
from docs.docstring_pages import escaped, fenced, paragraphs
from docs.gallery import ENTRIES, SECTIONS
from docs.painting import paint
from tsdyn.drawing import new_figure

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images" / "gallery"
ANIMATIONS = "animations"  # folder of the site
WIDTH, HEIGHT = 6.6, 2.5


def draw(entry):
    """Draw the picture of an example: the scene, and a curve."""
    with new_figure(WIDTH, HEIGHT) as figure:
        if entry.draw:
            entry.draw(entry.module, figure)
        else:
            solution = entry.solution()
            scene, curve = figure.subplots(1, 2, width_ratios=(3, 2))
            paint(scene, solution, entry.shapes, at=entry.at)
            curve.plot(solution.t, entry.curve(entry.module, solution), linewidth=1.2)
            curve.set(xlabel="time (s)", ylabel=entry.label)
            curve.spines[["top", "right"]].set_visible(False)
        save_small(figure, IMAGES / f"{entry.name}.png")


def draw_tutorial():
    """Draw the run of the tutorial, by its own code."""
    text = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8").partition("## Look")[0]
    names = {}
    with redirect_stdout(io.StringIO()):
        exec("\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)), names)
    solution = names["solution"]
    with new_figure(WIDTH, HEIGHT) as figure:
        scene, curve = figure.subplots(1, 2, width_ratios=(3, 2))
        paint(scene, solution[: np.searchsorted(solution.t, 0.45)], at=(0.0, 0.3, 0.6))
        curve.plot(solution.t, solution.angle_rate("bearing"), linewidth=1.2)
        curve.set(xlabel="time (s)", ylabel="rate of the crank (rad/s)")
        save_small(figure, ROOT / "docs" / "images" / "tutorial.png")


def page(entry):
    """Markdown of an example."""
    source = (ROOT / "examples" / f"{entry.name}.py").read_text(encoding="utf-8")
    text = ast.get_docstring(ast.parse(source)) or ""
    text = text.partition("Run it:")[0].strip()
    parts = [
        f"# {entry.title}",
        f"![{escaped(entry.title)}](/images/gallery/{entry.name}.png)",
        *[player(entry)] * entry.animated,
        paragraphs(text),
        fenced(f"python examples/{entry.name}.py", "sh"),
        fenced(source.strip(), "python"),
    ]
    return "\n\n".join(parts) + "\n"


def player(entry):
    """The animation of an example, as the site shows it."""
    source, title = f"../{ANIMATIONS}/{entry.name}.html", escaped(entry.title)
    frame = (
        f'<iframe src="{source}" title="{title}" width="100%" height="420" loading="lazy" style="border: 0"></iframe>'
    )
    return f"```{{raw}} html\n{frame}\n```"


def index():
    """The page of all pictures."""
    parts = [
        "# Gallery",
        "Each example is a file of `examples/` with a check: a closed form, a reference or a law that holds.",
    ]
    for section, entries in SECTIONS.items():
        parts.append(f"## {section}")
        parts += [
            f"### [{entry.title}]({entry.name}.md)\n\n![{escaped(entry.title)}](/images/gallery/{entry.name}.png)"
            for entry in entries
        ]
    names = "\n".join(entry.name for entry in ENTRIES)
    return "\n\n".join([*parts, f"```{{toctree}}\n:hidden:\n\n{names}\n```"]) + "\n"


def write(folder, files):
    """Write all pages into a folder, and animations into a folder of files that the site has as they are."""
    folder, animations = Path(folder), Path(files) / ANIMATIONS
    for each in (folder, animations):
        each.mkdir(parents=True, exist_ok=True)
    for entry in ENTRIES:
        write_text(folder / f"{entry.name}.md", page(entry))
        if entry.animated:
            entry.solution().view(animations / f"{entry.name}.html", shapes=entry.shapes or {})
    write_text(folder / "index.md", index())
