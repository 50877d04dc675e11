"""The phases of a run with contacts: what its solution asks of them, and what files hold of them."""

import json
from dataclasses import dataclass, field
from itertools import starmap
from typing import NamedTuple

import numpy as np

from ..drawing import Listing
from ..errors import StorageError
from ..formulations.locked_orientations import keep_turning
from ..model.handles import first_rows, handles_of
from ..observables import diagnostics, reactions
from ..observables.state import StatePhase
from ..rows.constraint_graph import graph_of, set_redundant
from ..runs.dense_output import StepPieces
from ..validation import demand, demand_record
from .grips import add_friction, losses


@dataclass
class UnitModes:
    """The modes of the units of a scene: numbers of gaps, and of frictions. All others are open, or slide."""

    closed: list = field(default_factory=list)  # with reactions
    idle: list = field(default_factory=list)  # closed by what others hold
    opened: dict = field(default_factory=dict)  # time, gap, rate, rounding of the gap where one has just opened
    sticking: dict = field(default_factory=dict)  # frictions that stick: how many rows hold each
    blocked: list = field(default_factory=list)  # frictions without motion that others hold
    turning: dict = field(default_factory=dict)  # frictions that begin to slide: m/s, up to which they keep directions
    begun: dict = field(default_factory=dict)  # time and acceleration where a friction has begun to slide
    sharing: dict = field(default_factory=dict)  # those at rest that share a load: how many rows hold each, or could
    limits: dict = field(default_factory=dict)  # loads that count as none: of frictions that stick, and that have none
    grips: dict = field(
        default_factory=dict
    )  # of closed contacts with friction: rows of the slip that hold; None: slides
    slack: dict = field(default_factory=dict)  # closed with a reaction of rounding: how far below zero it leaves, N
    lifted: list = field(default_factory=list)  # opened to flights below rounding of the gap, which end at the top
    rising: dict = field(default_factory=dict)  # time and acceleration where a contact has begun to slide
    spread: dict = field(default_factory=dict)  # of contacts whose reactions are shared, see `ContactState.spread`
    dependent: list = field(default_factory=list)  # closed ones whose rows depend on others, see shared_loads.py

    def sticks(self, i):
        """Whether a contact with friction sticks."""
        return self.grips.get(i) is not None

    def slides(self, i):
        """Whether a contact slides with friction."""
        return self.grips.get(i, ()) is None

    def same(self, other):
        """Whether the units are in the same modes, whatever has just opened."""
        return {**vars(self), "opened": 0} == {**vars(other), "opened": 0}

    def saved(self):
        """Lists of numbers, for JSON: one for each field, of a dict its items."""
        return [plain(value) for value in vars(self).values()]

    @classmethod
    def of(cls, record):
        """As it was when it was saved."""
        pairs = zip(vars(cls()).items(), record, strict=True)
        return cls(*(_entries(known) if isinstance(value, dict) else known for (_, value), known in pairs))


def _entries(pairs):
    return {key: tuple(value) if isinstance(value, list) else value for key, value in pairs}


def plain(value):
    """A value of modes, or of what actions have changed, as JSON has it."""
    if isinstance(value, dict):
        return [[plain(key), plain(each)] for key, each in value.items()]
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


class Impulse(float):
    """The normal impulse of a contact, N s, or N m s of an angle.

    Attributes
    ----------
    tangential : ndarray (3,)
        The impulse of its friction on a, ground frame, N s.
    """

    def __new__(cls, normal, tangential=(0.0, 0.0, 0.0)):
        """As a float, the normal impulse."""
        made = super().__new__(cls, normal)
        made._tangential = tuple(tangential)
        return made

    @property
    def tangential(self):
        """That of friction on a (3,), ground frame, N s; zeros without friction."""
        return np.array(self._tangential, float)


class _Phase(NamedTuple):
    start: float
    end: float
    names: tuple[str, ...]


class RunPhase(_Phase):
    """Start and end of a phase, s, and the names of what holds in it.

    Attributes
    ----------
    start, end : float, s
    names : tuple of str
        Closed contacts, frictions that stick, and parts that come and go where they are active.
    sticking : tuple of str
        Those of them that stick.
    """

    sticking: tuple[str, ...] = ()

    @classmethod
    def of(cls, start, end, held):
        """From a list of names, in which those that stick stand twice."""
        made = cls(start, end, tuple(dict.fromkeys(held)))
        made.sticking = tuple(name for name in made.names if held.count(name) > 1)
        return made


