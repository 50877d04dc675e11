"""Event functions that are evaluated together, such as the gaps of contacts: most need no search in a step."""

import math
from typing import NamedTuple

import numpy as np

from ..maths.root_isolation import survey
from .group_search import ARRIVED, GO_ON, GroupSearch, move
from .tolerances import FALLEN, FROM_REST, ROOT_STEPS

# A group is surveyed on a step at once (root_isolation.survey). Of the members that cross zero the earliest is located,
# by the interpolant and Newton's method; the others are surveyed again up to there. Where a kernel evaluates the
# functions, one call does so (group_search.py). Only members whose zeros are unclear are searched one by one, as events
# of users are.


class States(NamedTuple):
    """What a group's function is given: k states."""

    t: np.ndarray  # (k,)
    levels: np.ndarray  # (k, 3, n)  q, qd, qdd
    memory: np.ndarray  # what forces remember
    counted: object  # a function that returns the counted angles (k, angles) of joints

    q, qd, qdd = (property(lambda self, i=i: np.ascontiguousarray(self.levels[:, i])) for i in range(3))


class GroupMember:
    """One of several event functions that are evaluated together.

    Parameters
    ----------
    over : function
        Values (k, members) of a `States`.
    which : int
        The function's number.
    """

    def __init__(self, over, which):
        self.over, self.which = over, which

    def __call__(self, t, instant):
        """The value at one state."""
        levels = np.array([[instant.q, instant.qd, instant.qdd]])
        states = States(np.array([t]), levels, instant.memory, lambda: instant.angles[None])
        return float(self.over(states)[0, self.which])


