"""What a run counts, for `Solution.stats`."""

from collections.abc import Mapping
from operator import attrgetter

_READ = {
    "steps": attrgetter("numbers.steps"),
    "rejected": attrgetter("numbers.rejected"),
    "evaluations": attrgetter("counters.evaluations"),
    "placements": attrgetter("counters.placements"),
    "newton_iterations": attrgetter("counters.newton"),
    "b_iterations": attrgetter("counters.b_iterations"),
    "charts": attrgetter("counters.charts"),
    "factorizations": attrgetter("counters.factorizations"),
    "stiff": lambda of: bool(of.numbers.stiff),
    "steps_near_singular": attrgetter("numbers.near_steps"),
    "largest_landing": attrgetter("largest_landing"),
    "jacobians": attrgetter("counters.jacobians"),
    "iteration_matrices": attrgetter("counters.iteration_matrices"),
    "stage_iterations": attrgetter("counters.stage_iterations"),
    "solves_skipped": attrgetter("counters.at_rounding"),
    "checks_skipped": attrgetter("counters.unverified"),
    "factorizations_skipped": lambda of: (
        of.counters.kept + of.counters.stage_iterations - of.counters.iteration_matrices
    ),
    "gyroscopic_skipped": lambda of: of.skipped[0] * of.counters.evaluations,
    "rotations_skipped": lambda of: of.skipped[1] * of.counters.evaluations,
    "columns_skipped": lambda of: of.skipped[2] * of.counters.evaluations,
    "forces_skipped": lambda of: 0 if of.has_forces else of.counters.evaluations,
}
NAMES = tuple(_READ)


class Counts(Mapping):
    """The counts of a run by name, each read from its records when it is asked for.

    Parameters
    ----------
    numbers : Numbers
    counters : Counters
        Both at the end of the run, and of its own.
    largest_landing : float, m
    skipped : tuple of int
        What each evaluation skips: torques of bodies with spherical inertia, rotations of bodies that never turn,
        constant columns of markers.
    has_forces : bool
    """

    def __init__(self, numbers, counters, largest_landing, skipped, has_forces):
        self.numbers, self.counters, self.largest_landing = numbers, counters, largest_landing
        self.skipped, self.has_forces = skipped, has_forces

    def __getitem__(self, name):
        return _READ[name](self)

    def __iter__(self):
        return iter(_READ)

    def __len__(self):
        return len(_READ)
