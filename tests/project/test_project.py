"""The project's own pages and metadata: links lead somewhere, the version stands in one place."""

import ast
import io
import re
import tokenize
import tomllib
from pathlib import Path

import pytest

import tsdyn as ts
from docs import draw
from docs.class_pages import URLS
from tests.helpers.documents import README, pages
from tests.helpers.syntax import nodes

ROOT = Path(__file__).parents[2]
PAGES = [*ROOT.glob("*.md"), *pages()]


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


def test_links_of_the_readme_are_absolute_and_resolve():
    """A package index shows README without the repository beside it."""
    raw = URLS["Repository"].replace("https://github.com", "https://raw.githubusercontent.com") + "/main/"
    places = {raw: ROOT, f"{URLS['Repository']}/blob/main/": ROOT, f"{URLS['Documentation']}/": ROOT / "docs"}
    links = re.findall(r"\]\(([^)\s]+)\)", README.read_text())
    assert len(links) > 8
    for link in links:
        assert link.startswith("https://"), link
        for place, folder in places.items():
            if link.startswith(place):
                path, _, anchor = link.removeprefix(place).partition("#")
                page = folder / re.sub(r"\.html$", ".md", path)
                assert page.exists() or path == "gallery/index.html", link  # the build writes the gallery
                assert not anchor or anchor in anchors(page), link
                break
        else:
            assert link.startswith("https://doi.org/"), link


def test_names_on_the_reading_page_exist():
    rows = re.findall(r"^\| `(\w+)` \| `(\w+)` \|", (ROOT / "docs" / "reading-the-code.md").read_text(), re.MULTILINE)
    assert len(rows) > 20
    for package, name in rows:
        defines = re.compile(rf"^(?:def|class) {name}\b", re.MULTILINE)
        found = (defines.search(file.read_text()) for file in draw.packages()[package].rglob("*.py"))
        assert any(found), f"{package} has no {name}"


def test_figures_of_the_landing_page_are_those_of_the_pages_it_names():
    row = re.compile(r"^\| (\d[^|]+) \|[^|]+\| \[[^]]+\]\(([\w-]+\.md)", re.MULTILINE)
    rows = row.findall((ROOT / "docs" / "index.md").read_text())
    assert len(rows) == 5
    for figure, page in rows:
        text = (ROOT / "docs" / page).read_text()
        assert all(number in text for number in re.findall(r"\d[\d.e-]*", figure)), (figure, page)


def test_version_has_one_source():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert "version" not in project["project"]
    assert not re.search(r"^version:", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    module, name = project["tool"]["setuptools"]["dynamic"]["version"]["attr"].rsplit(".", 1)
    literals = [
        node.value.value  # of a literal: setuptools reads it without importing the package
        for node in ast.parse((ROOT / module.replace(".", "/")).with_suffix(".py").read_text()).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name
    ]
    assert literals == [ts.__version__]


def test_the_architecture_page_names_every_package():
    table = set(re.findall(r"^\| `(\w+)` \|", (ROOT / "docs" / "architecture.md").read_text(), re.MULTILINE))
    assert table >= draw.packages().keys()


def test_the_pictures_are_those_of_the_code():
    """Draw them anew by python -m docs.draw after a change of packages, or of the functions that a step calls."""
    shown = (ROOT / "docs" / "images" / "packages.svg").read_text()
    assert all(f">{name}<" in shown for name in draw.packages())
    shown = (ROOT / "docs" / "images" / "step.svg").read_text()
    for _, module, function in draw.STEP:
        assert draw.caption(module, function)
        assert f">{module}.{function}<" in shown


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_pages_name_exist(page):
    if page.name == "CHANGELOG.md":
        return  # of the past, too
    folders = "tsdyn|constraints|integrators|tests|examples|benchmarks|docs"
    for path in re.findall(rf"`((?:{folders})/[\w/.]*)`", page.read_text()):
        assert (ROOT / path).exists(), f"{page.name}: {path}"


PATH = re.compile(r"(?<![\w/.*-])([\w/-]+\.(?:py|md))\b")
FOLDERS = ("tsdyn", "constraints", "integrators", "tests", "examples", "benchmarks", "docs")


def prose(module, source):
    """Docstrings and comments of a module, in one text."""
    owners = [node for node in nodes(module) if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)]
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = [token.string for token in tokens if token.type == tokenize.COMMENT]
    return "\n".join([*(ast.get_docstring(node) or "" for node in owners), *comments])


def test_files_that_docstrings_and_comments_name_exist():
    """A path, or the end of one, of a file of the project; `file.py` is one of the reader's."""
    modules = [file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py")]
    files = [*modules, *ROOT.glob("*.md"), ROOT / "setup.py", *(ROOT / "docs").rglob("*.md"), ROOT / "file.py"]
    paths = [file.relative_to(ROOT).parts for file in files]
    ends = {"/".join(parts[i:]) for parts in paths for i in range(len(parts))}
    for module in modules:
        source = module.read_text(encoding="utf-8")
        if {*PATH.findall(source)} - ends:  # in code too, which may name files of its own
            assert not {*PATH.findall(prose(module, source))} - ends, module.relative_to(ROOT)


REFERENCE = re.compile(r"(?<![\w./])([a-z]+_[a-z_]{2,})\.(\w{3,})\b(?![/.])")


def test_names_that_docstrings_and_comments_refer_to_exist():
    """Of references `module.name` those with an underscore, which variables and files of examples lack."""
    modules = {
        path: path.read_text(encoding="utf-8") for folder in FOLDERS[:3] for path in (ROOT / folder).rglob("*.py")
    }
    names = {path.stem: set() for path in modules}
    for path in modules:
        for node in nodes(path):
            names[path.stem] |= {getattr(node, key, None) for key in ("name", "id", "arg", "attr", "asname")}

    def is_known(path, owner, name):
        return name in names.get(owner, ()) or owner in names[path.stem] or name in ("html", "toml")

    for path, source in modules.items():
        if all(is_known(path, *found) for found in REFERENCE.findall(source)):  # in code, too
            continue
        said = "\n".join(
            line for line in prose(path, source).splitlines() if not line.lstrip().startswith((">>>", "..."))
        )
        for owner, name in REFERENCE.findall(said):
            assert is_known(path, owner, name), f"{path.relative_to(ROOT)}: {owner}.{name}"