class Group:
    """Events whose functions are evaluated by one function.

    Parameters
    ----------
    over : function
    events : list of Event
        All of the run.
    numbers : list of int
        Of its own.
    spins, n, angles
        As of `GroupSearch`.

    Attributes
    ----------
    kernel : GroupSearch
        None where no kernel evaluates the functions.
    beside : ndarray (members,)
        Which members vanish with the first event that was found; None where that is unknown.
    value, noise, least : ndarray (members,)
        At the end of the last step; rounding error of values, once measured; that which is known beforehand.
    is_new : bool
        Whether no step has been searched since the start.
    """

    def __init__(self, over, events, numbers, spins, n, angles):
        self.over, self.numbers, self.degree = over, numbers, 0
        own = [events[i] for i in numbers]
        self.which = [event.function.which for event in own]
        source = getattr(over, "__self__", None)
        known, kernel = (getattr(source, name, None) for name in ("noise", "kernel"))
        self.least = np.zeros(len(own)) if known is None else known[self.which]
        self.value, self.noise = np.zeros(len(own)), np.zeros(len(own))
        self._odd = np.zeros(len(own), int)  # 1 where the `Track` knows more than the value
        # Those that survey and Newton's method serve: changes in one direction end the run
        self._exact = [event.exact for event in own]
        self._may_fall = np.array([event.falls for event in own])
        self._some_may_fall = self._may_fall.any()
        self._falls = np.array([event.direction if event.limit == 1.0 else 0.0 for event in own])
        self.kernel = self.beside = None
        if kernel is not None and all(self._exact) and not self._some_may_fall:
            known = self.value, self.noise, self._odd
            self.kernel = GroupSearch(kernel, self.which, self._falls, known, spins, n, angles)

    def begin(self, values):
        """Take the values (members,) at the start of a run."""
        self.value[:], self.noise[:], self._odd[:], self.is_new = values, self.least, 0, True

    def cross(self, values):
        """Take values (members,) after a stop; the numbers of those that end the run since they have changed sign."""
        clear = np.abs(values) > self.noise
        ends = clear & (self._falls * self.value < 0.0) & (self._falls * values > 0.0)
        self.value[:] = values
        self._odd[clear] = 0
        return [self.numbers[i] for i in ends.nonzero()[0].tolist()]

    def lend(self, track, i, t):
        """Let the `Track` of member i know what is known at t, the start of the step that has been searched."""
        value = float(self._first[i])
        if self._odd[i]:
            track.value = track.end = value
        else:
            track.begin(t, value, not self._was_new or (self._exact[i] and value > 0.0))
            track.noise = float(self.noise[i])

    def least_noise(self, number):
        """Of an event of its own: the rounding error of values that is known beforehand."""
        return float(self.least[self.numbers.index(number)])

    def take_back(self, track, i):
        """Take what a `Track` knows at the end of a step."""
        self.value[i], self.noise[i] = track.value, track.noise
        self._odd[i] = track.zero is not None or not track.sign * track.value > 0.0

    def lend_all(self, tracks, t):
        """Let all tracks know what is known at t, the end of a step."""
        self._first, self._was_new = self.value.copy(), self.is_new
        for i, number in enumerate(self.numbers):
            self.lend(tracks[number], i, t)

    def take_all(self, tracks):
        """Take what all tracks know at the end of a step."""
        self.begin(np.zeros(len(self.numbers)))
        self.is_new = False
        for i, number in enumerate(self.numbers):
            self.take_back(tracks[number], i)

    def _fallen(self, samples, left):
        """A member, of those `left`, that falls from zero within rounding at the start, or None."""
        scale = np.abs(samples).max(initial=0.0)
        zero = self._may_fall[left] & (np.abs(samples[0]) <= FROM_REST * scale)
        falls = zero & (samples.max(axis=0) <= FROM_REST * scale) & (samples[-1] < -FALLEN * scale)
        return int(left[falls.argmax()]) if falls.any() else None

    def search_by_kernel(self, step):
        """As `search`; None where the kernel is unsure, or there is none."""
        found = None if self.kernel is None else self.kernel.find(step)
        if found is None:
            return None
        self.is_new, self.beside = False, self.kernel.parts.beside
        return (None if found < 0 else (self.numbers[found], self.kernel.numbers.t)), []

    def search(self, step, sample, degree):
        """The first event that ends the run, (number, t) or None; members to be searched one by one, up to there.

        Parameters
        ----------
        step : Inside
        sample : function
            Values (k, members) at times (k,) within the step.
        degree : function
            The least degree of interpolants on a time, s.
        """
        self._first, self._was_new, self.is_new = self.value.copy(), self.is_new, False
        found, last, least, self.beside = None, self.value.copy(), degree(step.t1 - step.t0), None
        alone, left, end = {}, np.arange(len(last)), step.t1
        while left.size:
            whole = left.size == len(last)
            values, noise = self.value[left], self.noise[left]
            own = sample if whole else lambda times, left=left: sample(times)[:, left]
            seen = survey(own, step.t0, values, end, max(least, self.degree // 2), noise)
            self.degree, last[left] = seen.degree, seen.samples[-1]
            if self._was_new and self._some_may_fall and (fallen := self._fallen(seen.samples, left)) is not None:
                return (self.numbers[fallen], step.t0), []
            unclear = self._unclear(seen, left)
            if not unclear:
                alone = {}
                break
            falls = (self._falls[left] * values < 0.0) & (self._odd[left] == 0)
            roots = {j: seen.root(j) for j, since in unclear.items() if seen.until[j] > since and falls[j]}
            first = roots and _earliest(own, seen, roots)
            alone = {int(left[j]): since for j, since in unclear.items() if j not in roots or first is None}
            if not first:
                break
            # What was unclear may be clear up to there
            j, end = first
            found = self.numbers[left[j]], end
            left = np.array([i for i, since in alone.items() if since < end], int)
        self.value[:] = last
        return found, [i for i, since in alone.items() if since < end]

    def _unclear(self, seen, left):
        """Of the members `left` those that may have a zero, and up to which time they have none."""
        unclear = {j: since for j, since in enumerate(seen.since) if since < math.inf}
        # What a `Track` knows of zeros is of no interest where the member is clear, on the side that it falls from
        for j in self._odd[left].nonzero()[0].tolist():
            if j in unclear or not self._falls[left[j]] * seen.samples[-1, j] < 0.0:
                unclear.setdefault(j, seen.a)
            else:
                self._odd[left[j]] = 0
        # Values of known rounding alone have no zero
        least = self.least[left]
        if unclear and least.any():
            quiet = (np.abs(seen.samples).max(axis=0) <= least).tolist()
            unclear = {j: since for j, since in unclear.items() if not quiet[j]}
        return unclear


def _earliest(sample, seen, roots):
    """Which function of a `Survey` crosses zero first, and when; None if unsure. roots: (t, slope) by their numbers."""
    j, marks = min(roots, key=roots.__getitem__), np.full((len(seen.since), 4), math.nan)
    for k, root in roots.items():
        marks[k] = seen.since[k], seen.until[k], *root
    step = np.array([j, roots[j][0], math.inf])
    for _ in range(ROOT_STEPS):
        found = move(sample(step[1:2])[0], marks, seen.b - seen.a, step)
        if found != GO_ON:
            return (int(step[0]), float(step[1])) if found == ARRIVED else None
    return None
