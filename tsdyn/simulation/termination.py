"""Reports of a run: progress while it lasts; at its end what happened, where, what kept steps short, what to try."""

import sys
import time
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..configuration.mobility import weakest_row
from ..errors import InvalidArgument, MissingDependency, Status, TsdynError
from ..maths.tolerances import EPS, TINY
from ..model.handles import BodyMotion, handles_of
from ..observables.evaluate import constraint_arrays, dependent_rows
from ..observables.generalised_forces import NotFinite, applied_loads, jumping, not_finite
from ..observables.reactions import singular_place
from ..rows.constraint_graph import MASS_REMEDY, mass_ratio, redundant_rows
from ..rows.tolerances import UNEQUAL_MASSES
from ..runs.tolerances import AT_LONGEST
from ..taylor.layout import without_series
from ..validation import counted
from . import tolerances as limits
from .tolerances import BAR_AFTER

# What has kept the steps of a run short, where it isn't the motion: a `max_step`, or rounding of the forces.
#
# A last digit of the positions, dq, changes accelerations by da, which vary at the rate w = sqrt(da / dq). Over their
# own time 1 / w velocities change by da / w. Where that is more than the tolerance, no step of a size that shows the
# motion is accepted, and steps are shorter than 1 / w by far.


class StepLimit(NamedTuple):
    """What is said in place of the sentence and the remedy of a status, None where these stand."""

    sentence: str | None
    remedy: str | None


def step_limit(solution):
    """The `StepLimit` of a solution that ended early."""
    method, status = solution._method, solution.status
    adapts = getattr(method, "embedded_order", 0) > 0 and method.step is None
    if not adapts or status not in (Status.STEP_COLLAPSED, Status.MAX_STEPS, Status.INTERRUPTED):
        return StepLimit(None, None)
    longest = method.max_step
    if longest is not None and status is not Status.INTERRUPTED and _mean(solution) >= AT_LONGEST * longest:
        if status is Status.MAX_STEPS:
            return StepLimit(None, "Raise max_steps, or give a longer max_step.")
        sentence = f"The steps are as long as max_step={longest:g} s allows."
        return StepLimit(sentence, "Give a longer max_step, or leave it out: the tolerances choose the steps then.")
    with np.errstate(all="ignore"):
        said = _rounding(solution, method) if min(method.rtol, method.atol) < limits.COARSE else ""
    if said:
        return StepLimit(None, said)
    return StepLimit(None, "Raise max_steps, or loosen rtol and atol." if status is Status.MAX_STEPS else None)


def _mean(solution):
    """The mean step, s."""
    return (solution._reached - solution.span[0]) / max(solution.stats.steps, 1)


def _rounding(solution, method):
    """Say that rounding of the forces is above the tolerances; "" where it isn't."""
    packed, h = solution.packed, _mean(solution)
    t, (q, qd, qdd) = solution._reached, solution._last
    if not (len(packed.system.forces) and h > 0.0 and np.isfinite((q, qd, qdd)).all()):
        return ""
    bodies = packed.system.bodies
    at = np.repeat(np.arange(len(bodies)), bodies[:, 1])
    dq = EPS * np.maximum.reduceat(np.abs(q), bodies[:, 0])[at]
    near = q + np.random.default_rng(0).choice((-1.0, 1.0), (limits.TRIALS, q.size)) * dq

    def compared(da):
        """Rates w (n,), and changes of velocities da / w over the tolerances (n,)."""
        rates = np.sqrt(da / np.maximum(dq, TINY))
        own = np.where(rates > 0.0, rates, np.inf)
        return rates, da / own / (method.atol + method.rtol * np.hypot(qd, qdd / own))

    if _norm(compared(_of_loads(solution, t, q, qd, near))[1]) < 1.0:  # without constraints: this decides for most
        return ""
    da = _of_motion(solution, t, q, qd, near)
    rates, ratios = compared(da)
    worst, share = int(ratios.argmax()), _norm(ratios)
    if not 1.0 <= share < np.inf or h * rates[worst] > limits.SHORTENED:
        return ""
    return (
        "The tolerances are below what rounding of the forces allows: a last digit of the positions changes the "
        f"acceleration of {packed.bodies[at[worst]].name} by {da[worst]:.1e}, and steps are {h:.1e} s long. Loosen to "
        f"rtol={limits.CLEAR * share * method.rtol:.0e} and atol={limits.CLEAR * share * method.atol:.0e}, or soften "
        "the forces."
    )


