"""The cases of `tsdyn stress`: scenes, durations, and what makes each one hard."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from . import rods
from .bricard import bricard
from .governor import governor
from .planar_links import driven_six_bar, four_bars, six_bars, slider_crank
from .single_bodies import kapitza, sleeping_top, struck
from .squeezer import squeezer


class Case(NamedTuple):
    """A scene, how long it runs, and the fixed steps that show the order of a method."""

    name: str
    build: Callable  # () -> Scene
    end: float  # s
    steps: tuple[float, int]  # end, s, and number of the coarsest steps of the runs with fixed steps
    hard: str  # what makes it hard
    agree: float = 0.0  # s, until when two methods are compared, where the motion is chaotic; 0 for the end


def hub(bodies=500):
    """Return a heavy wheel on a spherical joint, and rods around it."""
    return rods.build(rods.hub(bodies - 1))


def net(rows=20, columns=25):
    """Return a flat net of square meshes, a rod an edge, hung from two corners."""
    return rods.build(rods.net(rows, columns))


def _four_bars(loops, end):
    count = "one loop" if loops == 1 else f"{loops} loops"
    return Case(
        f"four-bars, {count}",
        partial(four_bars, loops),
        end,
        (0.5, 50),
        f"{3 * loops} redundant rows; flat twice a turn, where {loops + 1} directions are free and branches meet",
    )


CASES = (
    *(_four_bars(loops, 100.0 if loops < 40 else 10.0) for loops in (1, 2, 5, 40)),
    Case("Bricard's six-bar", bricard, 100.0, (1.0, 100), "mobile by its geometry alone: one row is redundant"),
    Case(
        "Andrews' squeezer",
        squeezer,
        0.03,
        (0.01, 300),
        "three loops, 9 redundant rows; the crank turns 16 rad within 0.03 s",
    ),
    Case("flyball governor", governor, 100.0, (1.0, 100), "a spring and damper between bodies that spin fast"),
    Case(
        "slider-crank",
        slider_crank,
        100.0,
        (0.15, 20),
        "equal crank and rod: at its dead centre the slider may stay, and branches meet",
    ),
    Case("six-bars, 5 loops", six_bars, 5.0, (0.5, 100), "15 redundant rows; chaotic", agree=1.5),
    Case(
        "driven six-bar",
        driven_six_bar,
        2.0,
        (0.5, 100),
        "8 redundant rows, five of them of a doubled hinge; rows that are kept at the start become dependent",
    ),
    Case("sleeping top", sleeping_top, 600.0, (0.5, 160), "upright, 7 % above the spin at which it falls"),
    Case("Kapitza's pendulum", kapitza, 10.0, (0.2, 200), "upside down, held up by a pivot that shakes at 19 Hz"),
    Case("struck pendulum", struck, 100.0, (2.0, 20), "a torque acts for a thousandth of the run"),
    Case("hub of 500 bodies", hub, 1.0, (0.1, 10), "499 rods on one body: a dense block in the Schur complement"),
    Case("net of 500 loops", net, 0.25, (0.02, 4), "1045 rods, 500 loops: the factors of the Schur complement fill"),
)
