"""Provenance of figures: machine, versions, date."""

import datetime
import platform
import subprocess
from importlib.metadata import version
from pathlib import Path

from tsdyn.measuring.benchmark import machine as line  # in one line

ROOT = Path(__file__).parents[1]


def stamp(versions=None):
    """A dictionary to begin a file of results with; versions is of contenders."""
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True)
    return {
        "date": datetime.date.today().isoformat(),
        "machine": line(),
        "system": platform.platform(),
        "commit": commit.stdout.strip(),
        "packages": {name: version(name) for name in ("numpy", "scipy", "numba", "llvmlite")},
        "contenders": versions or {},
    }