def _norm(ratios):
    """Of ratios of velocities, those of positions being zero."""
    return float(np.sqrt((ratios * ratios).mean() / 2.0))


def _of_loads(solution, t, q, qd, near):
    """The largest changes of accelerations (n,) of bodies without joints."""
    system, count = solution.packed.system, len(near) + 1
    places, rates = np.concatenate((q[None], near)), np.tile(qd, (count, 1))
    Q = applied_loads(system, np.full(count, t), places, rates, np.tile(solution._remembered, (count, 1)))
    least = [
        np.repeat((mass, 4.0 * np.linalg.eigvalsh(J.reshape(3, 3))[0]), (3, length - 3))
        for (_, length), mass, J in zip(system.bodies, system.mass, system.inertia, strict=True)
    ]
    return np.abs(Q[1:] - Q[0]).max(axis=0) / np.maximum(np.concatenate(least), TINY)


def _of_motion(solution, t, q, qd, near):
    """The same with the constraints; zero where accelerations can't be found."""
    from ..analyses.nominal_motion import NominalMotion  # imported here: few runs end early

    packed, slots = solution.packed, solution._remembered
    try:
        here = NominalMotion(packed, slots, t, q, qd).qdd
        return np.max([np.abs(NominalMotion(packed, slots, t, place, qd).qdd - here) for place in near], axis=0)
    except (TsdynError, ArithmeticError):
        return np.zeros(q.size)


FEW = 3  # items named in a message
IMPLICIT = {  # what serves stiff motions, by the formulation
    "tangent": "integrator='radau'",
    "null-space": "integrator='sdirk54'",
    "maggi-kane": "integrator='radau' in the tangent form",
}
NO_NUMBERS = Status.NOT_FINITE, Status.STEP_COLLAPSED
AHEAD = 10.0 ** np.arange(-12, 2)  # parts of a usual step; the last ones may be longer


def account(solution, scene, reason, goes_on=""):
    """Return the termination message of a run; `goes_on` is the call that continues it from a checkpoint."""
    reason = " ".join(part for part in (reason, _kept(solution.stats)) if part)
    if solution.success:
        return " ".join(part for part in (solution.status.sentence, reason, _locked(solution)) if part)
    steps = counted(solution.stats.steps, "step")
    where = f"It stopped at t = {solution._reached:.9g} s of {solution.span[1]:g} s, after {steps}."
    masses = mass_ratio(solution.packed, UNEQUAL_MASSES**2) if solution.status is Status.SINGULAR else ""
    if masses:
        return " ".join(part for part in (f"{masses[0].upper()}{masses[1:]}.", reason, where, MASS_REMEDY) if part)
    found, limit = suspect(solution, scene), step_limit(solution)
    remedy = Status.SINGULAR.remedy if found else limit.remedy or solution.status.remedy
    go_on = f"Continue with {goes_on}." if goes_on else ""
    if solution.status == Status.INTERRUPTED:
        remedy = " ".join(part for part in (limit.remedy, go_on or solution.status.remedy) if part)
    elif solution.status == Status.MAX_STEPS and go_on:
        remedy += f" {go_on}"
    lacking = without_series(solution.packed)[:FEW] if found else ()
    if lacking:
        remedy += f" Without a series: {'; '.join(lacking)}."
    ended = *NO_NUMBERS, Status.NEWTON_FAILED, Status.SINGULAR, Status.MAX_STEPS, Status.CONTACT_FAILED
    if not found and solution.status in ended:
        found = _vanished(solution)
    if not found and solution.status in NO_NUMBERS:
        found = not_finite_of(solution).said
    if not found and solution.status in (Status.STEP_COLLAPSED, Status.MAX_STEPS):
        found = _jump(solution)
    if not found and solution.status in (Status.STEP_COLLAPSED, Status.NOT_FINITE, Status.STAGE_FAILED):
        # Report that the motion is stiff, or that its velocities diverge
        said = f"The motion is stiff: {IMPLICIT[solution.formulation]} may succeed. " if solution.stats.stiff else ""
        first, last = (float(np.abs(qd).max(initial=0.0)) for qd in (solution[:1].qd, solution._last[1]))
        if last > limits.BLOW_UP * (1.0 + first):
            said += f"The largest velocity has grown from {first:.3g} to {last:.3g}: the motion diverges."
        found = said.strip()
    parts = (limit.sentence or solution.status.sentence, reason, where, found, remedy)
    return " ".join(part for part in parts if part)