class PhaseList(Listing):
    """The phases of a run."""

    heads = "start (s)", "end (s)", "holds", "sticks"

    def _cells(self, entry):
        return [f"{entry.start:.9g}", f"{entry.end:.9g}", ", ".join(entry.names), ", ".join(entry.sticking)]


class ImpulseList(Listing):
    """The impulses of a run."""

    heads = "time (s)", "of", "impulse (N s or N m s)", "of friction, on a (N s)"

    def _cells(self, entry):
        t, name, p = entry
        rubs = isinstance(p, Impulse) and p.tangential.any()
        return [f"{t:.9g}", name, _numbers(p), _numbers(p.tangential) if rubs else ""]


def _numbers(p):
    return ", ".join(f"{x:.6g}" for x in np.atleast_1d(p) + 0.0)


RECORD = {"modes": list, "derived": list, "names": list, "contacts": list, "changes": list, "changed": list}


class Phases:
    """The phases of a run: when, with which units in which modes, and where their rows are in those of the scene.

    Parameters
    ----------
    packed : Packed
        Of the scene with the rows of all units.
    gaps : Gaps
        Of this scene. Phases with other parameters have their own.

    Attributes
    ----------
    list : list of (float, float, tuple of str)
        Start, end (s) and names of the closed contacts, then of what sticks, which stand there twice.
    impulses : list of (float, str, Impulse or ndarray)
        Time (s), name, impulse: see `Solution.impulses`.
    starts : list of float
        s; before those of `list` where flights that are none are left out.
    gains : dict of int to float
        Change of the kinetic energy (J) at the beginning of phases, by their numbers: what impacts took.
    changes : list of (tuple of str, dict)
        What actions had changed before each phase: names of the parts that are inactive, and parameters by name.
    """

    ARRAYS = "phases", "impulses", "gains"  # that are saved

    def __init__(self, packed, gaps):
        self.whole, self.gaps, self.list, self.impulses = packed, gaps, [], []
        self.starts, self.of, self.gains, self.changes = [], [], {}, []
        self.packed, self.modes, self._gaps, self._wholes, self._known = [], [], [], [], {}  # of each kind of phase
        self._columns = {}  # of kinds, when it has been asked for
        self.scenes = []  # of each kind, of phases that were restored

    def __setstate__(self, state):
        """Let handles of the scene stand for those of phases with other parameters again."""
        vars(self).update(state)
        own = handles_of(self.whole)
        for packed in (*self.packed, *(gaps.packed for gaps in self._gaps)):
            other = handles_of(packed)
            if other.bodies[0] is not own.bodies[0]:
                other.add_aliases(zip((*own.bodies, *own.items), (*other.bodies, *other.items), strict=True))

    @property
    def varies(self):
        """Whether forces or numbers differ between phases, not rows alone."""
        forces = {load.force.name for load in self.whole.loads}
        return any(values or not forces.isdisjoint(inactive) for inactive, values in self.changes)

    def kind(self, packed, modes, whole, gaps):
        """The number of the kind of phases that are packed so.

        modes: a function that returns what makes its scene again, for files. whole, gaps: of the scene with its
        parameters, packed.
        """
        kind = self._known.setdefault(id(packed), len(self.packed))
        if kind == len(self.packed):
            self.packed.append(packed)
            self.modes.append(modes())
            self._gaps.append(gaps)
            self._wholes.append(whole)
        return kind

    def add(self, kind, begin, rest, end, names, changes):
        """Add the next phase: from `begin`, s, or as `list` has it from `rest`, when flights that are none end.

        Or would end, if nothing happened before.
        """
        rest = min(rest, end)
        self.changes.append(changes)
        if self.list:
            begun, _, held = self.list[-1]
            self.list[-1] = (begun, rest, held)
        self.starts.append(begin)
        self.of.append(kind)
        self.list.append((rest, end, names))

    def gain(self, energy):
        """Add kinetic energy, J, that is gained where the next phase begins."""
        number = len(self.list)
        self.gains[number] = self.gains.get(number, 0.0) + float(energy)

    def gained(self):
        """Kinetic energy (phases,), J, gained where phases begin, up to each of them."""
        gains = np.zeros(len(self.list))
        for number, energy in self.gains.items():
            gains[min(number, gains.size - 1)] += energy
        return np.cumsum(gains)

    def at(self, t):
        """Numbers of the phases at times t (k,); where one begins, the later one."""
        return np.maximum(np.searchsorted(self.starts, t, side="right") - 1, 0)

    def of_outputs(self, t):
        """Numbers of the phases of outputs at times t (k,): of several at one time each is of a phase of its own."""
        same = np.searchsorted(t, t, side="right") - 1 - np.arange(t.size)
        return np.maximum(self.at(t) - same, 0)

    def times_within(self, numbers, t):
        """Times t (k,), but just before the ends of the phases of these numbers (k,), unless these last no time."""
        ends = (numbers < self.at(t)) & (np.array(self.starts)[numbers] < t)
        return np.where(ends, np.nextafter(t, -np.inf), t)

    def multipliers(self, numbers, m, *arrays):
        """Multipliers (k, m) of all rows of the scene: zero of open contacts; arrays as of `reactions.multipliers`."""
        out = np.zeros((len(numbers), m))
        for kind, mine, some in self._gathered(numbers, arrays):
            if kind not in self._columns:
                self._columns[kind] = shared_rows(self._wholes[kind], self.packed[kind])
            shared = rows, columns = self._columns[kind]
            *motion, memory = some
            lam = reactions.multipliers(self.packed[kind], *motion, self._own_memory(kind, memory))
            own = np.zeros((mine.size, m))
            own[:, rows] = lam[:, columns]
            modes = self._modes(kind)
            if modes.grips:
                add_friction(self._gaps[kind], modes, self.packed[kind], shared, *motion[:3], memory, lam, own)
            out[mine] = own
        return out

    def _modes(self, kind):
        return UnitModes.of(self.modes[kind][0])

    def merged(self):
        """The `list`, each name once; phases are one where the same rows hold, and no impact or action is between.

        Without those of no duration: other events came during flights that were to end there.
        """
        found, before, hit, struck = [], None, {t for t, *_ in self.impulses}, False
        for (start, end, names), begun, changes in zip(self.list, self.starts, self.changes, strict=True):
            struck |= begun in hit or changes != before
            before = changes
            if end <= start < self.list[-1][1]:
                continue
            if found and found[-1][1] > start:  # another event came before flights of that phase were to end
                found[-1] = (found[-1][0], start, found[-1][2])
            if found and names == found[-1][2] and not struck:
                found[-1] = (found[-1][0], end, names)
            else:
                found.append((start, end, names))
            struck = False
        return PhaseList(starmap(RunPhase.of, found))

    def sticking(self, numbers, i):
        """Whether a contact with friction sticks (k,); i: the number of its gap."""
        sticks = np.array([self._modes(kind).sticks(i) for kind in range(len(self.modes))])
        return sticks[np.array(self.of)[numbers]]

    def losses(self, numbers, lam, t, q, qd):
        """Power (k, gaps), W, that contacts with friction dissipate; lam (k, m) of the scene."""
        out = np.zeros((len(numbers), self.gaps.count))
        for kind, mine, (own, *some) in self._gathered(numbers, (lam, t, q, qd)):
            modes = self._modes(kind)
            which = [i for i in modes.grips if modes.slides(i)]
            if which:
                out[np.ix_(mine, which)] = losses(self._gaps[kind], which, own, *some)
        return out

    def with_normal_loads(self, numbers, t, q, qd, qdd, memory):
        """As `reactions.with_normal_loads`: the rows that hold frictions in a phase take their part of the loads."""
        slots, columns = memory.shape[1], {load.force.name: load.normal for load in self.whole.loads}
        out = np.zeros((len(numbers), slots + self.whole.system.normals.size))
        out[:, :slots] = memory
        for kind, mine, some in self._gathered(numbers, (t, q, qd, qdd, memory)):
            found = reactions.with_normal_loads(self.packed[kind], *some)
            for load in self.packed[kind].loads:  # without those that are inactive
                if load.normal >= 0 and load.force.name in columns:
                    out[mine, slots + columns[load.force.name]] = found[:, slots + load.normal]
        return out

    def _own_memory(self, kind, memory):
        """Memory of forces in a phase, without normal loads where it has not those of the scene."""
        system = self.whole.system
        same = self.packed[kind].system.normals.size == system.normals.size
        return memory if same or memory is None else memory[:, : system.memory.size]

    def constraint_error(self, numbers, *arrays):
        """The `ConstraintError` of the rows that hold."""
        out = np.zeros((3, len(numbers)))
        for kind, mine, some in self._gathered(numbers, arrays):
            *motion, memory = some
            out[:, mine] = diagnostics.constraint_error(self.packed[kind], *motion, self._own_memory(kind, memory))
        return diagnostics.ConstraintError(*out)

    def packed_at(self, t):
        """Yield each packed scene of phases at times t (k,), and which times are its."""
        for kind, mine, _ in self._gathered(self.at(t), ()):
            yield self.packed[kind], mine

    def phase_at(self, t):
        """The `StatePhase` at t, s, or of several times; None where phases differ in rows of constraints alone."""
        changed = any(inactive or values for inactive, values in self.changes)
        if not (changed or any(packed.derived.holds for packed in self.packed)):
            return None
        numbers = np.unique(self.at(np.atleast_1d(t))).tolist() or [0]
        kinds = {self.of[number] for number in numbers}
        scenes = [self.packed[kind] for kind in kinds], [self._gaps[kind].packed for kind in kinds]
        same = all(self.changes[number] == self.changes[numbers[0]] for number in numbers)
        alike = [found[0] if same and all(each is found[0] for each in found) else None for found in scenes]
        return StatePhase(*self.changes[numbers[-1]], *alike)

    def parts(self, solution, whole):
        """Yield the outputs of a solution by packed scenes, each as a solution of that scene, and which they are.

        whole: with all constraints of the scene, not with the rows and forces of the phase.
        """
        if not self.packed:
            raise StorageError("phases differ in forces or parameters, and the file has no scene: pass scene=.")
        for kind, mine, _ in self._gathered(solution._phase_of_rows, ()):
            part = solution._before_jumps._picked(mine)
            packed = self._gaps[kind].packed if whole else self.packed[kind]
            part.packed, part.system, part.handles, part._phases = packed, packed.system, handles_of(packed), None
            if whole:
                part.multipliers = solution.multipliers[mine]
            yield part, mine

    def active(self, item, numbers):
        """Whether a part is active in the phases of these numbers (k,)."""
        (name,) = handles_of(self.whole).names_of([item])
        return np.array([name not in inactive for inactive, _ in self.changes])[numbers]

    def name_switched(self, parts):
        """Name in each phase which of these parts, that come and go, are active in it."""
        for k, (inactive, _) in enumerate(self.changes):
            active = [item.name for item in parts if item.name not in inactive]
            begin, end, names = self.list[k]
            self.list[k] = begin, end, (*names, *(name for name in active if name not in names))

    def _gathered(self, numbers, arrays):
        """Yield each kind of phases, the entries (j,) of arrays in its phases, and these parts of the arrays."""
        kinds = np.array(self.of)[numbers]
        for kind in np.unique(kinds).tolist():
            mine = np.flatnonzero(kinds == kind)
            yield kind, mine, [None if array is None else array[mine] for array in arrays]

    def saved(self):
        """Numbers (for JSON) and arrays by name, from which `restore` makes the same."""
        names = list(dict.fromkeys(named for *_, named in self.list))
        contacts = list(dict.fromkeys(name for _, name, _ in self.impulses))
        place, number = ({name: i for i, name in enumerate(known)} for known in (names, contacts))
        derived = [derived_record(packed) for packed in self.packed]
        changes = list({json.dumps(plain(each)): plain(each) for each in self.changes}.values())
        changed = [changes.index(plain(each)) for each in self.changes]
        numbers = {"modes": self.modes, "derived": derived, "names": names, "contacts": contacts}
        numbers |= {"changes": changes, "changed": changed}
        phases = [(*span, place[named]) for *span, named in self.list]
        # Of an impulse with several components a line for each, numbered from one; of friction from minus one down
        impulses = []
        for t, name, p in self.impulses:
            parts = enumerate(np.atleast_1d(p).tolist(), int(np.ndim(p) > 0))
            impulses += [(t, number[name], x, i) for i, x in parts]
            if isinstance(p, Impulse) and p.tangential.any():
                impulses += [(t, number[name], x, -1 - i) for i, x in enumerate(p.tangential.tolist())]
        return numbers, {
            "phases": np.column_stack((self.starts, self.of, phases)) if phases else np.zeros((0, 5)),
            "gains": np.array(list(self.gains.items())).reshape(-1, 2),
            "impulses": np.array(impulses, float).reshape(-1, 4),
        }

    def restore(self, numbers, arrays, scene_of=None):
        """As they were when they were saved; scene_of(modes): its scene and gaps, None where there are none.

        Raises
        ------
        KeyError, TypeError or ValueError
            If they describe none.
        """
        demand_record(numbers, RECORD)
        phases, impulses = arrays["phases"].astype(float), arrays["impulses"].astype(float)
        names, contacts = [tuple(map(str, named)) for named in numbers["names"]], list(map(str, numbers["contacts"]))
        demand(phases.ndim == impulses.ndim == 2 and phases.shape[1] == 5 and impulses.shape[1] == 4, "the phases")
        (of, named), which = phases[:, [1, 4]].T.astype(int), impulses[:, 1]
        for places, known in ((of, numbers["modes"]), (named, names), (which, contacts)):
            demand(np.isin(places, np.arange(len(known))).all(), "the numbers of phases")
        demand(len(numbers["derived"]) == len(numbers["modes"]), "the kinds of phases")
        self.starts, self.of = phases[:, 0].tolist(), of.tolist()
        self.list = [(t, end, names[i]) for t, end, i in zip(*phases[:, 2:4].T.tolist(), named, strict=True)]
        self.gains = {int(number): energy for number, energy in arrays["gains"].astype(float).reshape(-1, 2).tolist()}
        self.impulses = []
        for t, i, p, component in impulses.tolist():
            if component < 0.0:
                demand(bool(self.impulses) and isinstance(self.impulses[-1][2], Impulse), "the impulses")
                *_, last = self.impulses.pop()
                p = Impulse(last, last.tangential + p * np.eye(3)[int(min(-1.0 - component, 2.0))])
            elif component > 1.0:
                demand(bool(self.impulses) and np.ndim(self.impulses[-1][2]) == 1, "the impulses")
                p = np.append(self.impulses.pop()[2], p)
            elif component == 1.0:
                p = np.array([p])
            elif component == 0.0:
                p = Impulse(p)
            self.impulses.append((t, contacts[int(i)], p))
        demand(len(numbers["changed"]) == len(self.of), "the changes")
        known = [(tuple(map(str, inactive)), dict(values)) for inactive, values in numbers["changes"]]
        self.changes = [known[i] for i in numbers["changed"]]
        if scene_of is None:
            self.modes = numbers["modes"]
            return
        for modes, derived in zip(numbers["modes"], numbers["derived"], strict=True):
            scene, gaps = scene_of(modes)
            packed = scene.packed
            if derived != derived_record(packed):
                take_derived(packed, derived)
            self.kind(packed, lambda modes=modes: modes, packed if scene._whole is None else scene._whole.packed, gaps)
            self.scenes.append(scene)


