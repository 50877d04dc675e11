"""`scene.linearise`: reduced mass, damping and stiffness in named minimal coordinates about a state."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..calls import fitting_methods
from .coordinates import chosen
from .eigen import eigenpairs
from .modes import Modes, modes_of
from .motion import Motion
from .ports import RATE, demand_effective, inputs_of, outputs_of
from .reduction import Reduced
from .smoothness import demand_smooth
from .steady import steady_rate
from .variations import Variations, transform_e

if TYPE_CHECKING:
    from ..hints import Floats


class StateSpace(NamedTuple):
    """xd = A x + B u, y = C x + D u, with the 2 k states (coordinates, rates)."""

    A: Floats  # (2k, 2k)
    B: Floats  # (2k, inputs)
    C: Floats  # (outputs, 2k)
    D: Floats  # (outputs, inputs)
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@fitting_methods
class Linearisation:
    """Linearised equations of motion M dxdd + C dxd + K dx = F du in k minimal coordinates x.

    Attributes
    ----------
    M, C, K : ndarray (k, k)
        Mass, damping with gyroscopic terms, and stiffness; SI units of the coordinates.
    F : ndarray (k, inputs)
        Generalised forces of unit inputs.
    bodies : tuple of Body
    coordinates, inputs, outputs : tuple of str
    t : float, s
    q, qd, qdd : ndarray (n,)
        The state, projected onto the constraints, and its accelerations.
    multipliers : ndarray (m,)
        Zero for redundant rows.
    steady : bool
        Whether the state is an equilibrium or a steady motion: coefficients are constant, eigenvalues decide on
        stability. Elsewhere coefficients are those of this instant.
    rotation_rate : ndarray (3,), rad/s
        Ground frame; the rate at which a steady motion turns as a whole, and with it the axes of displacements and
        rotations of bodies. Zero at rest.
    """

    def __init__(self, motion: Any, every: Any, reduced: Any, ports: Any, rate: Any) -> None:
        self.M, self.C, self.K = reduced.M, reduced.C, reduced.K
        self.t, self.q, self.qd, self.qdd, self.multipliers = motion.t, motion.q, motion.qd, motion.qdd, motion.lam
        self.coordinates: tuple[str, ...] = tuple(one.name for one in every)
        self.steady, self.rotation_rate = rate is not None, np.zeros(3) if rate is None else rate
        self.bodies, self._reduced = motion.packed.bodies, reduced
        self._twists = _twists(motion, reduced)
        inputs, self._outputs = ports
        self.inputs, self.outputs = tuple(one.name for one in inputs), self._outputs.names
        self.F: Floats = np.zeros((len(every), len(inputs)))
        for i, one in enumerate(inputs):
            self.F[:, i] = one.load @ reduced.T[one.columns]
        demand_effective(inputs, self.F)

    @cached_property
    def _pairs(self):
        return eigenpairs(self._reduced)

    def eigenvalues(self) -> Any:
        """Eigenvalues lambda of (M lambda^2 + C lambda + K) x = 0, 1/s, (2 k,) complex, in order of size."""
        return self._pairs.values.copy()

    def modes(self) -> Modes:
        """Frequencies, damping ratios and shapes, a `Modes`."""
        return modes_of(self._pairs, self._twists, self.bodies, self.coordinates)

    def state_space(self) -> StateSpace:
        """A, B, C, D and the names of states, inputs and outputs, a `StateSpace`."""
        k = len(self.M)
        inverse = np.linalg.solve(self.M, np.concatenate((self.K, self.C, self.F), axis=1))
        A = np.block([[np.zeros((k, k)), np.eye(k)], [-inverse[:, : 2 * k]]])
        B = np.concatenate((np.zeros((k, len(self.inputs))), inverse[:, 2 * k :]))
        C = np.concatenate((self._outputs.Y, self._outputs.Yd), axis=1)
        states = (*self.coordinates, *(name + RATE for name in self.coordinates))
        D = np.zeros((len(self.outputs), len(self.inputs)))
        return StateSpace(A, B, C, D, states, self.inputs, self.outputs)

    def to_scipy(self) -> Any:
        """The state space as a `scipy.signal.StateSpace`; without inputs, B and D have a column of zeros."""
        from scipy.signal import StateSpace as System

        A, B, C, D, *_ = self.state_space()
        if not self.inputs:
            B, D = np.zeros((len(A), 1)), np.zeros((len(C), 1))
        return System(A, B, C, D)

    def __repr__(self) -> str:
        moving = bool(np.any(self.qd))
        where = (
            ("in steady motion" if moving else "at rest") if self.steady else "in motion" if moving else "off balance"
        )
        return f"<Linearisation {where}: {', '.join(self.coordinates) or 'no coordinates'}>"


def linearise(scene, memory, state, inputs, outputs, report):
    """The `Linearisation` of a scene at a consistent (t, q, qd), with the memory of forces and constraints.

    report(fraction, said) announces the next part.
    """
    report(0.05, "accelerations and reactions are solved for")
    motion = Motion(scene.packed, memory, *state)
    demand_smooth(motion)
    rate = steady_rate(motion)
    variations = Variations(motion, np.zeros(3) if rate is None else rate)
    ports = inputs_of(scene, variations, inputs)
    report(0.2, f"{motion.freedom} coordinates are chosen")
    every = chosen(motion, variations)
    report(0.4, f"the equations are reduced to {motion.freedom} coordinates")
    reduced = Reduced(motion, every)
    report(0.8, "masses, damping and stiffness are multiplied out")
    ports = ports, outputs_of(scene, variations, outputs, every, reduced)
    return Linearisation(motion, every, reduced, ports, rate)


def _twists(motion, reduced):
    """Displacements and rotations of all bodies by the coordinates, (b, 6, k)."""
    T, bodies = reduced.T, motion.system.bodies
    found = np.zeros((len(bodies), 6, T.shape[1]))
    found[:, :3] = T[bodies[:, :1] + np.arange(3)]
    p = bodies[motion.rigid, :1] + np.arange(3, 7)
    found[motion.rigid, 3:] = 2.0 * transform_e(motion.parameters(0)) @ T[p]
    return found