def _kept(stats):
    """Report the accuracy near singular configurations, from energy and projections."""
    if not stats.steps_near_singular:
        return ""
    error = stats.energy_error
    energy = "" if error is None else f"the energy error is {error:.1e} of the kinetic energy and "
    return (
        f"Near singular configurations ({stats.steps_near_singular} steps) {energy}the projection onto the constraints "
        f"moved bodies by at most {stats.largest_landing:.1e} (m, rad) at the end of a step."
    )


def _locked(solution):
    """Report that redundant rows leave no degree of freedom."""
    redundant = solution._redundant
    still = redundant and not solution.system.rheonomic[0]
    if not (still and solution._last.shape[1] == len(solution.system.segments) - redundant):
        return ""
    return "The mechanism is immobile: the constraints, some of them redundant, leave no degree of freedom."


def cause_of(solution):
    """The exception of a user's function that has ended a run, raised once more in plain Python; None without one."""
    return not_finite_of(solution).cause if solution.status in NO_NUMBERS else None


def not_finite_of(solution):
    """The `NotFinite` of the last state, or of what is soonest ahead of it within a usual step."""
    t, (q, qd, qdd) = solution._reached, solution._last
    usual = (t - solution.span[0]) / max(solution.stats.steps, 1)
    for ahead in (0.0, *usual * AHEAD):
        with np.errstate(all="ignore"):
            x, xd = q + ahead * qd, qd + ahead * qdd
        if not (np.isfinite(x).all() and np.isfinite(xd).all()):
            break
        found = not_finite(solution.packed, t + ahead, x, xd, solution._remembered)
        if found.said:
            return found
    return NotFinite("", None)


def _vanished(solution):
    """Name the ropes and cables of which a span has next to no length."""
    packed, q = solution.packed, solution._last[0]
    handles, found = handles_of(packed), []
    for item in (*(member.constraint for member in packed.members), *(load.force for load in packed.loads)):
        points = getattr(item, "points", ())
        places = [BodyMotion(*handles.where(body), (q,)).point(s, 0) for body, s in points]
        lengths = [np.linalg.norm(np.subtract(*pair)) for pair in pairwise(places)]
        for (a, b), length in zip(pairwise(points), lengths, strict=True):
            if length < limits.NO_SPAN * sum(lengths):
                found.append(
                    f"The span of {item.name!r} between {a[0].name!r} and {b[0].name!r} shrinks to length zero"
                )
    return f"{found[0]}: it has no direction there. End the run before, by an event." if found else ""


def _jump(solution):
    """Name the forces whose law has no direction where the motion has come to rest."""
    (q, qd, _), t = solution._last, solution._reached
    names = jumping(solution.packed, t, q, qd, solution._remembered, (limits.AT_ONCE, limits.NEAR_BY))
    if not names:
        return ""
    return (
        f"The motion comes to rest where the law of {', '.join(map(repr, names[:FEW]))} changes at once: at zero "
        "length a spring has no direction. Hold the bodies apart there, or let the load change within a short distance."
    )


def suspect(solution, scene):
    """Name the nearly singular item at the last state."""
    ends = Status.SINGULAR, Status.NEWTON_FAILED, Status.CHART_LOST, Status.STEP_COLLAPSED
    if solution.status not in (*ends, Status.NOT_FINITE, Status.CONTACT_FAILED):
        return ""
    place = singular_place(solution.packed, solution._last[0])
    if place:
        return f"{place}: a singular configuration."
    if solution.status not in ends or solution._phases is not None:  # not all rows hold in a phase
        return ""
    if solution._last.shape[1] > limits.MOST_SINGULAR:
        return _suspect_of_many(solution, scene)
    _, Phi_q, _, _ = constraint_arrays(solution.system, solution._last[0], solution._last[1], solution._reached)
    rows, share = weakest_row(scene, Phi_q, len(redundant_rows(solution.packed)))
    if not share < limits.NEARLY_SINGULAR:
        return ""
    return (
        f"Phi_q is near to losing rank there (its smallest singular value is {share:.1e} of the largest, rows "
        f"scaled): a singular configuration, in which {rows} depends on other rows."
    )


