"""The search of a step for the first zero of event functions that a kernel evaluates: one call a step."""

import math
from typing import NamedTuple

import numpy as np

from ..jit.kernels import Record, callback, caller, data_of, entry, kernel, loader, matrix, resident, seen, twin
from ..maths.dense_linalg import copy, is_finite
from ..maths.root_isolation import CHECK, FINE, LARGEST, LOWEST, kernel_table, kernel_tables, look
from ..model.laws import interrupts_answered
from .dense_output import OTHER_CHART, SAME_STEP, WHOLE, read_one
from .tolerances import (
    DISTANT,
    EARLY,
    FROM_REST,
    MOST_SURVEYS,
    ROOT,
    ROOT_STEPS,
    ROUGH_ROOT,
    SAME_INSTANT,
    SHORTLY,
    SHOWN_TURN,
    SMOOTH,
    STEADY,
)

# Newton's method for the function of a survey that crosses zero first.

GO_ON, ARRIVED, UNSURE = 0, 1, 2


@kernel
def _move(values, marks, width, step):
    furthest, k = -math.inf, -1
    for j in range(values.size):
        back = values[j] / marks[j, 3]
        if back > furthest:
            furthest, k = back, j
    if k < 0:
        return UNSURE
    before = step[2] if k == int(step[0]) else math.inf
    # The last digit, or rounding of the values: no step is shorter
    size, t = abs(furthest), step[1] - furthest
    arrived = size <= ROOT * abs(step[1]) or (size >= 0.5 * before and size < ROUGH_ROOT * width)
    step[0], step[1], step[2] = k, t, size
    if not marks[k, 0] <= t <= marks[k, 1]:
        return UNSURE
    return ARRIVED if arrived else GO_ON


@entry("vmdv")
def move(values, marks, width, step):
    """One step of Newton's method, by values (m,) at its time. Return GO_ON, ARRIVED or UNSURE.

    step (3,): the function, time and the last move; to be written. Where it leaves another function beyond zero, it
    goes on with that one. marks (m, 4): since, until, roots and slopes of a `Survey`, of slope NaN where no root is
    looked for; width: of the interval.
    """
    return _move(values, marks, width, step)


# The search: samples at Chebyshev points, a survey of all functions, the first root by true values. Most steps are
# clear of zeros by far, which polynomials through both ends show: no state of the step is read then.

# Of kernels of functions: two contexts, t, the state (3, n), values to be written; where the step began: the time, the
# state, and angles of joints, roughly
VALUES = "ppdppdpp"
call_values = caller(VALUES)
CLEAR, FOUND = 0, 1  # and UNSURE


class SearchNumbers(Record):
    """Settings and results of a search."""

    reader: int  # the kernel that reads states
    values: int  # and that of the functions
    finder: int  # and `find_first`
    place: int  # of the next time that is read, as of `dense_output.read`
    t0: float  # s, the step
    t1: float
    just: float  # its end, but just before it where loads may jump there
    new: int  # whether no step has been searched since the run has begun
    found: int  # the function that is zero first
    t: float  # when, s


class SearchParts(NamedTuple):
    """m functions, of `all` that their kernel evaluates."""

    numbers: SearchNumbers
    tables: np.ndarray  # root_isolation.kernel_tables
    spins: np.ndarray  # int64 (bodies, 4) as a vector: where Euler parameters are
    which: np.ndarray  # int64 (m,)  of all functions
    falls: np.ndarray  # (m,)  direction of the changes that end the run, or zero
    may_fall: np.ndarray  # int64 (m,)  1 of those that may begin at zero within rounding, and fall at once
    least: np.ndarray  # (m,)  rounding of values that is known beforehand
    value: np.ndarray  # (m,)  at the end of the last step that is clear of zeros
    noise: np.ndarray  # (m,)  rounding of values
    odd: np.ndarray  # int64 (m,)  1 where a `Track` knows more than the value
    last: np.ndarray  # (m,)  values at the end of the step that has been searched
    all: np.ndarray  # values
    samples: np.ndarray  # ((LARGEST + 5) m,)
    left: np.ndarray  # int64 (m,)  1 of those that the survey is of
    fine: np.ndarray  # (2, points of the largest grid)
    marks: np.ndarray  # (m, 4)  of a survey
    step: np.ndarray  # (3,)  of `move`
    state: np.ndarray  # (3, n)  the last that was read
    beside: np.ndarray  # int64 (m,)  1 of those that vanish with the one that is found
    near: np.ndarray  # (angles,)  of joints where the step began, roughly
    memory: np.ndarray  # what forces remember, where the functions read it


