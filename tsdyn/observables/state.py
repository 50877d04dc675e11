"""A state: the type of `solution.state` and `solution.at(t)`, and a possible start of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from ..calls import fitting, lacking
from ..errors import InvalidArgument
from ..model.kinematics import Anchor, Kinematics
from .reactions import Exerting, loads_of, multipliers

if TYPE_CHECKING:
    from ..hints import Floats

NOTHING = np.empty(0)
SEVERAL = "these states are of several phases of a run: ask for reactions at one time each."


class _Arrays(NamedTuple):
    t: float
    q: Floats
    qd: Floats
    qdd: Floats
    multipliers: Floats


class State(Exerting, Kinematics["float | Any"], _Arrays):
    """Time, positions, velocities, accelerations and multipliers at one instant.

    Parameters
    ----------
    t : float, s
    q, qd : ndarray (n,)
    qdd : ndarray (n,)
        Not needed for a start.
    multipliers : ndarray (m,)
        Not needed for a start.

    Raises
    ------
    InvalidCall
        If q or qd is missing, or there are more arguments.

    Notes
    -----
    A state made by a run (`solution.state`, `solution.at(t)`, the argument of an event) knows its scene and gives the
    motion of bodies and joints, and `reaction(joint)`, too.

    Examples
    --------
    A run, continued by another:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> half = ts.simulate(scene, (0, 0.5)).state
    >>> print(f"{half.t} s: {half.position(bob).round(4)} m")
    0.5 s: [ 0.3721  0.     -0.9282] m
    >>> print(ts.simulate(scene, (half.t, 1.0), state=half).state.position(bob).round(4))
    [-0.9889  0.     -0.1483]
    """

    __slots__ = ()

    @fitting
    def __new__(
        cls, t: float | Floats, q: Floats, qd: Floats, qdd: Floats = NOTHING, multipliers: Floats = NOTHING
    ) -> Self:
        """Make a state of these arrays."""
        return super().__new__(cls, t, q, qd, qdd, multipliers)

    def __getattr__(self, name: str) -> Any:
        """Refuse a name that there isn't, with what it is called here."""
        raise lacking(self, name)

    @property
    def packed(self) -> Any:
        """Its scene, packed."""
        raise InvalidArgument(
            "this state is arrays alone and knows no bodies and joints: ask solution.state, solution.at(t), or the "
            "state that an event receives."
        )


class StatePhase(NamedTuple):
    """What the actions of events have made of a scene up to a state."""

    inactive: tuple  # names of the constraints and forces that take no part
    values: dict  # parameters that were set, by name
    packed: Any  # of the phase of the run; None of several states in different ones
    whole: Any  # the scene with these parameters, packed with all of its constraints; None of several ones


class RememberingState(State):
    """A State that knows its scene and the memory of forces, from which a run continues.

    Attributes
    ----------
    packed : Packed
    memory : ndarray (slots,) or (k, slots)
        Memory of forces.
    anchor : Anchor
        Reference of turn counts.
    phase : StatePhase or None
        None where no action has changed the scene, and no friction is exact.
    """

    packed: Any = None
    memory: Any = None
    anchor: Any = None
    phase: StatePhase | None = None

    @classmethod
    def of(cls, packed, memory, anchor, *parts):
        """Make a state, or k states."""
        state = cls._make(parts)
        state.packed, state.memory, state.anchor = packed, memory, anchor
        return state

    def __repr__(self) -> str:
        return repr(State(*self))

    def _replace(self, **changes: Any) -> RememberingState:
        state = self.of(self.packed, self.memory, self.anchor, *super()._replace(**changes))
        state.phase = self.phase
        return state

    def _acting(self, item):
        phase, item = self.phase, self.handles.item(item)
        if phase is None:
            return super()._acting(item)
        load = loads_of(self.packed).get(id(item))
        of_phase = load is not None and (phase.inactive or phase.values or load.slides)
        packed = phase.packed if of_phase else phase.whole
        if packed is None:
            raise InvalidArgument(SEVERAL)
        if not of_phase:
            return packed, self.multipliers
        t, (*motion, memory) = np.atleast_1d(self.t), map(np.atleast_2d, (self.q, self.qd, self.qdd, self.memory))
        return packed, multipliers(packed, t, *motion, memory)


