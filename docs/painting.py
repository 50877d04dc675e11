"""Pictures of runs by matplotlib: what the viewer shows, as shaded polygons, painted from back to front.

Parts, links and poses are those of `solution.view()`, so that a picture needs no browser.
"""

import numpy as np

from tsdyn.drawing import BLUE, GREEN, VERMILION
from tsdyn.graphics.run_data import run_data
from tsdyn.graphics.symbols import attached
from tsdyn.graphics.view import Painter


def paint(axes, solution, shapes=None, at=(1.0,), trails=None, layers=("bodies", "joints")):
    """Paint a solution at fractions `at` of its time, the earlier ones paler, with the trails of its bodies."""
    from matplotlib.collections import PolyCollection

    painter = Painter(run_data(solution, shapes=shapes, trails=trails))
    for trail in painter.data["trails"]:
        axes.plot(*painter.way(trail).T, color=BLUE, linewidth=0.8, alpha=0.6, zorder=1)
    for i, fraction in enumerate(at):
        k = round(fraction * (painter.data["frames"] - 1))
        flats, tones = painter.polygons(k, layers, 0.25 + 0.75 * (i + 1) / len(at))
        axes.add_collection(PolyCollection(flats, facecolors=tones, edgecolors=tones, linewidths=0.2, zorder=2 + i))
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.axis("off")


def markers(axes, solution, item):
    """Draw the points and directions of a constraint or force at the end of a run, with their names; return these."""
    painter, item = Painter(run_data(solution)), getattr(item, "owner", None) or item
    found = next((each for many in attached(solution.packed) for each in many if each.item is item), None)
    length = 1.3 * max(painter.data["bulk"])
    named = {}
    for marker in item.markers if found else ():
        place = found.places.get(marker.argument)
        if place is None or len(place) != 3:
            continue
        r, A = painter.pose(-1, found.a if marker.body == "a" else found.b)
        ends = [r + A @ found.point(marker.body)]
        if not marker.argument.startswith("point"):
            if not np.any(place):
                continue
            ends.append(ends[0] + length * (A @ place) / np.linalg.norm(place))
        named[marker.argument] = _pointer(axes, painter.flat(np.array(ends)), marker)
    axes.autoscale_view()
    return list(named)


def _pointer(axes, ends, marker):
    """A dot at a point, an arrow along a direction, and its name."""
    colour = VERMILION if marker.body == "a" else GREEN
    axes.plot(*ends[:1].T, "o", color=colour, markersize=4, zorder=20)
    if len(ends) == 2:
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", ends[1], ends[0], arrowprops=style, zorder=20)
        axes.update_datalim([ends[1]])
    shift = (4, 4) if marker.body == "a" else (4, -10)
    axes.annotate(marker.argument, ends[-1], shift, textcoords="offset points", color=colour, fontsize=8, zorder=21)
