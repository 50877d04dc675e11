"""The table of cases, what is kept of each, and mistakes that concern all of them, found before the first run."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Set

import numpy as np

from ..elements.bodies import Body, PointMass
from ..errors import InvalidArgument, TsdynError
from ..observables.channels import channels_of, values_of
from ..runs.task import state_arrays
from ..simulation.parameters import fields_of, unknown_field
from ..simulation.variants import start_names, start_of
from ..validation import counted, demand_arguments, floats, shown, whole

# What functions of a user raise that an ensemble calls.


def called(function, what, argument):
    """What a function gives; raises InvalidArgument, with what the function raises as the cause."""
    try:
        return function(argument)
    except TsdynError:
        raise
    except Exception as error:
        raise InvalidArgument(f"{what} raised {type(error).__name__}: {str(error).rstrip('.')}.") from error


# What is kept of each run: its last state, the states at t_eval, channels, or what a user's function makes of it.

FINAL, TIMES = "final", "t_eval"


class KeptChannels:
    """A function `keep` of channels by name: series over t_eval, NaN after the end of a case; else the last values.

    Attributes
    ----------
    names : list of str
    count : int
        Of the times of t_eval.
    units : dict
        Of each channel by name.
    """

    def __init__(self, names, count, packed):
        self.units = {channel.name: channel.unit for channel in channels_of(packed, names)}
        self.names, self.count = list(self.units), count

    def __call__(self, solution):
        """The values of each channel by name."""
        found = np.full((len(self.names), self.count or 1), np.nan)
        part = solution if self.count else solution[-1:]
        found[:, : part.t.size] = values_of(part, channels_of(part.packed, self.names)).T
        return dict(zip(self.names, found if self.count else found[:, 0], strict=True))

    def __repr__(self):
        return f"<channels {self.names}>"


def keep_of(keep, times, packed):
    """What is kept: a word, or a function of the Solution, as which names of channels are taken; InvalidArgument."""
    if keep == TIMES and isinstance(keep, str) and not times.size:
        raise InvalidArgument("keep='t_eval' keeps the states at the times of t_eval=; give them.")
    if callable(keep) or (isinstance(keep, str) and keep in (FINAL, TIMES)):
        return keep
    try:
        return KeptChannels(keep, times.size, packed)
    except InvalidArgument as error:
        raise InvalidArgument(
            f"keep must be 'final', 't_eval' or a function of the Solution, or names of channels: {error}"
        ) from None


def record_of(keep, outcome, n, times):
    """Arrays of a run by name: t, q, qd."""
    end = outcome.end
    if keep != TIMES:
        return {"t": end.reached, "q": end.last[0], "qd": end.last[1]}
    q = np.full((2, times.size, n), np.nan)
    rows = outcome.rows
    q[:, : len(rows)] = rows[:, 1 : 1 + 2 * n].reshape(-1, 2, n).swapaxes(0, 1)
    return {"t": end.reached, "q": q[0], "qd": q[1]}


def coordinate_names(bodies):
    """Names of the coordinates of packed bodies, "crank.x" and so on, (n,)."""
    return [f"{body.name}.{x}" for body in bodies for x in ("x", "y", "z", "e0", "e1", "e2", "e3")[: body.dimension]]


def reduced(keep, solution):
    """What a user's function makes of a solution: arrays by name; "" stands for one without a name."""
    found = called(keep, "keep", solution)
    found = dict(found) if isinstance(found, Mapping) else {"": found}
    arrays = {}
    for name, value in found.items():
        array = np.asarray(value, float) if isinstance(value, (bool, np.bool_)) else floats(value)
        if array.dtype != float or array.size == 0:
            raise InvalidArgument(
                f"keep must return numbers, arrays of numbers or a mapping of them, got {shown(value)}."
            )
        arrays[f"kept {name}".rstrip()] = array
    return arrays


# The table of cases: for each parameter a value of its own in each case, or one for all.

MATRIX = 2  # dimensions of an inertia
NO_NUMBERS = "USbcmM"  # kinds of arrays: text, truth values, complex, times


