"""Pinocchio in C++: its articulated-body algorithm with DOP853, in minimal coordinates; see pinocchio.cpp.

The driver is compiled once, for two minutes, with CXX and CXXFLAGS if they are set, where `pip install pin cmeel-eigen`
has brought the headers.
"""

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.integrate._ivp import dop853_coefficients as coefficients

from ..contender import Contender, Outcome
from .tree import is_tree, tree

SOURCE = Path(__file__).with_suffix(".cpp")
BUILD = Path(__file__).parent / "build"
DEFINED = (  # as Pinocchio's own CMake target has them; only headers are used, so that -march=native is safe
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
)  # fmt: skip


def prefix():
    """Where headers and libraries are; ImportError if they aren't."""
    found = importlib.util.find_spec("cmeel")
    for place in found.submodule_search_locations if found else ():
        folder = Path(place).parent / "cmeel.prefix"
        if (folder / "include" / "pinocchio").exists() and (folder / "include" / "eigen3").exists():
            return folder
    raise ImportError("no headers of Pinocchio and Eigen")


def header():
    """DOP853's coefficients as C++."""
    n = coefficients.N_STAGES

    def row(values):
        return "{" + ", ".join(f"{float(value):.17g}" for value in values) + "}"

    lines = [f"constexpr int STAGES = {n};", f"const double A[{n}][{n}] = {{"]
    lines += [f"  {row(values[:n])}," for values in coefficients.A[:n]] + ["};"]
    for name in ("B", "E3", "E5"):
        lines.append(f"const double {name}[{n}] = {row(getattr(coefficients, name)[:n])};")
    return "\n".join(lines) + "\n"


def driver():
    """The compiled driver's path, built if it isn't there yet; ImportError or OSError where it can't be."""
    folder = prefix()
    compiler = os.environ.get("CXX") or shutil.which("g++") or shutil.which("clang++")
    if not compiler:
        raise OSError("no C++ compiler")
    flags = os.environ.get("CXXFLAGS", "-O3 -march=native -DNDEBUG").split()
    text = SOURCE.read_text() + header() + str(folder) + " ".join([compiler, *flags])
    program = BUILD / f"pinocchio-{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    if program.exists():
        return program
    BUILD.mkdir(exist_ok=True)
    print(f"compiling {SOURCE.name}, once, for some minutes", file=sys.stderr)
    with tempfile.TemporaryDirectory(dir=BUILD) as temporary:
        (Path(temporary) / "dop853.h").write_text(header())
        made = Path(temporary) / "driver"
        command = [
            compiler, "-std=c++17", *flags, *DEFINED, f"-I{temporary}", f"-I{folder / 'include'}",
            f"-I{folder / 'include' / 'eigen3'}", str(SOURCE), "-o", str(made),
        ]  # fmt: skip
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode:
            fault = next((line for line in result.stderr.splitlines() if "error" in line), "no word why")
            raise OSError(f"the driver doesn't compile: {fault}")
        made.rename(program)
    return program


class Pinocchio(Contender):
    """Trees; DOP853 by the same rules as in by_hand/dop853.py."""

    name = "Pinocchio (C++), DOP853"
    calls = 1  # the driver makes its own
    get = "pip install pin cmeel-eigen, and a C++ compiler"

    def version(self):
        """The package's."""
        from importlib.metadata import PackageNotFoundError, version

        driver()
        try:
            return f"Pinocchio {version('libpinocchio')}"
        except PackageNotFoundError:
            return f"Pinocchio {version('pin')}"

    def serves(self, scene):
        """Trees of up to 64 bodies.

        In chains of 80 and more its accelerations have no digit left, and its workspace grows as N^3: 16 GB for 200.
        """
        return is_tree(scene) and scene.size <= 64

    def prepare(self, scene):
        """Write the mechanism for the driver."""
        program, definition = driver(), scene.definition()
        joints, on, frames = tree(definition)
        kinds = {"slide": 0, "hinge": 1, "ball": 2}
        lines = [[scene.end], definition["gravity"], [len(joints)]]
        for joint in joints:
            lines += [[kinds[joint.kind], joint.parent, joint.mass], joint.turn.ravel(), joint.place, joint.centre]
            rate = joint.rate if joint.kind == "ball" else [joint.rate, 0.0, 0.0]
            lines += [joint.inertia.ravel(), rate]
        lines.append([len(on)])
        lines += [[i, *joints[i].centre] for i in on]
        forces = definition.get("forces", ())
        lines.append([len(forces)])
        lines += [[on[body - 1], *joints[on[body - 1]].centre, *given["force"]] for _, body, given in forces]
        text = "\n".join(" ".join(repr(float(x)) if isinstance(x, float) else str(x) for x in row) for row in lines)
        frames = np.array(frames)

        def run(tol):
            with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
                file.write(text + "\n")
                file.flush()
                command = [str(program), file.name, repr(tol), "5"]
                result = subprocess.run(command, capture_output=True, text=True)
            if result.returncode:
                raise RuntimeError(f"the driver ended with {result.returncode}")
            first, *rows = result.stdout.splitlines()
            poses = np.array([row.split() for row in rows], float)
            # a joint's matrix times the turn of the body's frame
            return Outcome(float(first.split()[0]), poses[:, :3], poses[:, 3:].reshape(-1, 3, 3) @ frames)

        return run
