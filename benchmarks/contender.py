"""The interface of a contender: it runs a scene to its end at a tolerance or step size and reports the time."""

import time
from importlib import import_module
from importlib.metadata import version
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

clock = time.perf_counter  # of `timed`


class Outcome(NamedTuple):
    """A run's end; b bodies."""

    seconds: float  # of the run alone, without building, compiling or reading results
    r: np.ndarray  # (b, 3), m
    A: np.ndarray  # (b, 3, 3), body to ground

    def error(self, r, A):
        """The largest difference from a reference over positions (m) and rotation matrices; nan counts as inf."""
        off = max(np.abs(self.r - r).max(), np.abs(self.A - A).max())
        return float(off) if np.isfinite(off) else np.inf


class Contender:
    """One engine or method; a subclass of it is one short file or less.

    Attributes
    ----------
    name : str
    setting : str
        "tolerance" or "step" (s).
    values : tuple of float
        What is worth trying, the cheapest first.
    package : str
        The module that it runs, installed from the registry.
    largest : int
        The largest scene with a definition of its own that it runs, in bodies.
    calls : int
        How many short runs a sample is the median of.
    get : str
        How to get what it needs.
    """

    name = ""
    setting = "tolerance"
    values = tuple(10.0**-k for k in range(2, 15))
    package = ""
    largest = 0
    calls = 9
    get = ""

    def version(self):
        """What of which version runs, as text; raises ImportError (or OSError) where it isn't there."""
        if not self.package:
            return ""
        import_module(self.package)
        return f"{self.package} {version(self.package.replace('_', '-'))}"

    def missing(self):
        """Return a line that says how to get it, empty where it is there."""
        try:
            self.version()
        except (ImportError, OSError) as error:
            return f"{self.name} is left out: {self.get} ({error})"
        return ""

    def serves(self, scene):
        """Whether it can run a scene, a `scenes.Benchmarked`."""
        return scene.definition is not None and scene.size <= self.largest

    def prepare(self, scene):
        """Build the scene; return run(value) -> Outcome, which may be called again and again.

        It raises RuntimeError, or a child of it, where a run doesn't reach its end.
        """
        raise NotImplementedError


def timed(call, *arguments, **options):
    """Seconds that a call takes by `clock`, and what it returns."""
    started = clock()
    result = call(*arguments, **options)
    return clock() - started, result


def rotation(p):
    """Rotation matrices (b, 3, 3) of Euler parameters (b, 4), scalar first, of any length."""
    return Rotation.from_quat(np.roll(p, -1, axis=-1)).as_matrix()