def remembered(state, prepared, t, q):
    """Return the memory with which a run from a state (or None) begins: joint angles, then memory of forces."""
    memory = getattr(state, "memory", None)
    if not prepared.remembers and (memory is None or np.shape(memory) == (0,)):
        return NOTHING
    slots = prepared.packed.system.memory.size
    packed = prepared.packed
    owners = *(load.force for load in packed.loads), *(contact for contact, _ in packed.contacts)
    taken = sum(owner.taken for owner in owners)  # a run sets these
    anew = taken + sum(part.memory for part in packed.constraints if part.begins_anew)
    if memory is None and state is not None and slots > anew:
        raise InvalidArgument(
            "parts of the scene count turns or hold a load, and this state doesn't say how many: give solution.state, "
            "what solution.at(t) returns or what an event function is given, as they are or changed by _replace."
        )
    fresh = memory is None
    memory = np.zeros(slots) if fresh else memory
    if np.shape(memory) != (slots,):
        raise InvalidArgument(
            f"the state remembers {np.size(memory)} numbers and the scene has {slots}; use a state of this scene."
        )
    angles = state.angles if getattr(state, "anchor", None) is not None else np.empty(0)
    if angles.size != prepared.handles.count:
        angles = prepared.handles.angles_at_start(t, q)
    if fresh:
        begin_memory(prepared.packed, prepared.handles, angles, memory)
    return np.concatenate((angles, memory))


def begin_memory(packed, handles, angles, memory, items=None):
    """Write into memory (slots,) what forces and constraints remember of angles at first; items: those activated."""
    chosen = None if items is None else {id(item) for item in items}
    for load in packed.loads:
        if chosen is None or id(load.force) in chosen:
            if chosen and load.force.memory and load.force.joint_coordinates:
                memory[load.slot] = angles[handles.row(load.force, "angle").first]
            if load.law is not None and load.law.counted:
                memory[load.slot : load.slot + len(load.law.counted)] = angles[load.law.counted]
            if getattr(load.force, "remembers_angle", False):
                row = handles.row(load.force.joint, "angle")
                memory[load.slot] = angles[row.first + load.force.which]
    for part, slot in zip(packed.constraints, packed.slots, strict=True) if memory.size else ():
        if slot >= 0 and (chosen is None or not chosen.isdisjoint((id(part), id(part.owner)))):
            if chosen and not part.counted:
                memory[slot : slot + part.memory] = part.first_memory
            for i, (joint, which) in enumerate(part.counted):
                memory[slot + i] = angles[handles.row(joint, "angle").first + which]


class EventInstant(Exerting, Kinematics):
    """What an event function is given: a `State`, with multipliers made when asked for.

    Parameters
    ----------
    packed : Packed
    memory : ndarray (slots,)
        What forces remember.
    beside : tuple
        The start of its step, or itself: t, state (3, n) and the joints' angles there.
    t : float, s
    state : ndarray (3, n)
    """

    __slots__ = ("_beside", "memory", "packed", "q", "qd", "qdd", "t")

    def __init__(self, packed, memory, beside, t, state):
        self.packed, self.memory, self._beside, self.t = packed, memory, beside, t
        self.q, self.qd, self.qdd = state.copy()  # the function may keep or change it

    @property
    def anchor(self):
        """What its angles are counted from."""
        t, state, angles = self._beside
        return Anchor(angles) if t == self.t else Anchor(angles, self.t - t, (state[0], state[1]))

    @property
    def multipliers(self):
        """Multipliers (m,)."""
        parts = (part[None] for part in (self.q, self.qd, self.qdd))
        return multipliers(self.packed, np.array([self.t]), *parts, self.memory[None])[0]

    def __repr__(self) -> str:
        return repr(State(*self))

    def __iter__(self):
        return iter((self.t, self.q, self.qd, self.qdd, self.multipliers))

    def __len__(self):
        return 5

    def __getitem__(self, i):
        return tuple(self)[i]
