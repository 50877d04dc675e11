"""The scenes of the benchmarks; add one here, with its file in tests/references where it has one.

SCENES["chain of 16"] = Benchmarked(build, (0.0, 5.0))                 its reference is made by ts.benchmark
Benchmarked(build, (0.0, 10.0), "sliding_top", implicit=False)         its reference is read from the checkout
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

import tsdyn as ts
from benchmarks import stiff
from examples import top, two_body_pendulum
from tsdyn.agreement import Reference

FOLDER = Path(__file__).parents[1] / "tests" / "references"


class Benchmarked(NamedTuple):
    """A scene, its span (s), its reference's file, and the fixed steps (s) that it is worth trying with."""

    build: Callable
    span: tuple
    file: str = ""
    steps: tuple = (1e-2, 3e-3, 1e-3, 3e-4)
    without: tuple = ()  # methods that would take minutes
    tolerances: tuple = (1e-4, 1e-6, 1e-8, 1e-10)
    max_steps: int = 40_000

    def reference(self):
        """Its `Reference`, or None where there is no file."""
        path = FOLDER / f"{self.file}.json"
        if not (self.file and path.exists()):
            return None
        data = json.loads(path.read_text())
        r, A = np.array(data["r"]), np.array(data["A"])
        trusted = max(10.0 ** -data["digits"], np.finfo(float).eps)
        return Reference(np.array(data["t"]), r, A.reshape(*r.shape, 3), trusted, f"tests/references/{path.name}")


def of_file(name):
    """Make the builder of the scene that a reference's file defines, the ground being body 0."""

    def build():
        definition = json.loads((FOLDER / f"{name}.json").read_text())["definition"]
        scene = ts.Scene(gravity=definition["gravity"])
        bodies = [scene.ground, *(scene.add_body(**body) for body in definition["bodies"])]
        for kind, a, b, arguments in definition["constraints"]:
            scene.add(getattr(ts.constraints, kind)(bodies[a], bodies[b], **arguments))
        for kind, a, arguments in definition.get("forces", ()):
            scene.add(getattr(ts.forces, kind)(bodies[a], **arguments))
        return scene

    return build


STIFF = {"tolerances": (1e-2, 1e-3, 1e-4, 1e-6), "max_steps": 3_000_000}  # explicit methods need them
SCENES = {
    "sliding top": Benchmarked(top.build, (0.0, 10.0), "sliding_top"),
    "two-body pendulum": Benchmarked(two_body_pendulum.build, (0.0, 10.0), "two_body_pendulum"),
    "two-body pendulum in space": Benchmarked(
        lambda: two_body_pendulum.build(((0.3, 0.0, 0.0), (1.0, 5.0, 2.0))), (0.0, 10.0), "two_body_pendulum_spatial"
    ),
    "chain of 4": Benchmarked(of_file("chain_4"), (0.0, 1.0), "chain_4"),
    "chain of 16": Benchmarked(of_file("chain_16"), (0.0, 1.0), "chain_16", (1e-2, 3e-3), ("ImplicitTrapezoid",)),
    "stiff joint": Benchmarked(stiff.jointed, (0.0, 5.0), steps=(), **STIFF),
    "stiff springs": Benchmarked(stiff.hung, (0.0, 5.0), steps=(), **STIFF),
}
