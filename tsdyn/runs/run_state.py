"""The state of one run in the driver's kernels: arrays and their layout."""

from typing import NamedTuple

import numpy as np

from ..jit.kernels import loader
from ..workspaces.workspace import carve

# clock
T, T_ORIGIN, T_END, H, RTOL, ATOL, MAX_STEP, EXPONENT, ERROR_BEFORE, STABLE, SHARE, LANDED, CLOCKS = range(13)
# numbers
FIRST_ORDER, BEGUN, STEPS, STEPS_WANTED, IN_CHART, INTERVAL, ROWS, NEXT_EVAL = range(8)
HISTORY, CHART_ROWS, REJECTED, ADAPTIVE, REJECTED_LAST, DENSE, BLOCKS, STAGE_AT = range(8, 16)
LAST_STAGE, AT_LIMIT, BELOW_LIMIT, STIFF, LEAVE_WHEN_STIFF, FAILED, MAY_PASS, NEXT_STOP = range(16, 24)
CUTS, WAITING, NEAR_STEPS, TIGHTENED, NUMBERS = range(
    24, 29
)  # fixed steps cut at stops; whether a stop waits for Python
AGAIN = 2  # REJECTED_LAST: by a failed stage
FILLED, STORED = 1, 2  # DENSE: every step's block is made, and kept


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
    warm: np.ndarray  # what `trajectory.keep` copies while dense output moves it
    xs: np.ndarray  # (nx,)  dense output and the guess of a first step
    ys: np.ndarray  # (ny,)
    yds: np.ndarray  # (ny,)
    remembered: np.ndarray  # (angles + slots,)  angles of joints at the last accepted point, and what forces remember
    frames: np.ndarray  # (angles, 9)  f, g and h of each angle; see joint_table.py
    joints: np.ndarray  # int64 (angles, 4)  where its two bodies' coordinates begin, and how many they are
    tableau: np.ndarray  # the method's numbers
    memory: np.ndarray  # the method's scratch
    block: np.ndarray  # the present step's: start, h, end, chart, the interpolant's data
    clock: np.ndarray  # T ... STABLE
    numbers: np.ndarray  # int64, FIRST_ORDER ... WAITING; STAGE_AT: where an implicit method leaves its last stage


class Record(NamedTuple):
    """What is asked of a run and what it records: arrays of its own, unlike those of `Run`."""

    t_eval: np.ndarray  # output times, or empty: every step
    stops: np.ndarray  # (stops, 2)  times at which a step ends, increasing, and whether Python is asked there
    out: np.ndarray  # (rows, 1 + 3 n + angles + slots)  t, q, qd, qdd, remembered
    history: np.ndarray  # (rows, 3)  t, h, accepted
    charts: np.ndarray  # (rows, 5)  t, reason, condition, contraction, steps in it; rows are closed when it is left
    points: np.ndarray  # (rows, n)  q0 of each chart, or (0, n) where nothing asks for it
    blocks: np.ndarray  # (rows, block)  those of accepted steps


def no_record():
    """An example of its type, of no rows."""
    none = np.zeros((0, 1))
    return Record(np.zeros(0), np.zeros((0, 2)), none, none, none, none, none)


def enter_joints(run, handles, remembered):
    """Let a run count the angles of a scene's joints from those remembered on."""
    if remembered.size:
        run.joints[:], run.frames[:], run.remembered[:] = handles.joints, handles.frames, remembered


def lay_out(n, nx, ny, tableau, memory, warm, block, slots, angles):
    """The `Run` of a system of sizes nx, ny, the other lengths being those of its arrays.

    slots and angles are the numbers of what forces remember and of the joints' angles.
    """
    shapes = {
        **dict.fromkeys(("x", "xd", "xd_old", "dx", "x_low", "x_low_old", "x_old", "xs"), (nx,)),
        **dict.fromkeys(("y", "yd", "dy", "y_low", "y_low_old", "y_old", "yd_old", "ys", "yds"), (ny,)),
        **dict.fromkeys(("now", "before"), (3, n)),
        "warm": (warm,),
        "remembered": (angles + slots,),
        "frames": (angles, 9),
        "tableau": (tableau,),
        "memory": (memory,),
        "block": (block,),
        "clock": (CLOCKS,),
    }
    return Run(**carve(shapes), joints=np.zeros((angles, 4), np.int64), numbers=np.zeros(NUMBERS, np.int64))


load_run = loader(lay_out(1, 1, 1, 1, 1, 1, 1, 1, 1))
