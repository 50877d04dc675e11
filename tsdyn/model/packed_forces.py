"""Forces packed for the kernels: one row a kind; indices and parameters of each instance in shared arrays."""

from typing import NamedTuple

import numpy as np

from ..elements.element import address, checked_parameters
from ..elements.loops.forces import INTS, kept_size
from ..elements.loops.template import AT, DIMENSION
from ..errors import InvalidForce
from ..jit.kernels import records
from ..motions.signals import Signal
from ..motions.tracing import Untraceable
from .tables import ForceKind, SignalPlace


class Load(NamedTuple):
    """One force as it was when it was packed."""

    force: object
    parameters: tuple  # floats and Signals
    coordinates: tuple  # where its markers are, (3,) each
    alone: np.ndarray  # (1,) of tables.ForceKind: a System.forces that has this instance alone
    slot: int  # of System.memory; -1 for none
    normal: int  # of System.normals; -1 for none
    programs: tuple  # for each number of par: where in System.reals the program of its series begins; -1 for none


def pack_forces(forces, where, table, reals):
    """Append the instances to `table` and `reals`; return rows of System.forces, .signals, .memory, .normals, Loads.

    Raises
    ------
    InvalidForce
        If a plug-in's parameters are no finite numbers or Signals, or Numba can't compile its kernels.
    """
    groups = {}
    for force in forces:
        groups.setdefault(id(force.kernels), []).append(force)  # user functions have kernels of their own
    rows, signals, memory, normals, loads = [], [], [], [], {}
    programs, expanded = [], {}
    for members in groups.values():
        kernels = members[0].kernels
        force_address = _address(members[0], "force")
        remember = _address(members[0], "remember") if "remember" in kernels else 0
        first, stride = (len(table), len(reals)), None
        for force in members:
            begin = len(table), len(reals)
            parameters = checked_parameters(force, Signal, "loads")
            table += _places(force, where)
            reals += np.concatenate(force.coordinates).tolist()
            for value in parameters:
                if not isinstance(value, Signal):
                    reals.append(float(value))
                    continue
                for i, motion in enumerate(value.motions):
                    signals.append([value.address, len(reals) + i, 1, -1])
                    programs.append((signals[-1], motion))
                if not value.motions:
                    signals.append([value.address, len(reals), value.width, -1])
                reals += [np.nan] * value.width  # until the time is set
            if force.memory:
                memory.append(len(reals))
                reals.append(0.0)
            if "normal_load" in kernels:
                normals.append(len(reals))
                reals.append(0.0)
            size = len(reals) - begin[1]
            if stride not in (None, size):
                raise InvalidForce(
                    f"{force.name}: parameters() must return as many values as for every other {type(force).__name__}."
                )
            stride = size
            alone = records(ForceKind, [[force_address, 0, remember, 1, stride, *begin, 0]])
            slot = len(memory) - 1 if force.memory else -1
            normal = len(normals) - 1 if "normal_load" in kernels else -1
            loads[id(force)] = Load(force, parameters, force.coordinates, alone, slot, normal, ())
            expanded[id(force)] = [motion for value in parameters for motion in _series(value)]
        rows.append([force_address, 0, remember, len(members), stride, *first, 0])
    begins = {id(None): -1}
    for motion in (*(motion for _, motion in programs), *(motion for each in expanded.values() for motion in each)):
        if id(motion) not in begins:  # one program for all that are given the same
            begins[id(motion)] = len(reals)
            reals += motion.program()
    for signal, motion in programs:
        signal[-1] = begins[id(motion)]
    for force, motions in expanded.items():
        loads[force] = loads[force]._replace(programs=tuple(begins[id(motion)] for motion in motions))
    rows, signals = records(ForceKind, rows), records(SignalPlace, signals)
    return rows, signals, memory, normals, tuple(loads[id(force)] for force in forces)


def _series(value):
    """A parameter's numbers as motions; None for what is constant, or has no series."""
    if not isinstance(value, Signal):
        return (None,)
    try:
        return value.smooth
    except Untraceable:
        return (None,) * value.width


def with_force_jacobians(packed):
    """The system of a packed scene with the forces' Jacobian loops, which are loaded now; and the floats they keep."""
    rows, total = packed.system.forces.copy(), 0
    for row in rows:
        force = members_of(row, packed.loads)[0].force
        row.jacobian, row.kept = _address(force, "jacobian"), total
        total += row.count * kept_size(force.markers)
    return packed.system._replace(forces=rows), int(total)


def find_forces(system, loads):
    """Write this process's addresses into the rows of an unpickled system; the loads with theirs."""
    signals, rows = iter(system.signals), {}
    for row in system.forces:
        members = members_of(row, loads)
        row.force, row.jacobian = _address(members[0].force, "force"), 0
        row.remember = _address(members[0].force, "remember") if row.remember else 0
        for load in members:
            alone = load.alone.copy()
            for name in ("force", "jacobian", "remember"):
                alone[name] = row[name]
            rows[id(load)] = load._replace(alone=alone)
            for value in load.parameters:
                for _ in range(max(len(value.motions), 1) if isinstance(value, Signal) else 0):
                    next(signals).address = value.address
    return tuple(rows[id(load)] for load in loads)


def members_of(row, loads):
    """The loads that a row of System.forces runs."""
    return [load for load in loads if (load.alone[0].force, load.alone[0].stride) == (row.force, row.stride)]


def _address(force, name):
    return address(force.kernels, name, force.name, InvalidForce)


def _places(force, where):
    """The table entry of one instance; the ground has dimension 0 and no place."""
    entry = np.zeros(INTS, np.int64)
    for i, body in enumerate((force.a, force.b)):
        entry[AT + i], entry[DIMENSION + i] = where.get(id(body), (0, 0))
    return entry.tolist()
