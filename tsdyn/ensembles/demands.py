"""What is wrong with every case of an ensemble, told before the first one runs."""

from __future__ import annotations

import numpy as np

from ..elements.bodies import Body, PointMass
from ..errors import InvalidArgument, TsdynError
from ..runs.arguments import state_arrays
from ..simulation.variants import start_names
from ..taylor.series_engine import SeriesEngine
from .user_functions import demand_arguments


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
    form = study.options.form
    if study.method.driver == "series" and form.name != "tangent":
        SeriesEngine(study.kept, study.method, form, study.within)  # says which methods serve the form
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
