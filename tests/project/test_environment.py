"""The page of environment variables and the code name the same ones."""

import ast
import re

from tests.helpers.documents import README
from tests.helpers.syntax import nodes, tree

ROOT = README.parent
PAGE = (ROOT / "docs" / "environment.md").read_text()


def is_environ(node):
    return isinstance(node, ast.Attribute) and node.attr == "environ" and getattr(node.value, "id", "") == "os"


def is_config(node):
    return isinstance(node, ast.Attribute) and node.attr == "config" and getattr(node.value, "id", "") == "numba"


def names(node):
    """Upper-case strings of a constant, or of a tuple of constants."""
    found = [one.value for one in getattr(node, "elts", [node]) if isinstance(one, ast.Constant)]
    return {one for one in found if isinstance(one, str) and re.fullmatch("[A-Z][A-Z_]{3,}", one)}


def read_in(file):
    """The variables that a file reads: by name, by a tuple of names in the module, or as one of Numba's settings."""
    found = set()
    for node in nodes(file):
        if isinstance(node, ast.Subscript) and is_environ(node.value):
            found |= names(node.slice)
        if isinstance(node, ast.Compare) and any(map(is_environ, node.comparators)):
            found |= names(node.left)
        if isinstance(node, ast.Call) and is_environ(getattr(node.func, "value", None)) and node.args:
            found |= names(node.args[0])
        if isinstance(node, ast.Attribute) and is_config(node.value):
            found.add(f"NUMBA_{node.attr}")
    if any(map(is_environ, nodes(file))):
        found |= {name for node in tree(file).body if isinstance(node, ast.Assign) for name in names(node.value)}
    return found


def test_the_page_lists_what_the_code_reads():
    files = [file for folder in ("tsdyn", "constraints", "integrators") for file in (ROOT / folder).rglob("*.py")]
    found = set().union(*map(read_in, files))
    assert {"TSDYN_JIT", "TSDYN_CACHE_DIR", "GZ_SIM_RESOURCE_PATH", "OMP_NUM_THREADS", "NUMBA_CACHE_DIR"} <= found
    rows = re.findall(r"^\| (`.*?`) \|", PAGE, re.MULTILINE)
    assert {name for row in rows for name in re.findall("`([A-Z_]+)`", row)} == found
