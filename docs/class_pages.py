"""The reference, from files and docstrings: a page for each class of a kind, entries of public names on topic pages.

Classes are found through the registries that plug-ins use, so a plug-in that is imported gets a page, too:

    python -m docs.class_pages folder [module ...]

A line `<!-- api: ... -->` of a page in docs/api stands for entries: `simulate`; `Solution`, or with its methods
`Solution.`; `Scene.add`; `motions.`, all names of a module; `joints/`, the table of a kind.
"""

import argparse
import inspect
import re
import sys
import tomllib
from functools import cached_property
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from types import FunctionType, ModuleType

import tsdyn as ts
from docs.class_pictures import picture
from docs.docstring_pages import escaped, fenced, page_of, paragraphs, sections

ROOT = Path(__file__).parents[1]
KINDS = {  # folder: title, classes, what a page of the kind shows
    "constraints": ("Constraints", ts.constraints.registered),
    "joints": ("Joints, motors and drivers", ts.constraints.registered_joints),
    "forces": ("Forces", ts.forces.registered),
    "integrators": ("Integrators", ts.integrators.registered),
}
LINE = 100  # characters of a signature in one line
WRITTEN_IN = {"constraints": "constraint", "joints": "joint", "forces": "force", "integrators": "integrator"}
ENTRIES = re.compile(r"^<!-- api: (.+) -->$", re.MULTILINE)
URLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]


def classes(kind):
    """Registered classes of a kind, by name; plug-ins' after the built-in ones."""
    known = KINDS[kind][1]()
    return sorted(known, key=lambda cls: (not cls.__module__.startswith("tsdyn."), cls.__name__))


def class_page(cls, kind, folder):
    """Markdown of one class; its picture is written into the folder."""
    module = sys.modules[cls.__module__]
    title, _, equations = (inspect.getdoc(module) or "").partition("\n\n")
    head, found = sections(cls.__doc__)
    shown = picture(cls, found.get("Examples", ""), folder / f"{cls.__name__}.png")
    parts = [f"# {cls.__name__}", paragraphs(head)]
    if shown:
        parts.append(f"![{escaped(shown)}]({cls.__name__}.png)\n\n*{escaped(shown)}*")
    parts.append(fenced(signature(_public(cls), cls), "python"))
    if equations and cls.__module__.startswith("tsdyn."):
        parts.append(
            f"## {'Method' if kind == 'integrators' else 'Equations'}\n\n{escaped(title)}\n\n{paragraphs(equations)}"
        )
    rest = "\n\n".join(f"{name}\n{'-' * len(name)}\n{text}" for name, text in found.items())
    parts.append(page_of(rest))
    parts.append(_source(cls, kind))
    return "\n\n".join(parts) + "\n"


def signature(name, thing):
    """The signature of a class or function, annotations without quotation marks."""
    try:
        found = inspect.signature(thing)
    except ValueError:
        return name
    line = _unquoted(f"{name}{found}")
    if len(line) <= LINE:
        return line
    arguments = [str(each) for each in found.parameters.values()]
    star = next(
        (i for i, each in enumerate(found.parameters.values()) if each.kind == each.KEYWORD_ONLY), len(arguments)
    )
    starred = any(each.kind == each.VAR_POSITIONAL for each in found.parameters.values())
    if star < len(arguments) and not starred:
        arguments.insert(star, "*")
    body = "".join(f"    {each},\n" for each in arguments)
    return _unquoted(f"{name}(\n{body})")


def _unquoted(text):
    return re.sub(r"(: |-> )'([^']*)'", r"\1\2", text)


def _public(cls):
    for module in (ts.constraints, ts.forces, ts.integrators):
        if getattr(module, cls.__name__, None) is cls:
            return f"{module.__name__.replace('tsdyn', 'ts', 1)}.{cls.__name__}"
    return cls.__qualname__


def file_of(cls):
    """The file of a class from the root of the project, its name alone for a plug-in elsewhere."""
    file = Path(inspect.getsourcefile(cls))
    return file.relative_to(ROOT).as_posix() if file.is_relative_to(ROOT) else file.name


