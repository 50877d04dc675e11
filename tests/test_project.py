"""The project's own pages and metadata: links lead somewhere, the version stands in one place."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

import tsdyn as ts
from docs import draw

ROOT = Path(__file__).parents[1]
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]


def anchors(page):
    """The anchors of a page's headings, as GitHub and most renderers make them."""
    prose = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    for heading in re.findall(r"^#+ +(.*)$", prose, re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_between_pages_resolve(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{page.name}: {link}"
        if anchor:
            assert anchor in set(anchors(target)), f"{page.name}: {link}"


def test_version_has_one_source():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert "version" not in project["project"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "tsdyn.__version__"}
    assert not re.search(r"^version:", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    literals = [
        node.value.value  # of a literal: setuptools reads it without importing the package
        for node in ast.parse((ROOT / "tsdyn" / "__init__.py").read_text()).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__version__"
    ]
    assert literals == [ts.__version__]


def test_the_architecture_page_names_every_package():
    table = set(re.findall(r"^\| `(\w+)` \|", (ROOT / "docs" / "architecture.md").read_text(), re.MULTILINE))
    assert table >= draw.packages().keys()


def test_the_pictures_are_drawn_from_functions_that_exist(tmp_path):
    draw.draw_packages(tmp_path / "packages.svg")
    draw.draw_step(tmp_path / "step.svg")  # LookupError of a function that is gone
    text = (tmp_path / "packages.svg").read_text()
    assert all(f">{name}<" in text for name in draw.packages())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_pages_name_exist(page):
    if page.name == "CHANGELOG.md":
        return  # of the past, too
    folders = "tsdyn|constraints|integrators|tests|examples|benchmarks|docs"
    for path in re.findall(rf"`((?:{folders})/[\w/.]*)`", page.read_text()):
        assert (ROOT / path).exists(), f"{page.name}: {path}"