class PhasePieces(StepPieces):
    """Dense output of phases: where one begins, its own. kinds: of the phases of each part, as `Phases` has them."""

    def __init__(self, parts, kinds):
        super().__init__(parts)
        self.kinds = kinds

    def _begins(self, t):
        return np.ones(t.shape, bool)


class Pinned:
    """A trajectory with bodies that rest: to the last bit."""

    def __init__(self, trajectory, q, still):
        self.trajectory, self.q, self.still = trajectory, q, still
        self.start, self.end, self.edges, self.anchors = (
            trajectory.start, trajectory.end, trajectory.edges, trajectory.anchors,
        )  # fmt: skip

    def begin_at(self, times):
        """As of a `Trajectory`."""
        self.trajectory.begin_at(times)

    def __call__(self, t):
        """As of a `Trajectory`."""
        states, memory, status = self.trajectory(t)
        states[:, 0, self.still], states[:, 1:, self.still] = self.q[self.still], 0.0
        return states, memory, status


def shared_rows(whole, packed):
    """Rows of a scene that one of its phases has, and where they are among those of the phase: (2, rows)."""
    of_whole, own = ({id(part): first for part, first in first_rows(each.constraints)} for each in (whole, packed))
    mine = [(id(part), i) for part in packed.constraints for i in range(part.all_rows)]
    pairs = [(of_whole[part] + i, own[part] + i) for part, i in mine if part in of_whole]
    return np.array(pairs, int).reshape(-1, 2).T


def derived_record(packed):
    """What a run has found out about its constraint graph: redundant rows, and bodies that count as turning."""
    rows = packed.derived.redundant
    turning = sorted(int(body) for body in packed.derived.turning)
    return {"redundant": None if rows is None else np.asarray(rows).tolist(), "turning": turning}


def take_derived(packed, record):
    """Enter it into a packed scene."""
    rows, most = record["redundant"], len(graph_of(packed).row)
    if rows is not None:
        demand(all(type(row) is int and 0 <= row < most for row in rows), "the redundant rows")
        set_redundant(packed, np.array(rows, np.int64))
    if record["turning"]:
        demand(set(record["turning"]) <= set(range(len(packed.bodies))), "the turning bodies")
        keep_turning(packed, record["turning"])
