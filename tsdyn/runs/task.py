"""The request of a run: arguments of `simulate` checked, the `Task` made of them, the `Outcome` that comes back."""

import math
from operator import lt
from typing import NamedTuple

import numpy as np

from ..errors import InvalidArgument, Status
from ..maths.tolerances import EPS, NEGLIGIBLE
from ..methods.integrator import Integrator, frozen, is_own, registered
from ..motions.knots import NO_STOPS
from ..validation import FEW, checked_once, finite_vector, floats, number, shown, unknown_name
from .run_log import RunEnd
from .tolerances import FROM_ZERO, SHORTEST

TOLERANCE = 1e-8  # rtol and atol of a run, if none are given
NO_TIMES = np.empty(0)


def interval(t_span):
    """Start and end of the interval, s."""
    if type(t_span) is tuple and len(t_span) == 2:
        t0, t1 = number(t_span[0]), number(t_span[1])
    else:
        span = floats(t_span)
        t0, t1 = span.tolist() if span.shape == (2,) else (math.nan, math.nan)
    if not (math.isfinite(t0) and math.isfinite(t1)):
        raise InvalidArgument(f"t_span must be two finite times in s, (start, end), got {t_span!r}.")
    if not t1 > t0:
        raise InvalidArgument(
            f"t_span must end after it starts, got ({t0:g}, {t1:g}); swap them, or choose a later end."
        )
    return t0, t1


def output_times(t_eval, t0, t1):
    """The times of t_eval (k,), s, none for None."""
    if t_eval is None:
        return NO_TIMES
    times = floats(t_eval)
    if times.ndim == 1 and 0 < times.size < FEW:
        listed = times.tolist()
        if t0 <= listed[0] and listed[-1] <= t1 and all(map(lt, listed, listed[1:])):
            return times
    increasing = times.ndim == 1 and (times[1:] > times[:-1]).all()
    if increasing and times.size and t0 <= times[0] and times[-1] <= t1:
        return times
    if times.ndim != 1 or times.size == 0 or not np.isfinite(times).all():
        raise InvalidArgument(f"t_eval must be a vector of at least one finite time, s, got {shown(t_eval)}.")
    if not increasing:
        raise InvalidArgument("t_eval must increase from each time to the next.")
    if times[0] < t0 or times[-1] > t1:
        raise InvalidArgument(
            f"t_eval must lie within t_span, ({t0:g}, {t1:g}); it runs from {times[0]:g} to {times[-1]:g}."
        )
    return times


def step_count(t0, t1, step):
    """How many fixed steps there are, the last of which may be shorter."""
    count = (t1 - t0) / step
    if not count < 2**53 or t0 + step == t0:
        raise InvalidArgument(f"the step of {step:g} s is too small for the interval ({t0:g}, {t1:g}).")
    return max(1, math.ceil(count - max(NEGLIGIBLE * count, EPS * max(abs(t0), abs(t1)) / step)))


def demand_steps_seen(method, t0, t1):
    """Refuse steps given to an adaptive method that are no more than the rounding of the times."""
    if (method.max_step is None and method.first_step is None) or not method.embedded_order or method.step is not None:
        return
    for name, value, latest in (
        ("max_step", method.max_step, max(abs(t0), abs(t1))),
        ("first_step", method.first_step, abs(t0)),
    ):
        least = SHORTEST * max(latest, FROM_ZERO * (t1 - t0))
        if value is not None and not value > least:
            raise InvalidArgument(
                f"{name}={value:g} s is too small for the interval ({t0:g}, {t1:g}): the rounding of its times is "
                f"{least:.1g} s. Give a longer one, or leave it out."
            )


def demand_one_state(value, rule):
    """Refuse a solution or an equilibrium, which has a state and is none."""
    q = getattr(value, "q", 0)
    if (q.ndim if type(q) is np.ndarray else np.ndim(q)) != 1 and hasattr(value, "state"):
        raise InvalidArgument(f"{rule}: give the .state of {value!r}.")


def state_arrays(state, n):
    """Positions and velocities (n,) of a state given to start from."""
    demand_one_state(state, "state must be one State")
    if not (hasattr(state, "q") and hasattr(state, "qd")):
        raise InvalidArgument(f"state must have q and qd, such as solution.state, got {shown(state)}.")
    return finite_vector(state.q, n, "state.q"), finite_vector(state.qd, n, "state.qd")


def adaptive(kind, rtol, atol):
    """A method of a class with these tolerances, TOLERANCE for None, frozen; one of tsdyn's own is made once."""
    make = _own if is_own(kind) else _own.__wrapped__
    return make(kind, TOLERANCE if rtol is None else rtol, TOLERANCE if atol is None else atol)


