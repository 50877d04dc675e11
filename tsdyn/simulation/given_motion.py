"""Motions that are given, as solutions: base of the results of `scene.kinematics` and `scene.inverse_dynamics`."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from ..calls import fitting_methods
from ..errors import InvalidArgument, Status
from ..observables.state import remembered
from ..runs.arguments import state_arrays
from ..runs.counts import NAMES
from ..runs.run_end import RunEnd
from ..runs.task import Outcome
from ..validation import counted
from .scene_cache import prepared
from .solution import Solution
from .termination import suspect

if TYPE_CHECKING:
    from ..hints import ArrayLike, Scene

INITIAL_TOL = 1e-9  # of residuals of a start, as in `simulate`


@fitting_methods
class GivenMotion(Solution):
    """A `Solution` whose motion follows from constraints alone, or was given."""

    _method = ""  # what it is the result of

    def __init__(self, scene: Scene, wanted: int, kept: Any, followed: Any, message: str = "") -> None:
        span = (float(followed.rows[0, 0]), followed.reached) if len(followed.rows) else (followed.reached,) * 2
        form = SimpleNamespace(name="constraints alone")
        task = SimpleNamespace(prepared=kept, method=None, form=form, span=span, q=followed.last[0])
        counts = dict.fromkeys(NAMES, 0) | {
            name: getattr(followed, name) for name in ("steps", "rejected", "factorizations", "newton_iterations")
        }
        end = RunEnd(followed.reached, followed.last, followed.remembered, counts, None, None)
        outcome = Outcome(followed.status, "", followed.rows, end, None, None, 0.0)
        super().__init__(scene, task, outcome, {"prepare": 0.0, "run": followed.seconds})
        self._method, self._message = type(self)._method, message or _account(self, scene, wanted)

    def at(self, t: ArrayLike) -> NoReturn:
        """Refused: there are no interpolants; ask for the times."""
        raise InvalidArgument(f"a result of {self._method} has no interpolants: ask for these times in the call.")

    def _integrated(self, part):
        raise InvalidArgument(
            f"work is integrated over dense output, which a result of {self._method} has none of: integrate "
            "`.power` or `.power_of(item)` over its times, by scipy.integrate.simpson for one."
        )

    def _facts(self):
        s = self.stats
        facts = {"ended": f"{self.status.name.lower()} at t = {self._reached:g} s, {counted(self.t.size, 'output')}"}
        if s.steps:
            facts["steps"] = f"{s.steps}, {s.rejected} rejected, {counted(s.newton_iterations, 'Newton sweep')}"
        return facts | {"time": f"{s.seconds['run']:.3g} s"}

    def __str__(self) -> str:
        lines = [f"  {name:{max(map(len, self._facts()))}}  {fact}" for name, fact in self._facts().items()]
        return "\n".join([type(self).__name__, *lines, *([] if self.success else ["  " + self.message])])

    def _repr_html_(self) -> str:
        return super()._repr_html_().replace("Solution", type(self).__name__, 1)

    def __repr__(self) -> str:
        status, outputs = self.status.name.lower(), counted(self.t.size, "output")
        return f"<{type(self).__name__}: {status} at t = {self._reached:g} s: {outputs}{self._more()}>"

    def _more(self):
        return ""


def follow(scene, times, state, who, remedy):
    """Follow the branch of a scene without freedom to times (k,); its `Prepared`, and how far it came, a `Followed`."""
    from ..inverse.analysis import analyse  # imported here: a run needs none of it
    from ..inverse.freedom import demand_driven, driven_rates

    kept = prepared(scene)
    given = scene._initial() if state is None else state_arrays(state, kept.n)
    t0 = _start_time(kept, given[0], times) if state is None else float(state.t)
    every = np.append(times, t0)
    stops = kept.stops(every.min(), every.max())[:, 0]
    memory = remembered(state, kept, t0, given[0])
    _demand_consistent(scene, kept, given[0], t0)
    q, _ = kept.start(scene, (given[0], driven_rates(scene, t0, given[0], who)), t0, INITIAL_TOL, memory, True)
    demand_driven(kept.packed, memory[kept.handles.count :], t0, q.copy(), who, remedy)
    return kept, analyse(kept.packed, t0, q, memory, times, stops)


def _demand_consistent(scene, kept, q, t):
    """Refuse positions that violate the constraints, before velocities are solved for."""
    from ..configuration.kinetic_metric import Metric
    from ..configuration.start_violations import demand_small

    demand_small(
        scene,
        Metric(kept.packed, None, t).arrays(q)[0],
        INITIAL_TOL * (1.0 + np.abs(q).max()),
        "position",
        "Phi",
        (t, q),
    )


def _start_time(kept, q, times):
    """t[0] where the poses are consistent then; else 0, or the time nearest to it that data cover."""
    from ..configuration.kinetic_metric import Metric

    Phi = Metric(kept.packed, None, float(times[0])).arrays(q)[0]
    if np.abs(Phi).max(initial=0.0) <= INITIAL_TOL * (1.0 + np.abs(q).max()):
        return float(times[0])
    return max((motion.origin for motion in kept.motions if hasattr(motion, "origin")), key=abs, default=0.0)


def _account(solution, scene, wanted):
    """The message of a result."""
    status = solution.status
    if solution.success:
        return f"Every one of {counted(wanted, 'time')} was reached."
    where = f"It stopped at t = {solution.reached:.9g} s, with {solution.t.size} of {counted(wanted, 'time')}."
    if status is Status.INTERRUPTED:
        return f"The analysis was interrupted. {where}"
    found = suspect(solution, scene)
    if found or status in (Status.SINGULAR, Status.CHART_LOST, Status.NEWTON_FAILED):
        remedy = "Beyond it the mechanism has no position, or several: drive another coordinate, or end before it."
        return " ".join(part for part in ("The motion can't be followed any further.", where, found, remedy) if part)
    return f"{status.sentence} {where} {status.remedy}"
