"""The scenes of the benchmarks by name, and reference solutions for their final states.

SCENES["chain of 64"].build(), .end (s), .definition() (plain data, see tsdyn.stress.rods), .reference()

Errors are the largest over positions (m) and rotation matrices at the end. References are read from tests/references
where there is a file; else two methods that share no code, or as little as can be, are refined until they agree:

    chains               kernels written by hand, Taylor series against DOP853 with projection
    other mechanisms     SciPy's DOP853 on an index-1 form (peers/index1.py) against tsdyn's default
    stiff scenes         two methods of tsdyn (`tsdyn.measuring.benchmark`)

Up to 64 bodies they are kept in benchmarks/results/references; delete a file to have it made anew.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

import tsdyn as ts
from benchmarks import stiff
from tsdyn.measuring.benchmark import Reference, agreed, poses
from tsdyn.stress import rods

KEPT = Path(__file__).parent / "results" / "references"
FOLDER = Path(__file__).parents[1] / "tests" / "references"


def of_file(name):
    """Read the definition of a reference's file."""
    return json.loads((FOLDER / f"{name}.json").read_text())["definition"]


class Benchmarked(NamedTuple):
    """A scene, and how to run it."""

    name: str
    family: str  # "top", "pendulum", "chain", "tree", "loop", "net" or "stiff"
    size: int  # bodies
    end: float  # s
    definition: (
        Callable  # () -> its plain data; None for a stiff scene, that has forces which other engines write otherwise
    )
    file: str = ""  # of its reference
    maker: Callable = None  # () -> ts.Scene where there is no definition
    steps: tuple = (1e-2, 3e-3, 1e-3, 3e-4)
    without: tuple = ()  # methods that would take minutes
    tolerances: tuple = (1e-4, 1e-6, 1e-8, 1e-10)
    max_steps: int = 40_000

    @property
    def span(self):
        """Its times, s."""
        return 0.0, self.end

    def build(self):
        """Make the ts.Scene."""
        return self.maker() if self.maker else rods.build(self.definition())

    def known(self):
        """The `Reference` of its file in tests/references, or None."""
        path = FOLDER / f"{self.file}.json"
        if not (self.file and path.exists()):
            return None
        data = json.loads(path.read_text())
        r, A = np.array(data["r"]), np.array(data["A"])
        trusted = max(10.0 ** -data["digits"], np.finfo(float).eps)
        return Reference(np.array(data["t"]), r, A.reshape(*r.shape, 3), trusted, f"tests/references/{path.name}")

    def reference(self):
        """The `Reference` of its end: one time."""
        known = self.known()
        if known is not None:
            return known._replace(t=known.t[-1:], r=known.r[-1:], A=known.A[-1:])
        path = KEPT / f"{self.name.replace(' ', '_')}.json"
        if path.exists():
            data = json.loads(path.read_text())
            return Reference(*(np.array(data[name]) for name in "trA"), data["trusted"], data["source"])
        made = self.made()
        if self.size > 64:  # a second's work, and a large file
            return made
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({k: v.tolist() if hasattr(v, "tolist") else v for k, v in made._asdict().items()}))
        return made

    def made(self):
        """Make a `Reference` of its end by two methods."""
        if self.definition is None:
            return agreed(self.build(), self.span, np.array([self.end]), self.max_steps)
        if self.family == "chain":
            from benchmarks.by_hand import contenders

            one, two = (contender.prepare(self)(1e-15) for contender in reversed(contenders.CONTENDERS))
            source = "kernels by hand: Taylor series, from which DOP853 differs by"
        else:
            from benchmarks.peers.index1 import Index1

            one = Index1().prepare(self)(1e-13)
            options = {"rtol": 1e-13, "atol": 1e-13, "t_eval": self.span, "max_steps": self.max_steps}
            two = poses(ts.simulate(self.build(), self.span, **options).raise_if_failed())
            two = one._replace(r=two[0][-1], A=two[1][-1])
            source = "SciPy's DOP853 on an index-1 form, from which tsdyn differs by"
        gap = one.error(two.r, two.A)
        trusted = max(2.0 * gap, 10.0 * np.finfo(float).eps * (1.0 + np.abs(one.r).max()))
        return Reference(np.array([self.end]), one.r[None], one.A[None], trusted, f"{source} {gap:.1e} at most")


def _file(name, family, size, end, **options):
    title = {"top": "sliding top", "pendulum": "two-body pendulum"}.get(family, f"chain of {size}")
    title += " in space" if name.endswith("spatial") else ""
    return Benchmarked(title, family, size, end, lambda: of_file(name), name, **options)


def chain(links):
    """A chain, its reference from a file where there is one."""
    without = ("ImplicitTrapezoid",) if links > 4 else ()
    name = f"chain_{links}" if links in (4, 16) else ""
    return Benchmarked(
        f"chain of {links}",
        "chain",
        links,
        1.0,
        lambda: rods.chain(links),
        name,
        steps=(1e-2, 3e-3),
        without=without,
    )


def tree(levels):
    """A binary tree."""
    size = 2**levels - 1
    return Benchmarked(f"tree of {size}", "tree", size, 1.0, lambda: rods.tree(levels))


def loop(links):
    """A chain hung from both ends."""
    return Benchmarked(f"loop of {links}", "loop", links, 1.0, lambda: rods.loop(links))


def net(meshes):
    """A square net."""
    size = 2 * meshes * (meshes + 1)
    return Benchmarked(f"net of {meshes} x {meshes}", "net", size, 0.5, lambda: rods.net(meshes, meshes))


def _stiff(name, maker):
    return Benchmarked(
        name, "stiff", 2, 5.0, None, maker=maker, steps=(), tolerances=(1e-2, 1e-3, 1e-4, 1e-6),
        max_steps=3_000_000,  # explicit methods need them
    )  # fmt: skip


CHAINS = (1, 4, 16, 64, 256, 1024)
_ALL = (
    _file("sliding_top", "top", 1, 10.0),
    _file("two_body_pendulum", "pendulum", 2, 10.0),
    _file("two_body_pendulum_spatial", "pendulum", 2, 10.0),
    *(chain(links) for links in CHAINS),
    *(tree(levels) for levels in (3, 5)),
    *(loop(links) for links in (4, 16)),
    *(net(meshes) for meshes in (2, 3)),
    _stiff("stiff joint", stiff.jointed),
    _stiff("stiff springs", stiff.hung),
)
SCENES = {scene.name: scene for scene in _ALL}
FULL = tuple(name for name, scene in SCENES.items() if scene.size <= 16)  # what fits without asking for more
