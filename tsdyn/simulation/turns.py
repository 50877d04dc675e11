"""Turns of the default method: from its explicit method to the implicit one where the motion is stiff, and back.

Each goes on from where the other stands. Work for a second of motion decides, in evaluations, and after numbers of
steps: no clock. The explicit method turns where it finds the motion stiff (runs/step_control.py, taylor/stepper.py).
What the implicit method takes more than the explicit one would have taken for the same motion is lost: fast modes have
to be followed until they have decayed. It turns back where more is lost than a share of what the explicit method would
take for the rest. Otherwise the explicit one is tried for some steps, at growing intervals, and earlier where the
derivatives of the forces had to be taken anew: as long as old ones serve, the motion is as stiff as it was. With
friction of joints, where none is at rest.
"""

import math
from functools import cached_property

from ..ahead.first_run import prepare_first_run
from ..integrators import SDIRK54, Radau, Taylor
from ..methods.integrator import frozen
from ..validation import demand_numbers
from .tolerances import (
    AGAIN,
    COST,
    FIRST_WINDOW,
    LOOSEST,
    PATIENCE,
    RESTING,
    RISKED,
    SERIES_COST,
    SETTLED,
    SHARP_COST,
    STEP_EVALUATIONS,
    STIFF_SAFETY,
    TRIAL,
    TRIED,
)

KEPT = "known", "patience", "taken", "tried", "ask", "window", "jacobians", "began", "lasted", "lost", "most_lost"


def implicit(method, prepared, form):
    """Return the implicit method of the same tolerances: Radau, or SDIRK54 where all stages at once aren't served."""
    coupled = form.basis_free and not prepared.rough
    most = LOOSEST if coupled and prepared.sharp else math.inf
    found = (Radau if coupled else SDIRK54)(min(method.rtol, most), min(method.atol, most), max_step=method.max_step)
    if not coupled:
        found.safety = STIFF_SAFETY
    return frozen(found)


class Turns:
    """The turns of one run.

    Parameters
    ----------
    scene : Scene
    prepared : Prepared
        Of the scene.
    method : Integrator
        The explicit method.
    form : Formulation
    span : (float, float), s
    within : bool
        Whether output between the ends of steps is requested.

    Attributes
    ----------
    ask : int
        Steps of the segment after which it is asked; of an explicit method not before it has found the motion stiff.
    """

    ask = 0
    known = 0.0  # work of the method before for a second of motion
    patience = PATIENCE  # implicit steps before the explicit method is tried
    taken, tried = 0, False  # explicit steps so far; whether the explicit method is on trial
    jacobians = 0  # of the implicit method's first steps
    began = lasted = 0.0  # s: of the segment, and length of the one before
    lost = most_lost = 0.0  # work, by the implicit method, since it was last even; the most so far

    def __init__(self, scene, prepared, method, form, span, within):
        self.scene, self.prepared, self.method = scene, prepared, method
        self.form, self.end, self.within = form, span[1], within
        self.window = span[0], 0.0  # where the steps that are judged begin: time, work

    @cached_property
    def implicit(self):
        """The implicit method."""
        return implicit(self.method, self.prepared, self.form)

    @cached_property
    def _cost(self):
        """Of an evaluation by the implicit method."""
        return SERIES_COST if isinstance(self.method, Taylor) else COST

    @cached_property
    def _first(self):
        """Steps of the implicit method over which work is measured first."""
        return RESTING if self.prepared.slips else FIRST_WINDOW

    @cached_property
    def _step(self):
        """Work of a step of the explicit method."""
        series = isinstance(self.method, Taylor)
        return self.method.stages * (SHARP_COST if series and self.prepared.sharp else 1.0)

    def begin(self, to_implicit, t, turned):
        """A segment begins at t: after a turn, or after a singular configuration."""
        self.window, self.ask = (t, 0.0), self._first if to_implicit else FIRST_WINDOW
        if to_implicit:
            prepare_first_run(self.scene, self.implicit, self.form, self.within, None)
        elif not self.tried:
            self.ask = FIRST_WINDOW if self.prepared.slips else (AGAIN - 1) * self.taken
        if turned:
            self.lasted, self.began = t - self.began, t

    def turns(self, memory):
        """Whether the run turns to the other method where its memory is."""
        run = memory.run
        steps, t = run.numbers.steps, run.clock.t
        if steps < self.ask:
            return False
        to_explicit = memory.engine.method.implicit
        work = self._cost * memory.work.counters.evaluations if to_explicit else self._step * steps
        (before, done), self.window = self.window, (t, work)
        rate = (work - done) / (t - before) if t > before else 0.0
        if to_explicit:
            self.lost = max(self.lost + (work - done) - self.known * (t - before), 0.0)
            self.most_lost = max(self.most_lost, self.lost)
            return self._back(memory, steps, min(rate, work / steps / run.clock.h))
        if self.tried:
            return self._tried(steps, rate)
        return bool(run.numbers.stiff) and self._to_implicit(run, steps, t, max(rate, self._step / run.clock.h))

    def _to_implicit(self, run, steps, t, ours):
        """Whether the implicit method is to go on where the explicit one takes `ours` for a second; not for little."""
        self.ask = AGAIN * steps
        if run.numbers.at_limit == 0 or not self._pays(ours, t):
            return False
        self.known, self.taken = ours, self.taken + steps
        if self.lasted > 0.0:  # the implicit method has been left for longer than it had lasted, or in vain
            longer = self.prepared.slips or t - self.began > self.lasted
            self.patience = PATIENCE if longer else AGAIN * self.patience
        return True

    def _pays(self, rate, t):
        """Whether what is left at this rate is worth a turn."""
        return rate * (self.end - t) > self._cost * TRIAL * STEP_EVALUATIONS

    def _back(self, memory, steps, rate):
        """Whether the explicit method is to go on: it would take less work for the rest, or is to be tried.

        A trial may cost as much as was lost before: steps at the limit of stability keep fast modes alive.
        """
        left, rough = self.end - memory.run.clock.t, self.prepared.rough
        jacobians = memory.work.counters.jacobians
        if steps <= self._first:
            self.jacobians = jacobians
        may_pay = memory.run.numbers.still == 0 if rough else jacobians > self.jacobians
        may_win = rough or (rate <= self.known and RISKED * rate * left > self.most_lost)
        patience = self.patience if may_pay else AGAIN * self.patience
        self.tried = steps >= patience and may_win and self._pays(rate, memory.run.clock.t)
        if self.tried:
            self.known = rate
        later = steps + PATIENCE if rough else 2 * steps
        self.ask = later if steps >= self.patience else min(later, self.patience)
        dear = rate > max(SETTLED / steps, 1.0) ** 2 * self.known
        return bool(self.tried or (dear and (rough or self.lost > RISKED * self.known * left)))

    def _tried(self, steps, rate):
        """Whether the explicit method, after some steps, has failed to take less work."""
        self.ask = 2 * steps
        if steps < TRIED and rate < AGAIN * self.known:
            return False
        self.tried = False
        if rate < self.known:
            self.ask = 0
            return False
        self.patience, self.taken, self.known = AGAIN * self.patience, self.taken + steps, rate
        return True

    def saved(self):
        """Its state, for a checkpoint."""
        return {name: getattr(self, name) for name in KEPT}

    def restore(self, numbers):
        """As it was when it was saved."""
        window = numbers["window"]
        demand_numbers(numbers | dict(zip(("window", "work"), window, strict=True)), (*KEPT, "work"))
        vars(self).update(numbers)