def _suspect_of_many(solution, scene):
    """Do the same by elimination, in O(N)."""
    packed = solution.packed
    rows = dependent_rows(packed, solution._last[0], solution._reached, limits.NEARLY_SINGULAR**2)
    redundant = len(redundant_rows(packed))
    if rows is None or len(rows) <= redundant:
        return ""
    names = scene.row_names()
    which = ", ".join(names[i] for i in rows[:FEW]) + (", ..." if len(rows) > FEW else "")
    return (
        f"Phi_q is near to losing rank there: a singular configuration, in which {len(rows)} rows nearly depend on "
        f"others ({which}), {redundant} of them everywhere."
    )


# Progress of a run, or of another calculation stage by stage: a bar in terminal or notebook, or a user's function.


def silent(fraction, *more):
    """Report nothing."""


def bar_class(progress):
    """Return the class of bars, progress being no function and not off; refuse what isn't True."""
    if progress is not True:
        raise InvalidArgument(
            f"progress must be True, False, None or a function of the fraction done, got {progress!r}."
        )
    try:
        from tqdm.auto import tqdm
    except ImportError as error:
        raise MissingDependency(
            "progress=True needs tqdm: pip install 'tsdyn[progress]'; or pass a function of the fraction done."
        ) from error
    return tqdm


def reporter(progress):
    """Return a function that receives the fraction done (None at the end), the time reached, s, and the steps."""
    if progress is None or progress is False:
        return silent
    if callable(progress):
        return lambda fraction, *more: None if fraction is None else progress(min(max(float(fraction), 0.0), 1.0))
    tqdm = bar_class(progress)
    form = "{desc}{percentage:3.0f}%|{bar}| {elapsed}<{remaining}{postfix}"
    bars, begun = [], []  # made at the first report: a refused run shows none

    def show(fraction, t=0.0, steps=0):
        if fraction is None:
            for bar in bars:
                bar.close()
            return
        if not bars:
            bars.append(tqdm(total=100, unit="%", file=sys.stderr, bar_format=form))
            begun.extend((time.perf_counter(), steps))
        rate = (steps - begun[1]) / max(time.perf_counter() - begun[0], 1e-9)
        bars[0].set_postfix_str(f"t = {t:.6g} s, {steps:.3g} steps, {rate:.2g} steps/s", refresh=False)
        bars[0].update(100.0 * min(fraction, 1.0) - bars[0].n)

    return show


# Progress of a calculation that is no run, stage by stage, and what a Ctrl-C says of it.

FORM = "{desc}{percentage:3.0f}%|{bar}| {elapsed}{postfix}"


class StageProgress:
    """A context in which report(fraction, said) reports the progress of a calculation, and what is being done.

    Parameters
    ----------
    progress : bool or callable
        As of `simulate`. A bar is shown after BAR_AFTER seconds.
    what : str
        The calculation, in the message of a KeyboardInterrupt.
    """

    def __init__(self, progress, what):
        self.what, self.fraction, self.said, self._bar = what, 0.0, "nothing is done yet", None
        self._tell = progress if callable(progress) else None
        if self._tell is None and progress not in (None, False):
            shown = {"file": sys.stderr, "bar_format": FORM, "delay": BAR_AFTER, "miniters": 0}
            self._bar = bar_class(progress)(total=100, unit="%", **shown)

    def __enter__(self):
        return self

    def __call__(self, fraction, said):
        """Be at a fraction, 0 to 1, which never falls."""
        self.fraction, self.said = min(max(self.fraction, float(fraction)), 1.0), said
        if self._tell is not None:
            self._tell(self.fraction)
        if self._bar is not None:
            self._bar.set_postfix_str(said, refresh=False)
            self._bar.update(100.0 * self.fraction - self._bar.n)

    def __exit__(self, kind, error, trace):
        try:
            if kind is None:
                self(1.0, "done")
        finally:
            if self._bar is not None:
                self._bar.close()
        if kind is KeyboardInterrupt and not error.args:
            raise KeyboardInterrupt(f"{self.what} was interrupted at {self.fraction:.0%}: {self.said}.") from error
