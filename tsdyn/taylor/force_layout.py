"""Memory layout of the series of forces: what each kind runs, and where its instances are."""

from itertools import groupby
from typing import NamedTuple

import numpy as np

from ..elements.element import address
from ..elements.loops import force_series
from ..elements.loops.friction_series import FRICTION_ROWS
from ..errors import InvalidForce
from ..jit.aligned_arrays import zeros
from ..jit.kernels import records
from ..model.packed_forces import members_of
from ..model.state_loads import changes_with_state
from ..motions.program import run_program
from ..motions.signals import Signal
from ..motions.state_program import ROWS, run_order
from .tables import ForceSeries, MotionSeries


class ForceLayout(NamedTuple):
    """Parts of an `Expansion`."""

    forces: np.ndarray
    table: np.ndarray
    loads: np.ndarray
    drives: np.ndarray


class _Kind(NamedTuple):
    """How the series of some instances of a kind are run."""

    names: tuple  # of the kernels of series, check and margin; None for none
    sharp: bool  # whether every step is checked at all places
    rows: int  # of the scratch of each
    program: list  # of a traced function


def lay_out_forces(packed, orders):
    """The `ForceLayout` of a packed scene, with what is constant in it."""
    nb = len(packed.bodies)
    index = {id(body): i for i, body in enumerate(packed.bodies)}
    rows, table, drives, written, total = [], [], [], [], 0
    for row in packed.system.forces:
        reals = int(row.reals)
        for _, group in groupby(members_of(row, packed.loads), _is_driven):  # instances of a kind are run together
            # Instances that run the same loop in one go
            members = list(group)
            force = members[0].force
            kind = _kind(members)
            found = (address(force.kernels, name, force.name, InvalidForce) if name else 0 for name in kind.names)
            loop, check, margin = found
            width = _width(force, kind, orders, force.sharp or _is_driven(members[0]))
            run = run_order.address if kind.program else 0
            rows.append([loop, total, width, len(members), row.stride, len(table), reals])
            rows[-1] += [check, margin, int(kind.sharp), 0, run, int(kind.sharp and changes_with_state(members[0]))]
            written.append((total, kind.program))
            total += len(kind.program)
            for i, load in enumerate(members):
                # A driven force reads the series of its loads from its scratch
                pair = [index.get(id(body), nb) for body in (load.force.a, load.force.b)]
                table += [*pair, (pair[0] == nb) | (pair[1] == nb) << 1]
                if _is_driven(load):
                    first = total + i * width + orders * (8 * len(force.markers) + force.slots)
                    _drive(load, first, orders, drives, written)
            total += len(members) * width
            reals += len(members) * int(row.stride)
    loads = zeros(total + 4)
    for at, numbers in written:
        loads[at : at + len(numbers)] = numbers
    return ForceLayout(records(ForceSeries, rows), np.array(table, np.int64), loads, records(MotionSeries, drives))


def _is_driven(load):
    return any(isinstance(value, Signal) for value in load.parameters)


def _kind(members):
    """The `_Kind` of instances that are alike."""
    load, force = members[0], members[0].force
    # A traced function: every step is checked
    if hasattr(force.kernels, "program"):
        program = force.kernels.program(len(load.parameters))
        return _Kind(("series", "check", None), True, int(program[ROWS]), program)
    # Friction in proportion to a normal load: the same
    if load.normal >= 0:
        size = sum(marker.size for marker in force.markers)
        return _Kind(("series", "check", None), True, force.slots + size + FRICTION_ROWS, [])
    # Other laws: checked everywhere if sharp, or where the margin of analyticity is used up
    signals = [value for each in members for value in each.parameters if isinstance(value, Signal)]
    sharp = force.sharp or not all(signal.entire for signal in signals)
    before, numbers = ("driven_", load.alone[0].stride - 3 * len(force.markers)) if signals else ("", 0)
    check = before + "check" if sharp or force.positive != () else None
    margin = before + "margin" if force.positive and not sharp else None
    return _Kind((before + "series", check, margin), sharp, force.slots + numbers, [])


def _width(force, kind, orders, keeps):
    """Floats of an instance; keeps: whether x and xd are kept."""
    size = sum(marker.size for marker in force.markers)
    rows = kind.rows + (2 * size if keeps else 0) + (-(-kind.rows // orders) if kind.program else 0)
    return force_series.instance_width(len(force.markers), rows, orders)


def _drive(load, first, orders, drives, written):
    """The rows of the series of par, from `first` on: what a program writes, and what is constant."""
    numbers = [x for value in load.parameters for x in ([None] * value.width if isinstance(value, Signal) else [value])]
    for j, (number, program) in enumerate(zip(numbers, load.programs, strict=True)):
        if number is None:
            drives.append([run_program.address, program, first + j * orders])
        else:
            written.append((first + j * orders, [float(number)]))
