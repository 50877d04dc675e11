"""The phases of a profiled run, from the readings of a `Timekeeper` and from micro-benchmarks of its parts."""

from __future__ import annotations

from typing import NamedTuple

from . import timers as role


class Phase(NamedTuple):
    """A part of a call: group, name, number of calls, total time in s."""

    group: str
    part: str
    calls: int
    seconds: float

    @property
    def each(self) -> float:
        """Seconds per call; nan without calls."""
        return self.seconds / self.calls if self.calls else float("nan")


class _Times:
    """Sums over entries."""

    def __init__(self, entries, kinds):
        self.entries, self.kinds = entries, kinds

    def of(self, *roles, within=None):
        """Return calls and exclusive seconds of roles."""
        found = [e for e in self.entries if e.role in roles and within in (None, e.within)]
        return sum(e.calls for e in found), sum(e.seconds for e in found)

    def rows(self, group, *within):
        """The phases of constraints and of forces that have run within roles."""
        constraints, forces = [], {}
        for e in self.entries:
            if e.role == role.ROWS and e.within in within:
                kind = self.kinds[e.kind]
                (forces.setdefault(kind.label, []) if kind.force else constraints).append(e)
        found = [("constraint rows", constraints), *((f"force: {label}", some) for label, some in forces.items())]
        return [
            Phase(group, part, sum(e.calls for e in some), sum(e.seconds for e in some)) for part, some in found if some
        ]

    def orders(self):
        """Seconds of each order of series, its loops over constraints and forces with the share that all have."""
        own = {e.order: (e.calls, e.seconds) for e in self.entries if e.role == role.EXPAND}
        return [own[order] for order in sorted(own)]


def of_steps(entries, kinds, prices, stats):
    """The phases of a method that goes step by step."""
    t = _Times(entries, kinds)
    (placed, place), (evaluated, accelerate) = t.of(role.PLACE), t.of(role.ACCELERATE)
    _, complete = t.of(role.COMPLETE)
    of_place, of_evaluation = _Purse(place), _Purse(accelerate + complete)
    free = "system" in prices
    n_velocity, velocity = evaluated, of_evaluation.take(evaluated, prices["velocities"])
    factored = []
    if free and stats.factorizations:
        n_normal = max(stats.factorizations - placed - stats.charts, 0)
        factored = [
            Phase("positions", "factors of Phi_q U", n_normal, of_place.take(n_normal, prices["normal"])),
            Phase("accelerations", "factors of Phi_q W Phi_q^T", placed, of_place.take(placed, prices["system"])),
        ]
    elif not free:
        factored = [Phase("accelerations", "D^T M D and its factors", placed, of_place.take(placed, prices["mass"]))]
    found = [
        *t.rows("positions", role.PLACE),
        *factored,
        Phase("positions", "corrections" if free else "corrections, B and D", placed, of_place.left),
        Phase("velocities", "freed of what leaves the constraints" if free else "qd = D vd", n_velocity, velocity),
        *t.rows("accelerations", role.ACCELERATE),
        Phase("accelerations", "bodies and solves", evaluated, of_evaluation.left),
        *t.rows("charts", role.CHART, role.CHECK),
        Phase("charts", "made", *t.of(role.CHART)),
        Phase("charts", "looked at", *t.of(role.CHECK)),
        *t.rows("stage equations", role.LINEARISE, role.REDUCE, role.RESIDUAL),
        Phase("stage equations", "Jacobians", *t.of(role.LINEARISE)),
        Phase(
            "stage equations",
            "iteration matrices",
            t.of(role.FACTORISE, role.FACTORISE_STAGES)[0],
            t.of(role.REDUCE, role.FACTORISE, role.FACTORISE_STAGES)[1],
        ),
        Phase("stage equations", "positions, velocities and loads", *t.of(role.RESIDUAL)),
        Phase("stage equations", "solves", *t.of(role.SOLVE, role.CORRECT, role.BALANCE, role.SOLVE_STAGES)),
        Phase("stage equations", "norms of corrections", *t.of(role.NORM, role.DISTANCE, within=role.STEP)),
        Phase("steps", "sums over stages", *t.of(role.STEP)),
        *t.rows("steps", role.DRIVER),
        Phase(
            "steps",
            "error norms",
            t.of(role.NORM, within=role.DRIVER)[0],
            t.of(role.NORM, role.SOFTEN, within=role.DRIVER)[1],
        ),
        Phase("steps", "control and records", stats.steps + stats.rejected, t.of(role.DRIVER)[1]),
    ]
    return _sorted(found)


def of_series(entries, kinds, prices, stats):
    """The phases of a Taylor run."""
    t = _Times(entries, kinds)
    landings, landing = t.of(role.REACH)
    purse = _Purse(landing)
    found = [
        *t.rows("coefficients", role.EXPAND),
        Phase("coefficients", "bodies and solves", *t.of(role.EXPAND)),
        *t.rows("landing", role.REACH),
        Phase("landing", "factors", stats.factorizations, purse.take(stats.factorizations, prices["system"])),
        Phase("landing", "series summed, corrections", landings, purse.left),
        *t.rows("steps", role.DRIVER),
        Phase("steps", "lengths and records", stats.steps + stats.rejected, t.of(role.DRIVER)[1]),
    ]
    return _sorted(found)


def orders(entries):
    """(calls, seconds) of each order of a Taylor run, from zero, without its loops over constraints and forces."""
    return tuple(_Times(entries, ()).orders())


class _Purse:
    """A total of seconds from which known parts are taken."""

    def __init__(self, seconds):
        self.left = max(seconds, 0.0)

    def take(self, calls, price):
        """Take the time of some calls, at most the remainder."""
        spent = min(calls * price, self.left)
        self.left -= spent
        return spent


def _sorted(found):
    """Return the phases that ran, by groups; subtraction of timer costs may have made some negative."""
    groups = list(dict.fromkeys(phase.group for phase in found))
    kept = [phase._replace(seconds=max(phase.seconds, 0.0)) for phase in found if phase.calls]
    return sorted(kept, key=lambda phase: groups.index(phase.group))


def duration(seconds):
    """Seconds with a unit, three digits."""
    for scale, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