_EXAMPLE = SearchParts(
    SearchNumbers(), np.zeros(0), *np.zeros((2, 0), int), np.zeros(0), np.zeros(0, int), *np.zeros((3, 0)),
    np.zeros(0, int), *np.zeros((3, 0)), np.zeros(0, int), *np.zeros((2, 0, 0)), np.zeros(0), np.zeros((0, 0)),
    np.zeros(0, int), *np.zeros((2, 0)),
)  # fmt: skip
load_search = loader(_EXAMPLE)


class SearchedStep(NamedTuple):
    """Where the states of a step are read, and what functions are evaluated by."""

    context: int  # of the reader
    run: int
    block: np.ndarray
    charts: np.ndarray
    points: np.ndarray
    first: int  # contexts of the functions
    second: int
    t0: float  # s, where it begins
    before: np.ndarray  # (3, n)  the state there
    t1: float  # s, its end
    now: np.ndarray


class StepArrays(NamedTuple):
    """What a `SearchedStep` is made of."""

    before: np.ndarray  # (3, n)  the state at t0
    now: np.ndarray
    block: np.ndarray
    charts: np.ndarray
    points: np.ndarray


load_arrays = loader(StepArrays(*np.zeros((2, 0, 0)), np.zeros(0), *np.zeros((2, 0, 0))))


@kernel
def _evaluate(s, first, second, t, state, t0, before, out):  # eight: and where the step began
    """Values (m,) of the functions at t and a state (3, n)."""
    call_values(s.numbers.values, first, second, t, state, s.all, t0, before, s.near)
    for j in range(out.size):
        out[j] = s.all[s.which[j]]


@kernel
def _evaluate_within(s, step, t, whole, out):
    """The same at a time within the step; False if there is no state. whole: WHOLE or 0."""
    asked = s.numbers.place + whole
    s.numbers.place = SAME_STEP
    read = read_one(s.numbers.reader, step.context, step.run, step.block, step.charts, step.points, t, asked, s.state)
    if read != 0:
        return False
    _evaluate(s, step.first, step.second, min(t, s.numbers.just), s.state, step.t0, step.before, out)
    return True


@kernel
def _is_smooth(step):
    """Whether polynomials of degree five through both ends follow the motion of a step.

    By h qdd at both ends velocities change as the trapezoidal rule has it; of an oscillation, up to some 2.5 rad.
    """
    h = step.t1 - step.t0
    fastest, first, last = 0.0, step.before, step.now
    for j in range(first.shape[1]):
        fastest = max(fastest, abs(first[1, j]), abs(last[1, j]))
    for j in range(first.shape[1]):
        off = last[1, j] - first[1, j] - 0.5 * h * (first[2, j] + last[2, j])
        if not abs(off) <= SMOOTH * h * max(abs(first[2, j]), abs(last[2, j])) + STEADY * fastest:
            return False
    return True


@kernel
def _follow(step, t, out):
    """out (3, n) = q and qd of these polynomials at t: off the manifold by as much as they are off the motion."""
    h = step.t1 - step.t0
    first, last, x = step.before, step.now, (t - step.t0) / h
    for j in range(out.shape[1]):
        v, a = h * first[1, j], h * h * first[2, j]
        d = last[0, j] - first[0, j] - v - 0.5 * a
        e, f = h * last[1, j] - v - a, h * h * last[2, j] - a
        c3, c4, c5 = 10.0 * d - 4.0 * e + 0.5 * f, 7.0 * e - 15.0 * d - f, 6.0 * d - 3.0 * e + 0.5 * f
        out[0, j] = first[0, j] + x * (v + x * (0.5 * a + x * (c3 + x * (c4 + x * c5))))
        out[1, j] = (v + x * (a + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))) / h


