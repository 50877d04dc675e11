"""The state of one run: arrays and numbers that drivers, step kernels and interpolants share, and their layout."""

from typing import NamedTuple

import numpy as np

from ..jit.kernels import Record, loader
from .carving import carve

AGAIN = 2  # Numbers.rejected_last: by a failed stage
FILLED, STORED = 1, 2  # Numbers.dense: every step's block is made, and kept
# block: what it begins with, before the interpolant's data
B_START, B_H, B_END, B_CHART, B_DATA = range(5)


class Clock(Record):
    """Times (s), tolerances and factors of a run."""

    t: float  # of the last accepted point
    t_origin: float
    t_end: float
    h: float  # of the next step: proposed, or fixed
    rtol: float
    atol: float
    max_step: float
    exponent: float  # of the error, in the choice of a step
    error_before: float  # of the last accepted step, over the tolerance
    stability_limit: float  # of h |lambda|; zero: not watched
    turn_share: float  # of the longest step that rotations allow
    largest_landing: float  # m; how far a projection near a singular configuration has moved a body at most


class Numbers(Record):
    """Counts, settings and states of a run; settings and states that are no numbers are 0 or 1."""

    first_order: int
    adaptive: int
    steps_wanted: int
    chart_interval: int  # steps between charts that are forced; 0 for none
    dense: int  # 0, FILLED or STORED
    may_pass: int  # whether a singular configuration ends the run with PASSAGE
    leave_when_stiff: int
    begun: int
    waiting: int  # whether a stop waits for Python
    steps: int
    rejected: int
    rejected_last: int  # 1: by its error; AGAIN
    failed: int  # Status of the last step that was not made, 0 after one that was
    cuts: int  # fixed steps cut at stops
    in_chart: int  # steps on the present chart
    near_steps: int  # near a singular configuration
    rows: int  # of the log's out that are written
    history: int  # of its history
    chart_rows: int  # of its charts that are closed
    blocks: int  # of its blocks
    next_eval: int  # in its t_eval
    next_stop: int  # in its stops
    last_stage: int  # where in memory an explicit method leaves its last stage; 0: stiffness is not watched
    stage_at: int  # where in memory an implicit method leaves its last stage; 0 for others
    at_limit: int  # steps at the limit of stability, or in which little moves
    below_limit: int
    still: int  # steps of an explicit stage method in which hardly anything moves; of an implicit one, joints at rest
    stiff: int


class Kernels(Record):
    """Addresses of what drivers call; zero for what a run doesn't."""

    place: int  # the formulation's: place to error_norm
    accelerate: int
    complete: int
    check: int
    start_chart: int
    error_norm: int
    step: int  # the method's: step to second
    plug_in: int  # the step kernel of a plug-in; see methods/plug_in.py
    error: int
    second_error: int
    fill: int
    value: int
    second: int
    watch: int  # path_loads.watch, where functions of the state are loads
    expand: int  # of a Taylor step: see taylor/step_parts.py
    reach: int
    accelerate_here: int
    pass_singular: int


class Run(NamedTuple):
    """The state of a run, and the driver's scratch. x, y are v, vd (tangent-space ODE) or q, w (Maggi/Kane)."""

    x: np.ndarray  # (nx,)
    y: np.ndarray  # (ny,)
    yd: np.ndarray  # (ny,)
    xd: np.ndarray  # (nx,)
    dx: np.ndarray  # (nx,)  increments of a step, then its error; scratch of dense output
    dy: np.ndarray  # (ny,)
    x_low: np.ndarray  # (nx,)  what the additions have lost so far (Kahan)
    y_low: np.ndarray  # (ny,)
    x_old: np.ndarray  # (nx,)  at the start of the step, for dense output and to go back to
    y_old: np.ndarray  # (ny,)
    yd_old: np.ndarray  # (ny,)
    xd_old: np.ndarray  # (nx,)
    x_low_old: np.ndarray  # (nx,)
    y_low_old: np.ndarray  # (ny,)
    now: np.ndarray  # (3, n)  q, qd, qdd at the last accepted point
    before: np.ndarray  # (3, n)  at the one before; kept for a first-order system and for implicit methods
    warm: np.ndarray  # what `dense_output.keep` copies while dense output moves it
    xs: np.ndarray  # (nx,)  dense output and the guess of a first step
    ys: np.ndarray  # (ny,)
    yds: np.ndarray  # (ny,)
    remembered: np.ndarray  # (angles + slots,)  angles of joints at the last accepted point, and what forces remember
    frames: np.ndarray  # (angles, 9)  f, g and h of each angle; see joint_turns.py
    joints: np.ndarray  # int64 (angles, 4)  where its two bodies' coordinates begin, and how many they are
    watched: np.ndarray  # int64 (kinds,)  rows of System.forces that are sampled along steps; see path_loads.py
    loaded: np.ndarray  # int64 (bodies,)  that they act on
    path: np.ndarray  # scratch of path_loads.py
    tableau: np.ndarray  # the method's numbers
    memory: np.ndarray  # the method's scratch
    block: np.ndarray  # the present step's: start, h, end, chart; the interpolant's data; what is remembered
    clock: Clock
    numbers: Numbers
    kernels: Kernels


def enter_joints(run, handles, remembered):
    """Let a run count the angles of a scene's joints from those remembered on."""
    run.joints[:], run.frames[:], run.remembered[:] = handles.joints, handles.frames, remembered


def lay_out(n, nx, ny, angles, slots, tableau=0, memory=0, warm=0, block=0, path=0, watched=0, loaded=0):
    """The `Run` of a system of sizes nx, ny, whose forces remember so many `slots`.

    The other lengths are those of its arrays; a block is longer than its interpolant's data, which is what is given.
    """
    shapes = {
        **dict.fromkeys(("now", "before"), (3, n)),
        "remembered": (angles + slots,),
        "frames": (angles, 9),
        "tableau": (tableau,),
        **dict.fromkeys(("x", "xd", "xd_old", "dx", "x_low", "x_low_old", "x_old", "xs"), (nx,)),
        **dict.fromkeys(("y", "yd", "dy", "y_low", "y_low_old", "y_old", "yd_old", "ys", "yds"), (ny,)),
        "warm": (warm,),
        "memory": (memory,),
        "block": (B_DATA + block + angles + slots,),
        "path": (path,),
    }
    whole = {"joints": (angles, 4), "watched": (watched,), "loaded": (loaded,)}
    integers = {name: np.zeros(shape, np.int64) for name, shape in whole.items()}
    return Run(**carve(shapes, clock=Clock, numbers=Numbers, kernels=Kernels), **integers)


load_run = loader(lay_out(1, 1, 1, 1, 1))
