"""What `Ensemble.save` writes: numbers, words and the text of the scene; no code, no pickle."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._version import __version__
from ..errors import InvalidArgument
from ..files import scene_text
from ..simulation.stored_runs import demand_path, hash_of

if TYPE_CHECKING:
    from ..hints import Ensemble, Place

FORMAT = "tsdyn ensemble"
REDUCED = "function"  # what is said of a function `keep`


def save(ensemble: Ensemble, path: Place) -> Path:
    """As of `Ensemble.save`."""
    from ..storage import saved_file

    demand_path(path, "path")
    path = Path(path).absolute()
    saved_file.format_at(path, "an ensemble")
    record, arrays = _content(ensemble)
    attributes = {"source": f"tsdyn {__version__}", "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())}
    saved_file.write(path, {}, None, attributes, (record, arrays), FORMAT)
    return path


def _content(ensemble):
    """Numbers, and arrays by name."""
    study, parameters = ensemble._study, ensemble.parameters
    arrays = {"status": ensemble.status, "reached": ensemble.reached, "q": ensemble.q, "qd": ensemble.qd}
    arrays |= {"times": ensemble.times}
    reductions = ensemble.reductions()
    for i, (name, values) in enumerate(parameters.items()):
        if np.asarray(values).dtype.kind not in "iuf":
            raise InvalidArgument(f"the parameter {name} has values that are no numbers, and a file holds no code.")
        arrays[f"parameter_{i}"] = np.asarray(values)
    arrays |= {f"kept_{i}": np.asarray(values) for i, values in enumerate(reductions.values())}
    options, lacking = _plain(study.given)
    record = {
        "count": len(ensemble),
        "keep": REDUCED if callable(study.keep) else study.keep,
        "is_single": callable(study.keep) and not isinstance(ensemble.kept, dict),
        "kept": list(reductions),
        "parameters": [[name, ensemble.unit(name)] for name in parameters],
        "coordinates": ensemble.coordinates,
        "messages": {str(i): said for i, said in ensemble._results.messages.items()},
        "reason": ensemble._results.reason,
        "threads": ensemble.threads, "lanes": ensemble.lanes, "interrupted": ensemble.interrupted,
        "free": study.free, "options": options, "lacking": lacking,
    }  # fmt: skip
    numbers, held = ensemble._scene_record()
    return record | numbers, {name: np.asarray(array) for name, array in (arrays | held).items()}


def scene_record(scene):
    """Numbers and arrays of a scene, or what keeps a file from holding it."""
    record = {"scene": hash_of(scene.packed)}
    try:
        return record, {"scene": np.frombuffer(scene_text.write(scene, type(scene)).encode(), np.uint8)}
    except InvalidArgument as error:
        return record | {"lacks": str(error)}, {}


def _plain(given):
    """Options of `simulate` that are data, and the names of those that are none."""
    options, lacking = {}, []
    for name, value in given.items():
        if name in ("scene", "progress"):
            continue
        value = value.tolist() if isinstance(value, np.ndarray) else value
        try:
            options[name] = json.loads(json.dumps(value, default=_number))
        except TypeError:
            lacking.append(name)
    return options, lacking


def _number(value):
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError
