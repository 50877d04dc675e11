"""Names that are in use by nothing else."""

from itertools import chain, count


def fresh(name, taken):
    """The name, or with a number behind it where it is taken."""
    return next(one for one in chain([name], (f"{name} {i}" for i in count(2))) if one not in taken)
