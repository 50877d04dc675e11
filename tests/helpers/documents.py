"""Pages of the documentation that are written by hand: README and docs/, without those that are made from the code."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
MADE = ("reference", "gallery")  # folders of docs/ that the build of the site writes
README = ROOT / "README.md"


def pages():
    """Files of docs/, in order."""
    found = sorted((ROOT / "docs").rglob("*.md"))
    return [file for file in found if file.relative_to(ROOT / "docs").parts[0] not in MADE]


def python_blocks(page):
    """Python of a page, and for each block the output that is printed below it, empty if there is none."""
    return re.findall(r"```python\n(.*?)```\n(?:\n```\n(.*?)```)?", page.read_text(encoding="utf-8"), re.DOTALL)
