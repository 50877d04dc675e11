"""Sphinx: the site of the documentation.

    python -m sphinx -W docs build/site

Pages of classes and of the gallery are written into docs/reference and docs/gallery before the build; notebooks are
executed by it.
"""

import json
import os
import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))  # the checkout is what is documented, in the processes of notebooks, too
os.environ["PYTHONPATH"] = os.pathsep.join([str(HERE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])

from docs import class_pages, gallery_pages  # noqa: E402
from docs.gallery import ENTRIES  # noqa: E402
from tsdyn import Scene, simulate  # noqa: E402
from tsdyn._version import __version__  # noqa: E402
from tsdyn.files.schema import schema  # noqa: E402

project = "tsdyn"
author = "The tsdyn authors"
version = release = __version__
extensions = ["myst_nb"]
exclude_patterns = ["**/.ipynb_checkpoints"]
html_theme = "furo"
html_title = f"tsdyn {version}"
html_static_path = []
html_extra_path = ["files"]  # animations of the gallery, the JSON Schema of scene files
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
suppress_warnings = ["misc.highlighting_failure"]
BESIDE = re.compile(r"\]\(((?:\.\./)+)([\w/.-]+?)(#[\w-]+)?\)")  # links to files outside docs/
PAGES = {"CONTRIBUTING.md": "/contributing.md", "CHANGELOG.md": "/changelog.md"}
PAGES |= {"examples": "/gallery/index.md"} | {f"examples/{one.name}.py": f"/gallery/{one.name}.md" for one in ENTRIES}
PAGES |= {
    class_pages.file_of(cls): f"/reference/{kind}/{cls.__name__}.md"
    for kind in class_pages.KINDS
    for cls in class_pages.classes(kind)
}


def within_site(app, name, source):
    """Lead links to files beside docs/ to the pages that show these files; write the entries of the API's pages."""

    def page(match):
        return f"]({PAGES[match[2]]}{match[3] or ''})" if match[2] in PAGES else match[0]

    source[0] = BESIDE.sub(page, source[0])
    if name.startswith("api/"):
        source[0] = class_pages.with_entries(source[0])
    if name == "index":
        source[0] = with_every_page(source[0])


def with_every_page(index):
    """The index, with pages that it doesn't name listed after plug-ins."""
    named = {line.strip() for line in index.splitlines()}
    others = [file.stem for file in sorted(HERE.glob("*.md")) if file.stem not in named | {"index"}]
    return index.replace("\nplug-ins\n", "\n" + "\n".join(["plug-ins", *others]) + "\n", 1)


def setup(app):
    """Write the pages that are made from the code."""
    class_pages.write(HERE / "reference")
    gallery_pages.write(HERE / "gallery", HERE / "files")
    (HERE / "files" / "scene.schema.json").write_text(json.dumps(schema(Scene, simulate), indent=1), encoding="utf-8")
    app.connect("source-read", within_site)