class Cases:
    """Values by case.

    Attributes
    ----------
    columns : dict
        Name -> array of which the first dimension is the case; of what differs from case to case.
    fixed : dict
        Name -> value for all cases.
    count : int
    """

    def __init__(self, columns, fixed, count):
        self.columns, self.fixed, self.count = columns, fixed, count

    @property
    def names(self):
        """Names of the parameters of every case."""
        return (*self.columns, *self.fixed)

    def values(self, i):
        """Values of case i by name."""
        return {name: column[i] for name, column in self.columns.items()} | self.fixed

    def part(self, cases):
        """Some of the cases, a slice, as a table of their own."""
        columns = {name: column[cases] for name, column in self.columns.items()}
        return Cases(columns, self.fixed, len(range(self.count)[cases]))

    @property
    def table(self):
        """Name -> array (cases, ...), what is fixed repeated."""
        same = {name: np.broadcast_to(value, (self.count, *np.shape(value))) for name, value in self.fixed.items()}
        return {**self.columns, **same}


class CalledCases:
    """Cases whose values a function gives."""

    names = None  # they may be others in each case

    def __init__(self, function, count, first=0):
        self.function, self.count, self.first = function, count, first

    def values(self, i):
        """As of `Cases`."""
        found = called(self.function, "the function of cases", self.first + i)
        if not isinstance(found, Mapping):
            raise InvalidArgument(f"the function of cases must return a mapping of names to values, it gave {found!r}.")
        return dict(found)

    def part(self, cases):
        """As of `Cases`."""
        chosen = range(self.count)[cases]
        return CalledCases(self.function, len(chosen), self.first + chosen.start)

    @property
    def table(self):
        """As of `Cases`; lists where values don't make an array."""
        every = [self.values(i) for i in range(self.count)]
        return {name: np.array([values.get(name, np.nan) for values in every]) for name in (every[0] if every else ())}


def cases_of(scene, parameters, count):
    """Return the cases that a user gives: a mapping, a DataFrame, or a function with the number of cases.

    Raises
    ------
    InvalidArgument
        If a name is unknown, lengths differ, or the number of cases isn't known.
    """
    count = whole(count, "cases")
    if callable(parameters):
        if count is None:
            raise InvalidArgument("a function of the case needs the number of cases: cases=1000.")
        return CalledCases(parameters, count)
    fields = fields_of(scene)
    columns, fixed = {}, {}
    for name, given in _listed(parameters).items():
        if name not in fields:
            raise unknown_field(name, fields)
        values, several = _column(name, given, fields[name])
        (columns if several else fixed)[name] = values
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        said = ", ".join(f"{name}: {length}" for name, length in lengths.items())
        raise InvalidArgument(f"parameters must have as many values as there are cases, got {said}.")
    known = next(iter(lengths.values()), None)
    if known == 0:
        raise InvalidArgument(
            f"the table has no cases: there are no values of {', '.join(lengths)}. Give arrays with one for each case."
        )
    if count is not None and known not in (None, count):
        raise InvalidArgument(f"cases={count!r}, but the parameters have {counted(known, 'value')} each.")
    return Cases(columns, fixed, known if known is not None else count or 1)


def _listed(parameters):
    """A mapping of names to values; of a DataFrame its columns."""
    if isinstance(parameters, Mapping):
        return dict(parameters)
    if hasattr(parameters, "columns") and hasattr(parameters, "__getitem__"):
        if not len(parameters):
            raise InvalidArgument("the table has no cases: the DataFrame has no rows. Has a selection left none?")
        return {str(name): list(parameters[name]) for name in parameters.columns}
    several = "; of mappings, one for each case, make a DataFrame: pandas.DataFrame(parameters)"
    raise InvalidArgument(
        "parameters must be a mapping of names to arrays, a DataFrame, or a function of the case, got "
        f"{type(parameters).__name__}{several if isinstance(parameters, (list, tuple)) else ''}."
    )