def _source(cls, kind):
    how = f"[a {WRITTEN_IN[kind]} of your own](/plug-ins.md)".replace("[a i", "[an i")
    code = fenced(Path(inspect.getsourcefile(cls)).read_text(encoding="utf-8").strip(), "python")
    return f"## Source\n\n{source_link(cls)}; {how} has the same form.\n\n{code}"


def source_link(thing):
    """A link to the lines of a class or function in the repository; the file's name alone for a plug-in elsewhere."""
    file = file_of(thing)
    line = inspect.getsourcelines(thing)[1]
    return f"[{file}]({URLS['Repository']}/blob/main/{file}#L{line})" if (ROOT / file).exists() else f"`{file}`"


def kind_table(kind):
    """The table of the classes of a kind, whose pages follow in the navigation."""
    title, found = KINDS[kind][0], classes(kind)
    lines = [f"## {title}", "", "| | |", "|---|---|"]
    pages = {cls: f"/reference/{kind}/{cls.__name__}" for cls in found}
    lines += [f"| [{cls.__name__}]({pages[cls]}.md) | {escaped(_summary(cls))} |" for cls in found]
    return "\n".join([*lines, "", "```{toctree}", ":hidden:", "", *pages.values(), "```"])


def _summary(thing):
    return sections(thing.__doc__)[0].split("\n\n")[0].replace("\n", " ")


def with_entries(text):
    """A page of docs/api, with the entries that it names."""
    return ENTRIES.sub(lambda found: "\n\n".join(each for name in found[1].split() for each in entries(name)), text)


def entries(name):
    """Markdown of the entries that a name stands for: see the head of this file."""
    if name.endswith("/"):
        yield kind_table(name[:-1])
        return
    path = name.removesuffix(".")
    thing = attrgetter(path)(ts)
    if isinstance(thing, ModuleType):
        yield f"## ts.{path}\n\n{paragraphs(inspect.getdoc(thing) or '')}"
        members = [each for each in sorted(thing.__all__) if isinstance(getattr(thing, each), type | FunctionType)]
    else:
        yield _described(path, thing)
        members = methods(thing)
    if path != name:
        for each in members:
            yield from entries(f"{name}{each}{'.' * isinstance(thing, ModuleType)}")


def methods(cls):
    """Names of the documented methods and properties of a class that come from tsdyn."""
    named = {name: _function(value) for name, value in inspect.getmembers(cls) if not name.startswith("_")}
    functions = {name: value for name, value in named.items() if inspect.isfunction(value) and value.__doc__}
    is_error = isinstance(cls, type) and issubclass(cls, BaseException)
    return [] if is_error else [name for name, value in functions.items() if value.__module__.startswith("tsdyn")]


def _function(value):
    """What evaluates a property."""
    return value.fget if isinstance(value, property) else value.func if isinstance(value, cached_property) else value


def _described(path, thing):
    thing, parts = _function(thing), path.split(".")
    is_method = len(parts) > 1 and parts[-2][0].isupper()
    title, level = ".".join(parts[-2:]) if is_method else f"ts.{path}", 1 + len(parts)
    head = [f"{'#' * level} `{title}`", fenced(signature(title, thing), "python"), page_of(thing.__doc__, level + 1)]
    return "\n\n".join([*head, f"Source: {source_link(inspect.unwrap(thing))}"])


def write(folder):
    """Write all pages and pictures into a folder; files whose content stays the same are left alone."""
    folder = Path(folder)
    for kind in KINDS:
        (folder / kind).mkdir(parents=True, exist_ok=True)
        for cls in classes(kind):
            write_text(folder / kind / f"{cls.__name__}.md", class_page(cls, kind, folder / kind))


def write_text(path, text):
    """Write a page; a file that holds it already is left alone, so that a build does not read it again."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def main():
    """Write the pages into a folder, with those of modules that are named."""
    parser = argparse.ArgumentParser(prog="python -m docs.class_pages", description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("module", nargs="*", help="modules that define plug-ins")
    given = parser.parse_args()
    for name in given.module:
        import_module(name)
    write(given.folder)


if __name__ == "__main__":
    main()