@kernel
def _turn_rate(spins, qd):
    """The fastest turn of a body, rad/s."""
    fastest = 0.0
    for b in range(spins.size // 4):
        square = 0.0
        for i in range(4 * b, 4 * b + 4):
            square += qd[spins[i]] * qd[spins[i]]
        fastest = max(fastest, square)
    return 2.0 * math.sqrt(fastest)


@kernel
def _survey(s, step, t0, t1, first, turning, roughly):  # seven: the samples
    """The degree that resolves the functions on [t0, t1], with the samples of it, and marks; 0 if there is no state.

    first (m,): values at t0; turning: of a body, rad/s. roughly: by states of `_follow`, and no more than the lowest
    degree.
    """
    m, known, N = s.value.size, 0, LOWEST
    while not roughly and turning * (t1 - t0) > SHOWN_TURN * N and N < LARGEST:
        N *= 2
    while True:
        table = kernel_table(s.tables, N)
        samples, last, check = matrix(data_of(s.samples), N + 2, m), known, N + 1
        while table.points[check] != CHECK:
            check -= 1
        # Downwards, since samples of half the degree move up
        for i in range(N + 1, 0, -1):
            if known > 0 and (i == check or (i if i < check else i - 1) % 2 == 0):
                copy(samples[last], samples[i])
                last -= 1
                continue
            t = t1 if i == N + 1 else t0 + 0.5 * (t1 - t0) * (table.points[i] + 1.0)
            if t == step.t1:
                _evaluate(s, step.first, step.second, s.numbers.just, step.now, step.t0, step.before, samples[i])
            elif roughly:
                _follow(step, t, s.state)
                _evaluate(s, step.first, step.second, t, s.state, step.t0, step.before, samples[i])
            elif not _evaluate_within(s, step, t, 0, samples[i]):
                return 0
        copy(first, samples[0])
        size = table.fine.size
        fine = matrix(data_of(s.fine), 2, size)
        grid = table.values, table.errors, table.widened, table.fine
        if look(*grid, samples, s.noise, t0, t1, fine, s.marks) != 0 or N == LARGEST or roughly:
            return N
        N, known = 2 * N, N + 1


@kernel
def _may_have_fallen(s, samples):
    """Whether a function that may begin at zero within rounding does so."""
    scale, first = 0.0, math.inf
    for j in range(s.value.size):
        if s.may_fall[j] != 0:
            scale, first = max(scale, _size(samples, j)), min(first, abs(samples[0, j]))
    return first <= FROM_REST * scale


@kernel
def _size(samples, j):
    """The largest value of a function."""
    found = 0.0
    for i in range(samples.shape[0]):
        found = max(found, abs(samples[i, j]))
    return found


@kernel
def _mark(s, samples):
    """Leave slopes to the functions that cross zero once, and no time to those clear of it: CLEAR if all are, or FOUND.

    Values of known rounding alone have no zero. UNSURE where a `Track` knows more of a function that isn't clear on the
    side that it falls from.
    """
    clear = CLEAR
    for j in range(s.value.size):
        is_clear = s.left[j] == 0 or s.marks[j, 0] == math.inf or _size(samples, j) <= s.least[j]
        if s.odd[j] != 0 and not (is_clear and s.falls[j] * samples[samples.shape[0] - 1, j] < 0.0):
            return UNSURE
        if not is_clear:
            clear = FOUND
        if is_clear or not (s.marks[j, 1] > s.marks[j, 0] and s.falls[j] * s.value[j] < 0.0):
            s.marks[j, 3] = math.nan
        if is_clear:
            s.marks[j, 0] = math.inf
    return clear


@kernel
def _are_far(s, samples):
    """Whether all values are far from zero."""
    for j in range(s.value.size):
        least = DISTANT * _size(samples, j)
        for i in range(samples.shape[0]):
            if not abs(samples[i, j]) > least:
                return False
    return True


@kernel
def _first_root(s, step, values, width):
    """Write the first root into s.step: ARRIVED or UNSURE. values (m,): scratch."""
    s.step[0], s.step[1], s.step[2] = -1.0, math.inf, math.inf
    for j in range(values.size):
        if s.marks[j, 3] == s.marks[j, 3] and s.marks[j, 2] < s.step[1]:
            s.step[0], s.step[1] = j, s.marks[j, 2]
    for _ in range(ROOT_STEPS if s.step[0] >= 0.0 else 0):
        if not _evaluate_within(s, step, s.step[1], 0, values):
            break
        found = _move(values, s.marks, width, s.step)
        if found != GO_ON:
            return found
    return UNSURE


@kernel
def _is_near_another(s, t, degree, width, value):
    """Whether another function may vanish at t, too. value (m,): there; degree, width: of the last survey.

    Markov: |p'| < 2 N^2 max |p| / width, and max |p| is less than four times the largest sample.
    """
    m, steepest = value.size, 8.0 * degree * degree / width
    samples = matrix(data_of(s.samples), degree + 2, m)
    for j in range(m):
        scale = 0.0
        for i in range(degree + 2):
            scale = max(scale, abs(samples[i, j]))
        if j != s.numbers.found and not value[j] > SAME_INSTANT * abs(t) * steepest * scale:
            return True
    return False


@kernel
def _find_beside(s, step, t, degree, width, first, value):
    """Mark the functions that vanish at t, too, by how fast they fall; False if there is no state. Two of scratch."""
    if not _evaluate_within(s, step, t, WHOLE, value):
        return False
    s.beside[:] = 0
    if not _is_near_another(s, t, degree, width, value):
        return True
    before = t - SHORTLY * (t - step.t0)
    if not (_evaluate_within(s, step, before, 0, first) and _evaluate_within(s, step, t, WHOLE, value)):
        return False
    for j in range(value.size):
        falls = value[j] < first[j] and value[j] * (t - before) <= SAME_INSTANT * abs(t) * (first[j] - value[j])
        s.beside[j] = 1 if falls and j != s.numbers.found else 0
    return True


@kernel
def _shown_until(s, t0, end, last):
    """Up to when to look, at most to the last time, that it shows a zero that isn't on [t0, end]; or the end.

    A step may end far beyond a zero, as those of free flights do: early on there are no points of the grid. Nor are
    there any beyond one that is close to the end.
    """
    since, width = end, end - t0
    for j in range(s.value.size):
        since = min(since, s.marks[j, 0])
    part = max(EARLY * width, 4.0 * (since - t0))
    if part <= 0.5 * width:
        return t0 + part
    return min(end + width, last) if since - t0 > 0.5 * width else end


@callback("pppppp")
def find_first(search, context, run, first, second, arrays):
    """As `search_step`, for kernels; arrays: `StepArrays`."""
    s, a = load_search(search), load_arrays(arrays)
    t0, t1 = s.numbers.t0, s.numbers.t1
    step = SearchedStep(context, run, a.block, a.charts, a.points, first, second, t0, a.before, t1, a.now)
    numbers, m, end, width, roughly, surveys = s.numbers, s.value.size, t1, t1 - t0, _is_smooth(step), 0
    turning = max(_turn_rate(s.spins, a.before[1]), _turn_rate(s.spins, a.now[1]))
    scratch = matrix(data_of(s.samples[(LARGEST + 2) * m :]), 3, m)
    copy(s.value, scratch[2])
    numbers.place, numbers.found = OTHER_CHART, -1
    for j in range(m):
        s.left[j] = 1
    while True:
        surveys += 1
        degree = _survey(s, step, t0, end, scratch[2], turning, roughly)
        samples = matrix(data_of(s.samples), degree + 2, m)
        if (
            degree == 0
            or surveys > MOST_SURVEYS
            or (numbers.new != 0 and numbers.found < 0 and _may_have_fallen(s, samples))
        ):
            return UNSURE
        clear = _mark(s, samples)
        if clear == CLEAR and not (roughly and (end < t1 or not _are_far(s, samples))):
            if numbers.found >= 0 or end == t1:
                break
            # Nothing up to there
            copy(samples[degree + 1], scratch[2])
            t0, end = end, min(end + (end - t0) / EARLY, t1)
            continue
        until = _shown_until(s, t0, end, t1) if clear == FOUND and numbers.found < 0 else end
        if roughly:  # that is to be known better
            roughly, end = until < end, until
            continue
        if clear == UNSURE:
            return UNSURE
        width = end - t0
        if _first_root(s, step, scratch[0], width) != ARRIVED:
            if until == end:
                return UNSURE
            end = until
            continue
        # What was unclear may be clear up to there
        numbers.found, end, unclear = int(s.step[0]), s.step[1], False
        for j in range(m):
            s.left[j] = 1 if s.left[j] == 1 and s.marks[j, 0] < end and s.marks[j, 3] != s.marks[j, 3] else 0
            unclear = unclear or s.left[j] == 1
        if not unclear:
            break
    if numbers.found < 0:
        copy(samples[degree + 1], s.last)
        return CLEAR
    numbers.t = end
    return FOUND if _find_beside(s, step, end, degree, width, scratch[0], scratch[1]) else UNSURE


call_find = caller("pppppp")


@kernel
def take_step(s):
    """Take the values at the end of a step that is clear of zeros."""
    copy(s.last, s.value)
    s.odd[:] = 0
    s.numbers.new = 0


@entry("pppppmmvmm")
def search_step(search, context, run, first, second, before, now, block, charts, points):  # ten: a step
    """Search a step for the first zero: CLEAR, FOUND, or UNSURE, after which nothing has changed.

    Of a step without zeros the values at its end are taken.
    context, run: of the reader; first, second: of the functions; before, now (3, n): states at t0 and t1. Of a zero the
    function and the time are in the `SearchNumbers`, the state and those that vanish beside in the `SearchParts`.
    """
    arrays, s = StepArrays(before, now, block, charts, points), load_search(search)
    found = call_find(s.numbers.finder, search, context, run, first, second, seen(arrays))
    if found == CLEAR:
        take_step(s)
    return found


@kernel
def begin_functions(s, first, second, t, now, out):
    """out (m,): values at t and a state (3, n); 0 if one is not finite, else 1."""
    _evaluate(s, first, second, t, now, t, now, out)
    return 1 if is_finite(out) else 0


@entry("pppdmv")
def evaluate_functions(search, first, second, t, now, out):
    """As `begin_functions`."""
    return begin_functions(load_search(search), first, second, t, now, out)


@entry("pppvmdmvm")
def evaluate_over(kernel, first, second, t, levels, t0, before, near, out):  # nine: as of VALUES
    """out (k, all): values by the kernel at this address, at times t (k,) and levels (k, 3 n)."""
    for k in range(t.size):
        call_values(kernel, first, second, t[k], levels[k], out[k], t0, before, near)


SEARCHING = (move, find_first, search_step, evaluate_functions, evaluate_over)


class KernelFunctions:
    """Event functions that a kernel evaluates; the base of those with more to say.

    Attributes
    ----------
    functions : tuple
        As of `GroupSearch`.
    kernel : tuple
        The same, where steps are searched by kernels; None where the functions are evaluated in Python alone.
    """

    def over(self, states):
        """Values (k, count) of `States`."""
        called, *contexts, count, memory = self.functions
        memory[:] = states.memory[: memory.size]
        levels, out = states.levels.reshape(states.t.size, 3 * states.n), np.empty((states.t.size, count))
        evaluate = interrupts_answered()(evaluate_over) if self.kernel is None else evaluate_over
        evaluate(called.address, *contexts, states.t, levels, *states.beside, out)
        return out


class GroupSearch:
    """The search of steps for the first zero of a group of functions.

    Parameters
    ----------
    kernel : tuple
        Of the functions: the `Callback` with the types VALUES, its contexts, how many functions it evaluates, and the
        array that it reads what forces remember from.
    which : list of int
        Those of the group.
    falls : ndarray (m,)
        Directions of the changes that end the run.
    known : tuple of ndarray
        `may_fall`, `least`, `value`, `noise` and `odd` of the `SearchParts`.
    spins : ndarray (bodies, 4)
        Where Euler parameters are among n coordinates.
    n : int
    angles : int
        Of joints.

    Attributes
    ----------
    result : int
        Of the next step where a flight has searched it already, by `find_first`; else None.
    """

    def __init__(self, kernel, which, falls, known, spins, n, angles):
        (called, *self.contexts, count, memory), m = kernel, len(which)
        self.numbers = SearchNumbers(values=called.address, finder=find_first.address)
        self.parts = SearchParts(
            self.numbers, kernel_tables(), spins.ravel(), np.array(which, int), falls, *known, np.zeros(m),
            np.zeros(count), np.zeros((LARGEST + 5) * m), np.zeros(m, int), np.zeros((2, FINE * LARGEST + 1)),
            np.zeros((m, 4)), np.zeros(3), np.zeros((3, n)), np.zeros(m, int), np.zeros(angles), memory,
        )  # fmt: skip
        (self.address, self._keep), self.result = resident(self.parts), None

    def at(self, t, now, near, memory):
        """Values (m,) at t and a state (3, n), and whether they are finite; near (angles,): of joints, roughly."""
        self._enter(near, memory)
        out = np.empty(self.parts.value.size)
        return out, evaluate_functions(self.address, *self.contexts, t, now, out) == 1

    def _enter(self, near, memory):
        self.parts.near[:] = near
        self.parts.memory[:] = memory[: self.parts.memory.size]

    def find(self, step, is_new):
        """The number of the function that is zero first in a step, `Inside`, -1 for none; None where that is unsure.

        is_new: whether no step has been searched since the start.
        """
        numbers, reader, known = self.numbers, step.reader, step.known
        numbers.t0, numbers.t1, (numbers.reader, context, run), numbers.new = step.t0, step.t1, reader.where, is_new
        numbers.just = step.just
        self._enter(step.near, step.memory)
        found, self.result = self.result, None
        if found is None:
            contexts = self.address, context, run, *self.contexts
            found = reader.call(search_step, *contexts, known[step.t0], known[step.t1], *step.steps)
        elif found == CLEAR:
            twin(take_step)(self.parts)
        if found == FOUND:
            known[numbers.t] = self.parts.state.copy()
        return None if found == UNSURE else numbers.found
