"""Figures of ensembles: bands of quantiles over time, maps of one value over one or two parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..drawing import BLUE, axes_of, bare, figure_of, is_picture, save
from ..errors import InvalidArgument
from ..validation import nearest

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ..hints import Ensemble

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
PLANE = 2  # parameters of a map at most
DARKEST = 0.45  # opacity of all bands together


@figure_of("reductions")
def quantile_bands(
    ensemble: Ensemble, what: str, ax: Any = None, *, quantiles: Sequence[float] = QUANTILES, unit: str | None = None
) -> Any:
    """Draw quantiles over all cases of a series, over time: bands between pairs of them, the middle one as a line.

    Parameters
    ----------
    ensemble : Ensemble
        With `t_eval`.
    what : str
        A coordinate of keep="t_eval", such as "bob.x", its rate as "bob.x rate"; a channel kept over t_eval; or the
        name of a series (k,) that a function `keep` returned, "kept" if it returned nothing else.
    ax : matplotlib Axes, optional
        Where to draw; default new axes of pyplot's.
    quantiles : sequence of float
        From 0 to 1, symmetric or not; default 5, 25, 50, 75 and 95 %.
    unit : str, optional
        Of what a function returned, for the label.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidArgument
        If there is no such series, or a quantile is not from 0 to 1.

    Examples
    --------
    >>> import numpy as np
    >>> import tsdyn as ts
    >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0, name="stone")
    >>> speeds = np.linspace(4.0, 6.0, 9)[:, None] * (0, 0, 1)
    >>> throws = ts.ensemble(scene, {"stone.velocity": speeds}, (0, 1), keep="t_eval", t_eval=np.linspace(0, 1, 11))
    >>> from matplotlib.figure import Figure
    >>> ts.plots.quantile_bands(throws, "stone.z", Figure().subplots()).get_ylabel()
    'stone.z (m)'
    """
    levels = np.sort(np.atleast_1d(np.asarray(quantiles, float)))
    if levels.ndim != 1 or not levels.size or not ((levels >= 0.0) & (levels <= 1.0)).all():
        raise InvalidArgument(f"quantiles must be numbers from 0 to 1, got {quantiles!r}.")
    values, known = value_of(ensemble, what)
    times = ensemble.times
    if values.ndim != 2 or values.shape[1] != times.size:
        raise InvalidArgument(
            f"{what!r} is no series over t_eval: its shape is {values.shape[1:]} for {times.size} times. Keep one, or "
            "draw it with ts.plots.final_map."
        )
    ax = axes_of(ax)
    some = values[~np.isnan(values).all(axis=1)]
    found = np.full((levels.size, times.size), np.nan)
    there = ~np.isnan(some).all(axis=0) if len(some) else np.zeros(times.size, bool)
    found[:, there] = np.nanquantile(some[:, there], levels, axis=0) if there.any() else found[:, there]
    pairs = levels.size // 2
    for i in range(pairs):
        label = f"{100 * levels[i]:g} to {100 * levels[-1 - i]:g} %"
        ax.fill_between(times, found[i], found[-1 - i], color=BLUE, alpha=DARKEST / pairs, linewidth=0, label=label)
    if levels.size % 2:
        ax.plot(times, found[pairs], color=BLUE, linewidth=1.4, label=f"{100 * levels[pairs]:g} %")
    ax.set(xlabel="time (s)", ylabel=_label(what, unit or known))
    ax.legend(frameon=False, fontsize=9)
    bare(ax)
    return ax


@figure_of("reductions")
def final_map(
    ensemble: Ensemble, what: str, over: str | Sequence[str], ax: Any = None, *, unit: str | None = None
) -> Any:
    """Draw one value of each case over one parameter, or over two as colours.

    Parameters
    ----------
    ensemble : Ensemble
    what : str
        A coordinate of the last state, such as "bob.x", its rate as "bob.x rate"; "reached", the time reached; a kept
        channel; or the name of a number that a function `keep` returned, "kept" if it returned nothing else.
    over : str, or two of them
        Parameters of the ensemble; "bob.velocity[0]" is a component. Two that form a grid give an image, others points.
    ax : matplotlib Axes, optional
        Where to draw; default new axes of pyplot's.
    unit : str, optional
        Of what a function returned, for the label.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidArgument
        If there is no such value or parameter.

    Examples
    --------
    >>> import numpy as np
    >>> import tsdyn as ts
    >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0, name="stone")
    >>> throws = ts.ensemble(scene, {"stone.velocity": [(1, 0, 4), (1, 0, 5), (1, 0, 6)]}, (0, 1))
    >>> from matplotlib.figure import Figure
    >>> axes = ts.plots.final_map(throws, "stone.z", "stone.velocity[2]", Figure().subplots())
    >>> axes.get_xlabel(), axes.get_ylabel()
    ('stone.velocity[2] (m/s)', 'stone.z (m)')
    """
    names = (over,) if isinstance(over, str) else tuple(over)
    if len(names) not in (1, PLANE) or not all(isinstance(name, str) for name in names):
        raise InvalidArgument(f"over must be the name of a parameter, or two names, got {over!r}.")
    values, known = value_of(ensemble, what, last=True)
    if values.ndim != 1:
        raise InvalidArgument(f"{what!r} has shape {values.shape[1:]} in each case, and a map needs one number.")
    axes = [parameter_of(ensemble, name) for name in names]
    ax = axes_of(ax)
    ax.set_xlabel(_label(names[0], axes[0][1]))
    if len(names) == 1:
        order = np.argsort(axes[0][0], kind="stable")
        ax.plot(axes[0][0][order], values[order], ".-", color=BLUE, linewidth=0.8, markersize=4)
        ax.set_ylabel(_label(what, unit or known))
        bare(ax)
        return ax
    (x, _), (y, _) = axes
    drawn = _grid(ax, x, y, values)
    if drawn is None:
        drawn = ax.scatter(x, y, c=values, s=12)
    ax.set_ylabel(_label(names[1], axes[1][1]))
    ax.figure.colorbar(drawn, ax=ax, label=_label(what, unit or known))
    return ax


def overview(ensemble: Ensemble, what: str | None, path: str | Path | None) -> Any:
    """What `Ensemble.plot` draws: bands of a series, else a map over the first one or two parameters that vary."""
    if is_picture(what) and what not in ensemble.reductions():
        raise InvalidArgument(
            f"plot: what must be a value of the ensemble, got the path {str(what)!r}. To write the figure to it: "
            f"ensemble.plot(path={str(what)!r})."
        )
    what = what or next(iter(ensemble.reductions()), None) or ensemble.coordinates[0]
    if value_of(ensemble, what)[0].ndim > 1:
        ax = quantile_bands(ensemble, what)
    else:
        over = [name for name in parameter_names(ensemble) if np.ptp(parameter_of(ensemble, name)[0]) > 0.0][:PLANE]
        if not over:
            raise InvalidArgument("no number among the parameters differs from case to case; there is nothing to draw.")
        ax = final_map(ensemble, what, over)
    if path is not None:
        save(ax.figure, path)
    return ax


def value_of(ensemble, what, last=False):
    """Values (cases, ...) by name, and their unit; of a series, `last`: at its end."""
    known = {name: (values, ensemble._channels.get(name, "")) for name, values in ensemble.reductions().items()} | {
        "reached": (ensemble.reached, "s")
    }
    if what in known:
        values, unit = known[what]
        return np.asarray(values, float), unit
    name, is_rate = (what[:-5], True) if isinstance(what, str) and what.endswith(" rate") else (what, False)
    coordinates = ensemble.coordinates
    if name not in coordinates:
        raise InvalidArgument(f"the ensemble has no value {what!r}{nearest(str(what), [*known, *coordinates])}")
    unit = "m" if name.rpartition(".")[2] in "xyz" else "1"
    values = (ensemble.qd if is_rate else ensemble.q)[..., coordinates.index(name)]
    if last and values.ndim > 1:
        values = values[:, -1]
    return values, (f"{unit}/s" if is_rate else unit)


def parameter_names(ensemble):
    """Names of all numbers among the parameters, components by their places: "bob.velocity[0]"."""
    for name, values in ensemble.parameters.items():
        array = np.asarray(values)
        if array.dtype.kind in "iuf":
            yield from [name] if array.ndim == 1 else [f"{name}[{i}]" for i in range(array[0].size)]


def parameter_of(ensemble, name):
    """Values (cases,) of a number among the parameters, and its unit."""
    known = list(parameter_names(ensemble))
    if name not in known:
        raise InvalidArgument(f"the ensemble has no parameter {name!r}{nearest(name, known)}")
    whole, found, place = name.partition("[") if name not in ensemble.parameters else (name, "", "")
    values = np.asarray(ensemble.parameters[whole], float)
    return (values.reshape(len(values), -1)[:, int(place[:-1])] if found else values), ensemble.unit(whole)


def _label(name, unit):
    return f"{name} ({unit or '1'})"


def _grid(ax, x, y, values):
    """An image, where the cases are all pairs of some x and y; else None."""
    columns, i = np.unique(x, return_inverse=True)
    rows, j = np.unique(y, return_inverse=True)
    if columns.size * rows.size != values.size or len({*zip(i.tolist(), j.tolist(), strict=True)}) != values.size:
        return None
    image = np.full((rows.size, columns.size), np.nan)
    image[j, i] = values
    return ax.pcolormesh(columns, rows, image, shading="nearest")
