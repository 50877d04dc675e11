"""Docstrings as Markdown: numpydoc sections, formulas as they stand, examples as sessions."""

import inspect
import re

from tsdyn.calls import SECTION

LISTED = ("Parameters", "Returns", "Attributes", "Raises", "Yields")
PLAIN = re.compile(r"(`[^`]*`)")


def escaped(text):
    """Prose with the characters that Markdown would read as marks escaped, but for code in backticks."""
    parts = PLAIN.split(text)
    return "".join(part if i % 2 else re.sub(r"([\\*_\[\]<>|$#{}~^])", r"\\\1", part) for i, part in enumerate(parts))


def sections(text):
    """The text before the first section of a docstring, and its sections by title."""
    head, *parts = SECTION.split(inspect.cleandoc(text or ""))
    return head.strip(), dict(zip(parts[::2], (part.strip("\n") for part in parts[1::2]), strict=True))


def paragraphs(text):
    """Markdown of prose, lists, tables and indented formulas."""
    blocks = []
    for block in re.split(r"\n\s*\n", text.strip("\n")):
        lines = block.split("\n")
        at = next((i for i, line in enumerate(lines) if line.startswith("    ")), len(lines))
        prose, formula = lines[:at], lines[at:]
        if formula and not all(line.startswith("    ") for line in formula):
            prose, formula = lines, []
        if prose:
            blocks.append(_prose(prose))
        if formula:
            blocks.append(fenced(inspect.cleandoc("\n" + "\n".join(formula)), "text"))
    return "\n\n".join(_joined(blocks))


def _prose(lines):
    """A paragraph; a list stays one, and so does what is aligned in columns."""
    if any(re.search(r"\S {3,}\S", line) for line in lines):
        return fenced("\n".join(lines), "text")
    return "\n".join(
        line[: len(line) - len(line.lstrip())] + ("- " + escaped(line.lstrip()[2:]))
        if line.lstrip().startswith("- ")
        else escaped(line)
        for line in lines
    )


def _joined(blocks):
    """Neighbouring formulas in one block."""
    found = []
    for block in blocks:
        if found and block.startswith("```text") and found[-1].startswith("```text"):
            found[-1] = found[-1].removesuffix("\n```") + "\n\n" + block.removeprefix("```text\n")
        else:
            found.append(block)
    return found


def fenced(text, language):
    """A block of code."""
    return f"```{language}\n{text}\n```"


def entries(text):
    """A definition list of `name : type` lines with their indented descriptions."""
    found = []
    for entry in re.split(r"\n(?=\S)", text.strip("\n")):
        head, _, rest = entry.partition("\n")
        name, colon, kind = head.partition(" : ")
        described = paragraphs(inspect.cleandoc("\n" + rest)) if rest.strip() else "..."
        indented = "\n".join(f"  {line}" if line else "" for line in described.split("\n"))
        term = f"**`{name}`**" + (f" : {escaped(kind)}" if colon else "")
        found.append(f"{term}\n: {indented.lstrip()}" if rest.strip() else f"- {term}")
    return "\n\n".join(found)


def examples(text):
    """Sessions of a section Examples, with the prose between them."""
    found = []
    for block in re.split(r"\n\s*\n", text.strip("\n")):
        session = block.lstrip().startswith(">>>")
        found.append(fenced(block, "pycon") if session else paragraphs(block))
    return "\n\n".join(found)


def page_of(text, level=2):
    """Markdown of a whole docstring, its sections as headings."""
    head, found = sections(text)
    parts = [paragraphs(head)]
    for title, body in found.items():
        write = entries if title in LISTED else examples if title == "Examples" else paragraphs
        parts.append(f"{'#' * level} {title}\n\n{write(body)}")
    return "\n\n".join(parts)
