"""Outlines of scenes in files: a scene without what only its owner can pass again, and what it leaves out."""

import numpy as np

from ..errors import StorageError
from ..model.handles import handles_of
from ..validation import demand, demand_record


class Lacking(StorageError):
    """A file alone doesn't give the scene."""


def width_of(packed):
    """How many numbers are remembered with each output: angles of joints, and what forces remember."""
    return handles_of(packed).count + packed.system.memory.size


def row_labels(packed):
    """Title and label of each row of Phi."""
    seen = {}
    for member in packed.members:
        title = member.constraint.title
        seen[title] = seen.get(title, 0) + 1
        again = "" if seen[title] == 1 else f" #{seen[title]}"
        yield from ((title + again, label) for label in member.constraint.row_labels)


def outline_of(scene, packed):
    """Numbers and arrays of the outline of a scene; ({}, {}) where nothing is left out, or nothing else is there."""
    from ..files import scene_text  # what a plain run imports none of

    text, left = scene_text.write_outline(scene, type(scene))
    if not left or not text:
        return {}, {}
    angles = [row.item.name for row in handles_of(packed).rows for _ in row.angles]
    rows = [list(labels) for labels in row_labels(packed)]
    numbers = {"left_out": left, "angles": angles, "rows": rows, "width": width_of(packed)}
    return {"outline": numbers}, {"outline": np.frombuffer(text.encode(), np.uint8)}


def scene_of(known, text, why, kind):
    """The scene of the outline that numbers and a text (bytes, as an array) tell, which lacks something; `why` says.

    Raises
    ------
    KeyError, TypeError or ValueError
        If they tell none.
    """
    from ..files import scene_text

    demand_record(known, {"left_out": list, "angles": list, "rows": list, "width": int})
    demand(0 <= len(known["angles"]) <= known["width"], "the angles of joints")
    demand(all(isinstance(word, str) for word in (*known["left_out"], *known["angles"])), "names")
    scene = scene_text.read(text.tobytes().decode(), "its outline", kind, None)[0]
    scene._lacks = f"{why} Without it there is no {', '.join(known['left_out'])}."
    return scene


def complete(found, known):
    """Let an `Outline` know which of the remembered numbers are angles of joints that are here, and its rows."""
    here = {row.item.name for row in found.handles.rows}
    found._columns = [i for i, name in enumerate(known["angles"]) if name in here]
    found._row_labels, found._width = [[str(title), str(label)] for title, label in known["rows"]], known["width"]
