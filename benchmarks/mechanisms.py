"""Mechanisms of `tsdyn.stress.rods`: plain data, read by tsdyn, by kernels by hand and by other engines.

`of_file` reads the definition of a file of tests/references, in the same form.
"""

import json
from pathlib import Path

from tsdyn.stress.rods import FAR, GRAVITY, HALF, NEAR, build, chain, hub, loop, net, tree

FOLDER = Path(__file__).parents[1] / "tests" / "references"


def of_file(name):
    """Read the definition of a reference's file."""
    return json.loads((FOLDER / f"{name}.json").read_text())["definition"]


__all__ = ["FAR", "FOLDER", "GRAVITY", "HALF", "NEAR", "build", "chain", "hub", "loop", "net", "of_file", "tree"]
