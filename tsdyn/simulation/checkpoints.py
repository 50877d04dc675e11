"""What a checkpoint holds of a run with phases: numbers and arrays, from which the run goes on where it was."""

import numpy as np

from ..runs.driver import Sampling
from ..runs.run_log import RunEnd
from ..validation import damaged, demand
from .phase_scenes import phase_of
from .phases import Phases, UnitModes, plain
from .scene_cache import prepared

# Numbers of a run that a checkpoint holds as they are, and the names of its arrays
KEPT = "t", "rest", "counts", "steps", "taken", "at_once", "judged", "methods", "replaced", "written", "totals"
START, PREFIX = ("q", "qd", "remembered"), "phase "


class Checkpoints:
    """Mixed into `_ContactRun`: what it goes on with, where its present phase begins."""

    def _record(self):
        """What the scene of the present phase is made of, for files."""
        switched = self.packed.derived.switched is not None
        return [self.modes.saved(), self.remembered.tolist(), plain((self.inactive, self.values)), switched]

    def _recorded_scene(self, record):
        """The scene that such a record describes, and its gaps."""
        inactive, values = record[2]
        self.change(tuple(inactive), dict(values))
        self.modes, self.remembered = UnitModes.of(record[0]), np.array(record[1], float)
        demand(self.remembered.shape == (self.count + self.scene.system.memory.size,), "what is remembered")
        return self._phase_of_modes(self.every if record[3] else ()), self.gaps

    def saved(self):
        """Numbers and arrays by name."""
        phases, arrays = self.phases.saved()
        numbers = {name: getattr(self, name) for name in KEPT} | {"modes": self.modes.saved(), "phases": phases}
        numbers |= {"changes": plain((self.inactive, self.values)), "switched": sorted(self.switched)}
        numbers |= {"fast": plain(self.halting.fast if self.halting else {}), "hits": plain(self.hits)}
        starts = {"first.": self.first, "": (self.t, self.q, self.qd, self.remembered)}
        for where, (_, *parts) in starts.items():
            arrays |= {f"{where}{name}": array for name, array in zip(START, parts, strict=True)}
        numbers |= {"first": self.first[0], "sampling": self.sampling and self.sampling.saved()}
        if self.end is not None:
            arrays |= {"last": self.end.last, "ended": self.end.remembered}
            numbers["reached"] = self.end.reached
        for i, found in enumerate(self.found):
            columns = zip(*found, strict=True) if found else (np.empty(0), *2 * [np.empty((0, self.q.size))])
            for name, column in zip(("t", "q", "qd"), columns, strict=True):
                arrays[f"event {i}.{name}"] = np.concatenate(column) if found else column
        return {"phases": numbers}, {f"{PREFIX}{name}": array for name, array in arrays.items()}

    def restored_phases(self, numbers, arrays):
        """The `Phases` that were recorded."""
        phases = Phases(self.base.packed, self.gaps)
        phases.restore(numbers, arrays, self._recorded_scene)
        return phases

    def restore(self, numbers, arrays):
        """As it was when it was saved."""
        with damaged("the checkpoint"):
            known, n, arrays = numbers["phases"], self.q.size, _own(arrays)
            vars(self).update({name: known[name] for name in KEPT})
            self.phases = self.restored_phases(known["phases"], arrays)
            inactive, values = known["changes"]
            self.change(tuple(inactive), dict(values))
            self.switched |= set(known["switched"])
            self.modes, self.known_fast = UnitModes.of(known["modes"]), dict(known["fast"])
            self.hits = {i: tuple(pair) for i, pair in known["hits"]}
            if known["sampling"] is not None:
                self.sampling = Sampling(prepared(phase_of(self.scene, [])), True)
                self.sampling.restore(known["sampling"])
            starts = [[arrays[f"{where}{name}"] for name in START] for where in ("first.", "")]
            for q, qd, memory in starts:
                demand(q.shape == qd.shape == (n,) and memory.shape == self.remembered.shape, "the start of a phase")
            self.known = self.t, *starts[1]
            self.t, self.q, self.qd, self.remembered = self.first = known["first"], *starts[0]
            if "reached" in known:
                demand(arrays["last"].shape == (3, n), "the end of a phase")
                self.end = RunEnd(known["reached"], arrays["last"], arrays["ended"], self.totals, None, None)
                self.ended, self.qdd = self.end.last[1:]
            for i, found in enumerate(self.found):
                found.append(tuple(arrays[f"event {i}.{name}"] for name in ("t", "q", "qd")))


def recorded(numbers, arrays):
    """Numbers and arrays of the `Phases` in a checkpoint."""
    return numbers["phases"]["phases"], _own(arrays)


def _own(arrays):
    return {name.removeprefix(PREFIX): array for name, array in arrays.items() if name.startswith(PREFIX)}
