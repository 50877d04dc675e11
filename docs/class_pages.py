"""A page for each constraint, joint, force and integrator, and for each public name, from its file and docstring.

Classes are found through the registries that plug-ins use, so a plug-in that is imported gets a page, too:

    python -m docs.class_pages folder [module ...]
"""

import argparse
import inspect
import re
import sys
from importlib import import_module
from pathlib import Path

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
MODULES = (ts, ts.motions, ts.shapes, ts.plots, ts.testing)


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
    where, file = file_of(cls), Path(inspect.getsourcefile(cls))
    how = f"[a {WRITTEN_IN[kind]} of your own](/plug-ins.md)".replace("[a i", "[an i")
    code = fenced(file.read_text(encoding="utf-8").strip(), "python")
    return f"## Source\n\n`{where}`; {how} has the same form.\n\n{code}"


def kind_index(kind):
    """The page that lists the classes of a kind."""
    title, found = KINDS[kind][0], classes(kind)
    lines = [f"# {title}", "", "| | |", "|---|---|"]
    lines += [f"| [{cls.__name__}]({cls.__name__}.md) | {escaped(_summary(cls))} |" for cls in found]
    return "\n".join([*lines, "", *_toctree([cls.__name__ for cls in found])])


def _toctree(names):
    return ["```{toctree}", ":hidden:", "", *names, "```", ""]


def _summary(thing):
    return sections(thing.__doc__)[0].split("\n\n")[0].replace("\n", " ")


def public_names(module):
    """Functions and classes of a public module, by name."""
    named = {name: getattr(module, name) for name in sorted(module.__all__)}
    return {name: one for name, one in named.items() if isinstance(one, type) or inspect.isroutine(one)}


def module_page(module):
    """Markdown of the public names of a module."""
    name = module.__name__.replace("tsdyn", "ts", 1)
    parts = [f"# {name}", paragraphs(inspect.getdoc(module) or "")]
    for each, thing in public_names(module).items():
        parts.append(_described(f"{name}.{each}", thing, 2))
        if isinstance(thing, type):
            parts += [_described(f"{each}.{method}", value, 3) for method, value in _methods(thing)]
    return "\n\n".join(parts) + "\n"


def _methods(cls):
    """Public methods and properties that a class defines itself, or inherits within tsdyn."""
    if issubclass(cls, BaseException):
        return
    for name, value in inspect.getmembers(cls):
        value = value.fget if isinstance(value, property) else value
        if (
            not name.startswith("_")
            and inspect.isfunction(value)
            and value.__doc__
            and value.__module__.startswith("tsdyn")
        ):
            yield name, value


def _described(title, thing, level):
    parts = [f"{'#' * level} `{title}`", fenced(signature(title, thing), "python"), page_of(thing.__doc__, level + 1)]
    return "\n\n".join(parts)


def write(folder):
    """Write all pages and pictures into a folder; files whose content stays the same are left alone."""
    folder = Path(folder)
    for kind in KINDS:
        (folder / kind).mkdir(parents=True, exist_ok=True)
        for cls in classes(kind):
            write_text(folder / kind / f"{cls.__name__}.md", class_page(cls, kind, folder / kind))
        write_text(folder / kind / "index.md", kind_index(kind))
    for module in MODULES:
        write_text(folder / f"{module.__name__}.md", module_page(module))


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
