"""A run that is stopped at its first checkpoint and goes on from there."""

from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..simulation.prepared_run import Run
from ..simulation.resume import resume
from ..simulation.run_options import OF_CALL, OF_RUN, RunOptions
from ..simulation.simulate import simulate

SELDOM = 1e9  # s between checkpoints: the first, after a slice, is the only one


class _Stop:
    """Ctrl-C as soon as there is a checkpoint: after the first slice, or a later one where the first ends a segment."""

    def __init__(self, path):
        self.checkpoint = Path(f"{path}.checkpoint")

    def __call__(self, fraction):
        if self.checkpoint.exists():
            raise KeyboardInterrupt


def resumed_is_same(scene, span, solution, **options):
    """Whether such a run has the bits of `solution`, which was never stopped; None without h5py."""
    if find_spec("h5py") is None:
        return None
    with TemporaryDirectory() as folder:
        path = f"{folder}/run.h5"
        simulate(scene, span, progress=_Stop(path), store=path, checkpoint=SELDOM, **options)
        return same_bits(solution, resume(path, scene=scene))


def prepared_twice(scene, span, **options):
    """As `simulate`, by the second run of a prepared one."""
    prepared = Run(scene, RunOptions(**{name: value for name, value in options.items() if name in OF_RUN}))
    of_call = {name: value for name, value in options.items() if name in OF_CALL}
    prepared(span, **of_call)
    return prepared(span, **of_call)


def same_bits(one, two):
    """Whether two solutions have the same outputs to the bit."""
    pairs = [(getattr(one, name), getattr(two, name)) for name in ("t", "q", "qd", "qdd")]
    return all(np.array_equal(*pair) for pair in pairs)
