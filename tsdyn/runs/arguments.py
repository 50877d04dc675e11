"""Validation of the arguments of `simulate`: times, method, initial state."""

import math
from operator import lt

import numpy as np

from ..errors import InvalidArgument
from ..maths.tolerances import EPS, NEGLIGIBLE
from ..methods.integrator import Integrator, frozen, is_own, registered
from ..validation import FEW, checked_once, finite_vector, floats, number, shown, unknown_name
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
        raise InvalidArgument("t_eval must be a non-empty vector of finite times in s.")
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
