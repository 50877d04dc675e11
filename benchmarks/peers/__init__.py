"""Other engines on the same scenes, one short file each, imported where they are installed: pip install '.[peers]'.

A new one is a file with a child of `benchmarks.contender.Contender`, and a line in PEERS.
"""

from importlib import import_module

PEERS = (
    "index1.Index1",
    "pinocchio.Pinocchio",
    "mujoco.MuJoCoTree",
    "mujoco.MuJoCoConstraints",
    "exudyn.ExudynTree",
    "exudyn.ExudynConstraints",
    "ida.IDA",
    "radau.Radau",
    "heyoka.Heyoka",
    "drake.DrakeTree",
)


def contenders():
    """Make one of each, installed or not: their packages are imported when they are asked for a version."""
    made = []
    for name in PEERS:
        file, kind = name.split(".")
        made.append(getattr(import_module(f".{file}", __name__), kind)())
    return tuple(made)
