"""The run request (`Task`) that a driver receives, and the `Outcome` that it returns.

The attribute `driver` of a method is a name in simulate.DRIVERS, or a driver function that takes a `Task` and returns
an `Outcome`.
"""

from typing import NamedTuple

import numpy as np

from ..errors import Status
from ..motions.knots import NO_STOPS
from .run_log import RunEnd


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
    sampling: object = None  # a `sampling.Sampling`, or None
    resume: object = None  # a function of time, run and numbers of events: whether a run goes on after them
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
    trajectory: object  # a `trajectory.Trajectory`, or None
    events: tuple  # times, positions, velocities of each event; or None
    began: float  # by `jit.compiled.clock` when the driver began, prepared
    method: str = ""  # the methods of a run that has turned from one to another
    phases: tuple = None  # of a run with contacts: its `phases.Phases`, and the number of that of each output
    interrupted: bool = False  # whether Ctrl-C came when it had ended, perhaps for another part of the run to go on