@checked_once
def _own(kind, rtol, atol):
    return frozen(kind(rtol=rtol, atol=atol))


def method_of(integrator, rtol, atol):
    """The method that is given as an instance, a class or a name, frozen; tolerances are for a name."""
    known = registered()
    named = isinstance(integrator, str)
    kind = kind_named(integrator) if named else integrator if isinstance(integrator, type) else type(integrator)
    if kind is None:
        raise unknown_name("integrator", integrator, known)
    adapts = getattr(kind, "embedded_order", 0) > 0
    given = [name for name, value in (("rtol", rtol), ("atol", atol)) if value is not None]
    if given and not adapts and kind in known.values():
        raise InvalidArgument(
            f"{kind.__name__} has fixed steps and no use for {' and '.join(given)}: give "
            f"integrator=ts.integrators.{kind.__name__}(step=...) alone, or an adaptive method, such as "
            "integrator='rk45'."
        )
    if given and not named:
        raise InvalidArgument(
            f"{' and '.join(given)} set the tolerances of an adaptive method given by its name, such as "
            f"integrator='rk45', not of {integrator!r}; give an instance its own, such as RK45(rtol=1e-8)."
        )
    if named:
        return adaptive(kind, rtol, atol) if adapts else frozen(kind())
    if isinstance(integrator, type) and integrator in known.values():
        return frozen(integrator())
    if not isinstance(integrator, Integrator):
        raise InvalidArgument(
            f"integrator must be a name or an instance such as ts.integrators.Nystrom4(step=1e-3), got {integrator!r}."
        )
    return frozen(integrator)


def kind_named(name):
    """The class of integrators of a name, as it is registered now; None if there is none."""
    return registered().get(name.lower().replace("-", "").replace("_", ""))


# The run request (`Task`) that a driver receives, and the `Outcome` that it returns.
#
# The attribute `driver` of a method is a name in prepared_run.DRIVERS, or a driver function that takes a `Task` and
# returns an `Outcome`.


def between(times, span):
    """Whether there are times between the ends of a span."""
    if times.size > 2:
        return True
    (start, end), listed = span, times.tolist()  # a list: faster for two
    return bool(listed) and (start < listed[0] < end or start < listed[-1] < end)


class Task(NamedTuple):
    """One run, its arguments checked and its start consistent; n coordinates, m constraint rows."""

    prepared: object  # the scene's `Prepared`: the packed system, and memory for a run
    method: object
    form: object
    span: tuple  # start and end, s
    q: np.ndarray  # (n,) at the start; not to be written to
    qd: np.ndarray  # (n,)
    remembered: np.ndarray  # (angles + slots,) angles of joints at the start, and what forces remember
    times: np.ndarray  # (k,) output times, s; empty for every step
    within: bool  # whether output between the ends of steps is requested
    dense_output: bool
    events: list  # of `events.Event`, or None
    constraint_tol: float
    max_steps: int  # or None
    interval: int  # steps between charts that are forced; 0 for none
    report: object  # a function of the fraction done (None at the end), the time, s, and the steps of the segment
    history: bool  # whether the histories of steps and charts are kept
    choose: object  # a function that makes the `Turns` of a run, or the `Turns`; None where no other method goes on
    stops: np.ndarray = NO_STOPS  # times at which a step ends, as of `motions.knots.stops_of`
    sampling: object = None  # a `driver.Sampling`, or None
    resume: object = None  # goes on after events in the same memory; see `Watch`
    archive: object = None  # a `files.archive.Archive` that outputs and histories go to, or None

    @property
    def angles(self):
        """Of the joints at the start (angles,)."""
        return self.remembered[: self.prepared.handles.count]


class Outcome(NamedTuple):
    """How a run went: arrays of its own, shared with no other run."""

    status: Status
    reason: str  # what there is to say about the status
    rows: np.ndarray  # (k, 1 + 3 n + angles + slots)  t, q, qd, qdd, remembered; a range where an archive has them
    end: RunEnd  # or a `RecordedEnd`
    trajectory: object  # a `dense_output.Trajectory`, or None
    events: tuple  # times, positions, velocities of each event; or None
    began: float  # by `jit.compiled.clock` when the driver began, prepared
    method: str = ""  # the methods of a run that has turned from one to another
    phases: tuple = None  # of a run with contacts: its `phases.Phases`, and the number of that of each output
    interrupted: bool = False  # whether Ctrl-C came when it had ended, perhaps for another part of the run to go on