def _column(name, given, field):
    """Values of a parameter as an array, and whether it has one value a case."""
    if hasattr(given, "as_quat") and not isinstance(given, type):  # rotations of SciPy: the scalar is last
        given = np.roll(given.as_quat(), 1, axis=-1)
    if isinstance(given, (Set, Mapping)) or inspect.isgenerator(given):
        raise InvalidArgument(f"{name}: give the values of the cases as a list or an array, not as {given!r}.")
    array = _array(given)
    if field.is_numeric and array.dtype.kind not in "iuf":
        _demand_numbers(name, given, array)
    if array.dtype.kind not in "iuf":  # functions of time, for instance
        return (array, True) if array.ndim else (given, False)
    array = array.astype(float)
    dimensions = np.ndim(field.value) if field.is_numeric else 0
    if field.attribute == "inertia" and isinstance(field.owner, Body) and array.ndim == MATRIX:
        if array.shape == (3, 3) and (array == array.T).all():
            raise InvalidArgument(
                f"{name} is one matrix or three cases of principal values; give an array (cases, 3, 3)."
            )
        return array, True
    least = 1 if dimensions == MATRIX else dimensions  # principal values do for a matrix
    if array.ndim not in range(least, dimensions + 2):
        raise InvalidArgument(
            f"{name}: values of shape {array.shape} are neither one for all cases nor one for each; a value is "
            f"{'a number' if dimensions == 0 else f'an array of shape {np.shape(field.value)}'}."
        )
    array.setflags(write=False)
    return (array, True) if array.ndim > dimensions else (float(array) if dimensions == 0 else array, False)


def _demand_numbers(name, given, array):
    """Raise InvalidArgument where values of a number are text, truth values, dates or complex; functions may be."""
    for i, value in enumerate(given if array.ndim else [given]):
        if _array(value).dtype.kind not in NO_NUMBERS:
            continue
        where = f" in case {i}" if array.ndim else ""
        raise InvalidArgument(
            f"{name} must be numbers, got {shown(value)}{where}. Convert the values first, such as by "
            "np.asarray(values, float)."
        )


def started(scene, values, t, free):
    """Values of a case of a scene by name, with those of its start at t; free: names of the bodies that may move."""
    if free is None:
        return values
    case = scene.with_parameters(values)
    case.assemble(t=t, free=free)
    return {**values, **start_of(case)}


def _array(given):
    try:
        return np.array(given)
    except ValueError:  # ragged
        found = np.empty(len(given), object)
        found[:] = list(given)
        return found


# What is wrong with every case of an ensemble, found before the first one runs.


def demand_whole(study):
    """Check what all cases of a study have in common: functions, state, method, table.

    Raises
    ------
    TsdynError
        A subclass; names the argument.
    """
    state, cases = study.call.state, study.cases
    if callable(study.keep):
        demand_arguments(study.keep, "keep", ("solution",))
    if cases.names is None:
        demand_arguments(cases.function, "the function of cases", ("case",))
    for event in study.events or ():
        demand_arguments(event.function, event.name, ("t", "state"))
    if state is not None:
        _demand_state(study, state)
    if cases.names is not None:
        table = (*cases.columns.values(), *cases.fixed.values())
        is_of_numbers = all(np.asarray(values).dtype.kind == "f" for values in table)
        if study.method.driver == "series" and study.kept.refusal and is_of_numbers:
            raise InvalidArgument(study.kept.refusal)
        _demand_shapes(study)
        _demand_fixed(study)


def _demand_state(study, state):
    state_arrays(state, study.n)
    both = sorted(start_names(study.kept.packed) & {*(study.cases.names or ())})
    if both:
        raise InvalidArgument(
            f"{', '.join(both)} and state: every case starts from the state, whatever the table says; leave one of "
            "them out."
        )


def _demand_shapes(study):
    """Raise InvalidArgument where the values of a column have a shape that their attribute doesn't take."""
    for name, column in study.cases.columns.items():
        field = study.family.fields[name]
        shape, value = column.shape[1:], np.asarray(field.value) if field.is_numeric else None
        if column.dtype.kind != "f" or value is None or shape == value.shape:
            continue
        if field.attribute == "inertia" and isinstance(field.owner, Body) and shape == (3,):
            continue
        try:
            study.scene.with_parameters({name: np.resize(value, shape)})
        except TsdynError:
            raise InvalidArgument(
                f"{name}: the values of the cases have the shape {shape}, and must have {value.shape}, that of the "
                "scene's own."
            ) from None


def _demand_fixed(study):
    """Raise what an attribute does where a value for all cases is inadmissible.

    Whether it fits may depend on others of its owner that differ from case to case, unless that is a body.
    """
    fields, cases = study.family.fields, study.cases
    varied = {id(fields[name].owner) for name in cases.columns if not isinstance(fields[name].owner, PointMass)}
    fixed = {name: value for name, value in cases.fixed.items() if id(fields[name].owner) not in varied}
    if fixed:
        study.scene.with_parameters(fixed)
