"""Draw the pictures of architecture.md from the code, and those of the gallery from its examples.

Packages, imports and captions of functions are read with ast, without importing tsdyn. matplotlib is needed.

Run it: python -m docs.draw [packages] [step] [tutorial] [gallery] [name of an example]
"""

import ast
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"
BESIDE = ("constraints", "integrators")  # packages of tsdyn that lie beside its folder
BOX = {"boxstyle": "round,pad=0.35", "facecolor": "#e8eef7", "edgecolor": "#35507a"}
# the way of the data through a run of the default formulation by a Runge-Kutta method, as (depth of the call, function)
STEP = (
    (0, "simulation.prepared_run", "simulate"),
    (1, "model.packed", "pack"),
    (1, "runs.driver", "run"),
    (2, "runs.driver", "drive"),
    (3, "runs.stepper", "advance"),
    (4, "methods.explicit", "second_order_step"),
    (5, "formulations.tangent", "place"),
    (6, "formulations.charts", "displace"),
    (6, "rows.evaluation", "evaluate_rows"),
    (6, "rows.schur_complement", "factorise_selected_rows"),
    (5, "formulations.tangent", "accelerate"),
    (6, "formulations.accelerations", "solve_accelerations"),
    (4, "runs.step_control", "accept"),
    (4, "runs.dense_output", "record"),
    (4, "formulations.tangent", "start_chart"),
)


def packages():
    """Folders of all packages, by name, and the module plugins, which stands between packages."""
    found = {file.parent.name: file.parent for file in sorted((ROOT / "tsdyn").glob("*/__init__.py"))}
    return found | {name: ROOT / name for name in BESIDE} | {"plugins": ROOT / "tsdyn" / "plugins.py"}


def imports(package):
    """Names of the packages that the modules of a package import, lazily or at their top."""
    known, found = packages(), set()
    place = known[package]
    for file in [place] if place.is_file() else place.rglob("*.py"):
        depth = len(file.relative_to(place).parts)
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level == depth + 1:
                first = (node.module or "").split(".")[0]
                found |= {first} if first else {alias.name for alias in node.names}
    return found & known.keys() - {package}


def levels(edges):
    """The level of each package: one above the highest that it imports."""

    def level(name):
        return 1 + max((level(other) for other in edges[name]), default=-1)

    return {name: level(name) for name in edges}


def reduced(edges):
    """Imports that no chain of other imports implies."""

    def reach(name):
        return set().union(*({other} | reach(other) for other in edges[name])) if edges[name] else set()

    return {
        name: {other for other in targets if not any(other in reach(third) for third in targets - {other})}
        for name, targets in edges.items()
    }


def draw_packages(path):
    """Draw every package as a box, lowest level at the bottom, with the imports that no others imply."""
    from matplotlib.figure import Figure

    edges = {name: imports(name) for name in packages()}
    level = levels(edges)
    rows = [sorted(name for name in level if level[name] == i) for i in range(max(level.values()) + 1)]
    place = {name: (x - (len(row) - 1) / 2, y) for y, row in enumerate(rows) for x, name in enumerate(row)}
    figure = Figure(figsize=(7.5, 0.62 * len(rows)))
    axes = figure.add_axes((0, 0, 1, 1))
    for name, targets in reduced(edges).items():
        for other in sorted(targets):
            (x0, y0), (x1, y1) = place[name], place[other]
            bend = 0.0 if y0 - y1 == 1 or x0 != x1 else 0.5
            arrow = {"arrowstyle": "-|>", "color": "0.55", "connectionstyle": f"arc3,rad={bend}", "lw": 0.8}
            axes.annotate("", (x1, y1 + 0.24), (x0, y0 - 0.24), arrowprops=arrow)
    for name, (x, y) in place.items():
        axes.text(x, y, name, ha="center", va="center", fontsize=9, bbox=BOX)
    wide = max(map(len, rows)) / 2
    axes.set(xlim=(-wide - 0.3, wide + 0.3), ylim=(-0.6, len(rows) - 0.4))
    axes.axis("off")
    _save(figure, path)


def caption(module, function):
    """First sentence of the docstring of a function; LookupError if there is no such function."""
    parts = module.split(".")
    file = packages()[parts[0]].joinpath(*parts[1:]).with_suffix(".py")
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef) and node.name == function:
            return (ast.get_docstring(node) or "").split("\n\n")[0].replace("\n", " ")
    raise LookupError(f"{module} has no function {function}: correct STEP in {Path(__file__).name}")


def draw_step(path):
    """Draw the way of the data through a step as a tree of calls, captions from the docstrings of the functions."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 0.5 * len(STEP)))
    axes = figure.add_axes((0, 0, 1, 1))
    callers = {}
    for i, (depth, module, function) in enumerate(STEP):
        x = 0.02 + 0.03 * depth
        axes.text(x, -i, f"{module}.{function}", va="center", fontsize=8, bbox=BOX)
        axes.text(0.52, -i, textwrap.fill(caption(module, function), 62), va="center", fontsize=7.5)
        if depth:
            axes.plot((x - 0.02, x - 0.02, x - 0.01), (-callers[depth - 1] - 0.3, -i, -i), color="0.5", lw=0.8)
        callers[depth] = i
    axes.set(xlim=(0, 1), ylim=(-len(STEP) + 0.4, 0.6))
    axes.axis("off")
    _save(figure, path)


def _save(figure, path):
    import matplotlib

    with matplotlib.rc_context({"svg.hashsalt": "tsdyn", "svg.fonttype": "none"}):
        figure.savefig(path, metadata={"Date": None, "Creator": None})


def main(words):
    """Draw all pictures, or those that are named."""
    from docs.gallery import ENTRIES
    from docs.gallery_pages import draw, draw_tutorial

    pictures = {
        "packages": lambda: draw_packages(IMAGES / "packages.svg"),
        "step": lambda: draw_step(IMAGES / "step.svg"),
        "tutorial": draw_tutorial,
    }
    pictures |= {entry.name: lambda entry=entry: draw(entry) for entry in ENTRIES}
    words = [*words, *(entry.name for entry in ENTRIES)] if "gallery" in words else words or pictures
    unknown = {*words} - pictures.keys() - {"gallery"}
    if unknown:
        raise SystemExit(f"no picture {', '.join(sorted(unknown))}; there are gallery, {', '.join(pictures)}")
    for name in words:
        if name != "gallery":
            pictures[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
