"""`scene.linearise`: mass, damping and stiffness in named minimal coordinates; modes, inputs and outputs."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..calls import fitting_methods
from ..drawing import html_table
from ..elements.bodies import PointMass, rotation_matrix
from ..elements.primitive import Primitive
from ..errors import InvalidArgument
from ..maths.tolerances import NEGLIGIBLE
from ..model.handles import handles_of
from ..validation import vector3
from .actuator_loads import actuators_of
from .coordinates import Variations, chosen, item_of, stacked, transform_e
from .equilibrium import demand_smooth
from .nominal_motion import NominalMotion
from .reduction import Reduced, eigenpairs, equations
from .steady import steady_rate

if TYPE_CHECKING:
    from ..hints import Floats


# Inputs of the linearised system, which are the `Actuator`s of inverse dynamics, and rows of outputs.

RATE = " rate"


def demand_effective(inputs, F):
    """Refuse inputs that constraints take up: columns of F (k, inputs) that are zero, but for some of a vector's."""
    works = np.abs(F).max(axis=0, initial=0.0) > [NEGLIGIBLE * np.abs(one.loads).max(initial=0.0) for one in inputs]
    vectors = {one.whole for one, moves in zip(inputs, works, strict=True) if moves}
    for one, moves in zip(inputs, works, strict=True):
        if not moves and not (one.whole and one.whole in vectors):
            raise InvalidArgument(
                f"the input {one.whole or one.name} does no work on any motion that the constraints admit. Where a "
                "motor drives its coordinate, replace the motor by a JointTorque or JointForce."
            )


class OutputMatrices(NamedTuple):
    """Names, and y = Y dx + Yd dxd."""

    names: tuple
    Y: np.ndarray  # (p, k)
    Yd: np.ndarray


def outputs_of(scene, variations, given, coordinates, reduced):
    """The `OutputMatrices` of handles and names; of none, the coordinates and their rates."""
    k, n = len(coordinates), variations.motion.q.size
    if not len(given):
        names = [one.name for one in coordinates]
        names += [name + RATE for name in names]
        return OutputMatrices(tuple(names), np.eye(2 * k, k), np.eye(2 * k, k, -k))
    rows, rates = [], []
    for one in given:
        rate = isinstance(one, str) and one.endswith(RATE)
        found = _of(scene, variations, one[: -len(RATE)] if rate else one, coordinates)
        rows += found
        rates += [rate] * len(found)
    Z, Zd, _ = stacked(rows, n)
    rates = np.array(rates)[:, None]
    places, speeds = Z @ reduced.T, Z @ reduced.T1 + Zd @ reduced.T
    names = tuple(one.name + RATE * bool(rate) for one, rate in zip(rows, rates, strict=True))
    return OutputMatrices(names, np.where(rates, speeds, places), np.where(rates, places, 0.0))


def _of(scene, variations, given, coordinates):
    """The `Variation`s that an output means."""
    if isinstance(given, str):
        same = [one for one in coordinates if one.name == given]
        every = same or [one for one in (*variations.joints, *variations.bodies) if one.name == given]
        if every:
            return every[:1]
    if isinstance(given, (tuple, list)) and len(given) == 2:
        body, _ = item_of(scene, given[0], scene.bodies, "body")
        point = vector3(given[1], f"{body.name}: point (m, body frame)", InvalidArgument)
        return variations.point(variations.handles.own(body), point, f"{body.name}{tuple(point.tolist())}")
    joints = [item for item in scene.constraints if not (isinstance(item, Primitive) and item.normalises)]
    item, axis = item_of(scene, given, [*scene.bodies, *joints], "body or joint")
    own = variations.handles.own(item)  # of the scene whose numbers vary
    if isinstance(own, PointMass):
        found = variations.of_body(own)[:3]
    else:
        found = [one for row in variations.handles.rows if row.item is own for one in variations.of_row(row)]
    if not found:
        raise InvalidArgument(
            f"{item.name} has no coordinate: give a joint with an angle or a displacement, or a body."
        )
    return [one for one in found if axis is None or one.name.endswith(axis)]


# Modes of the linearised system: frequencies, damping ratios, and shapes as twists of bodies.


HEADS = "frequency (Hz)", "damping ratio", "kinetic energy"
DIRECTIONS = "x", "y", "z", "rotation x", "rotation y", "rotation z"
NAMED, LEAST_SHARE = 4, 0.05  # directions of bodies that are named at most; share of the energy of all but the first


class Moving(NamedTuple):
    """What takes variations of the coordinates to the motion of the bodies."""

    handles: Any  # `Handles` of the scene
    twists: np.ndarray  # (b, 6, k)
    mass: np.ndarray  # (b,)
    inertia: np.ndarray  # (b, 3, 3), ground frame


@fitting_methods
class Modes:
    """Modes in order of |lambda|; a conjugate pair of eigenvalues is one mode, and a pair of zeros.

    Attributes
    ----------
    eigenvalues : ndarray (j,) complex, 1/s
        Imaginary parts are not negative.
    frequency : ndarray (j,), Hz
        Natural frequency |lambda| / (2 pi).
    damped_frequency : ndarray (j,), Hz
        Im lambda / (2 pi).
    damping_ratio : ndarray (j,)
        -Re lambda / |lambda|: negative if the mode grows, 1 if it decays without oscillation; NaN where lambda is zero.
    shapes : ndarray (j, k) complex
        Variations of the coordinates. M-norm 1, the largest entry real and positive.
    coordinates : tuple of str
    """

    def __init__(self, values: Any, shapes: Any, moving: Any, coordinates: tuple[str, ...]) -> None:
        size = np.abs(values)
        self.eigenvalues, self.shapes, self.coordinates = values, shapes, coordinates
        self.frequency, self.damped_frequency = size / (2.0 * np.pi), values.imag / (2.0 * np.pi)
        self.damping_ratio: Floats = np.where(size > 0.0, (0.0 - values.real) / np.where(size > 0.0, size, 1.0), np.nan)
        self._moving = moving

    def __len__(self) -> int:
        return len(self.eigenvalues)

    def twist(self, body: PointMass | str) -> Any:
        """Displacement of the centroid (m) and rotation (rad) of a body in each mode, (j, 6) complex.

        Axes are those of the ground, or, in steady motion, turning with it. The rotation of a point mass is zero.
        """
        return self.shapes @ self._moving.twists[self._index(body)].T

    def participation(self, body: PointMass | str) -> Floats:
        """Share of a body in the kinetic energy of each mode, (j, 6): displacements along, rotations about x, y and z.

        Shares of all bodies together are 1. Axes as of `twist`.

        Examples
        --------
        A rod that swings about its end: three quarters of the energy are of the centroid.

        >>> import tsdyn as ts
        >>> scene = ts.Scene()
        >>> rod = scene.add_body(**ts.shapes.rod(1.0, axis="z", mass=3.0), position=(0, 0, -0.5), name="rod")
        >>> pin = ts.constraints.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0), name="pin")
        >>> pin = scene.add(pin)
        >>> modes = scene.linearise().modes()
        >>> print(modes.participation("rod").round(6))
        [[0.75 0.   0.   0.   0.25 0.  ]]
        >>> print(modes)
        Modes
          frequency (Hz)  damping ratio  kinetic energy
                0.610494              0  rod.x 75 %, rod.rotation y 25 %
        """
        return self._shares[:, self._index(body)]

    def _index(self, body):
        """The number of a body."""
        own = self._moving.handles.body(body)
        return [one is own for one in self._moving.handles.bodies].index(True)

    @cached_property
    def _shares(self):
        """Shares (j, b, 6) of the kinetic energy: m v^2 by components, and those of sqrt(J) omega, ground frame."""
        _, twists, mass, inertia = self._moving
        moves = (self.shapes @ twists.reshape(-1, twists.shape[2]).T).reshape(len(self), -1, 6)
        sizes, axes = np.linalg.eigh(inertia)
        root = np.einsum("bik,bk,bjk->bij", axes, np.sqrt(np.maximum(sizes, 0.0)), axes)
        found = np.abs(moves) ** 2
        found[:, :, :3] *= mass[:, None]
        found[:, :, 3:] = np.abs(np.einsum("bik,jbk->jbi", root, moves[:, :, 3:])) ** 2
        return found / found.sum(axis=(1, 2), keepdims=True)

    @property
    def motions(self) -> tuple[str, ...]:
        """What each mode moves: up to four directions of bodies with most of its kinetic energy, "car.z 98 %"."""
        return tuple(self._motion(shares.ravel()) for shares in self._shares)

    def _motion(self, shares):
        first = np.argsort(-shares, kind="stable")[:NAMED]
        return ", ".join(
            f"{self._moving.handles.bodies[i // 6].name}.{DIRECTIONS[i % 6]} {100.0 * shares[i]:.0f} %"
            for i in first
            if i == first[0] or shares[i] >= LEAST_SHARE
        )

    def _rows(self):
        """Frequency, damping ratio and motion of each mode."""
        facts = zip(self.frequency, self.damping_ratio, self.motions, strict=True)
        return [(f"{frequency:.6g}", f"{ratio:.6g}", motion) for frequency, ratio, motion in facts]

    def __repr__(self) -> str:
        return f"<Modes: {len(self)} of {len(self.coordinates)} coordinates>\n{self}"

    def __str__(self) -> str:
        rows = [HEADS, *self._rows()]
        return "\n".join(["Modes", *(f"  {f:>14}  {ratio:>13}  {motion}" for f, ratio, motion in rows)])

    def _repr_html_(self) -> str:
        """Return a table, for notebooks."""
        return html_table(self._rows(), f"Modes of {len(self.coordinates)} coordinates", HEADS)


class StateSpace(NamedTuple):
    """xd = A x + B u, y = C x + D u, with the 2 k states (coordinates, independent rates).

    Of j coordinates with rows on velocities there are j + k states.
    """

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

    With rows on velocities (rolling, knife edges) the j coordinates x have k < j independent rates w:
    M dwd + C dw + K dx = F du and dxd = W dw + V dx. Without such rows w are the rates of x, W = I and V = 0.

    Attributes
    ----------
    M, C, K : ndarray (k, k), (k, k), (k, j)
        Mass, damping with gyroscopic terms, and stiffness; SI units of the coordinates.
    W, V : ndarray (j, k), (j, j)
        Rates of the coordinates by the independent ones, and by the coordinates.
    F : ndarray (k, inputs)
        Generalised forces of unit inputs.
    bodies : tuple of Body
    coordinates, rates, inputs, outputs : tuple of str
        Names; rates are those that are independent.
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
        free = np.arange(len(every)) if isinstance(reduced, Reduced) else reduced.free
        self.rates: tuple[str, ...] = tuple(every[i].name + RATE for i in free)
        none = np.eye(len(every)), np.zeros((len(every), len(every)))
        self.W, self.V = none if isinstance(reduced, Reduced) else (reduced.W, reduced.V)
        self.steady, self.rotation_rate = rate is not None, np.zeros(3) if rate is None else rate
        self.bodies, self._reduced = motion.packed.bodies, reduced
        self._moving = _moving(motion, reduced)
        inputs, self._outputs = ports
        self.inputs, self.outputs = tuple(one.name for one in inputs), self._outputs.names
        self.F: Floats = np.zeros((len(self.rates), len(inputs)))
        for i, one in enumerate(inputs):
            load = one.loads[0] @ reduced.T[one.columns]
            self.F[:, i] = load if isinstance(reduced, Reduced) else load @ self.W
        demand_effective(inputs, self.F)

    @cached_property
    def _pairs(self):
        return eigenpairs(self._reduced)

    def eigenvalues(self) -> Any:
        """Eigenvalues lambda of (M lambda^2 + C lambda + K) x = 0, 1/s, (2 k,) complex, in order of size.

        With rows on velocities those of A of the `state_space`, (j + k,).
        """
        return self._pairs.values.copy()

    def modes(self) -> Modes:
        """Frequencies, damping ratios, shapes, and what moves in each, a `Modes`."""
        if not len(self.coordinates):
            raise InvalidArgument(
                "modes: the scene has no degrees of freedom, so nothing vibrates. Remove a constraint."
            )
        first, zero = np.flatnonzero(self._pairs.values.imag >= 0.0), int((self._pairs.values == 0.0).sum())
        first = first[zero // 2 :] if zero else first
        first[: zero - zero // 2] = np.arange(zero - zero // 2)  # zeros are first, and a pair of them is one mode, too
        values, shapes = self._pairs.values[first], self._pairs.vectors[:, first].T
        lead = shapes[np.arange(len(first)), np.abs(shapes).argmax(axis=1)]
        return Modes(values, shapes * (np.abs(lead) / lead)[:, None], self._moving, self.coordinates)

    def state_space(self) -> StateSpace:
        """A, B, C, D and the names of states, inputs and outputs, a `StateSpace`."""
        j, k = self.W.shape
        inverse = np.linalg.solve(self.M, np.concatenate((self.K, self.C, self.F), axis=1))
        A = np.block([[self.V, self.W], [-inverse[:, : j + k]]])
        B = np.concatenate((np.zeros((j, len(self.inputs))), inverse[:, j + k :]))
        Y, Yd = self._outputs.Y, self._outputs.Yd
        C = np.concatenate((Y + Yd @ self.V, Yd @ self.W) if self.V.any() or j > k else (Y, Yd), axis=1)
        states = (*self.coordinates, *self.rates)
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
    motion = NominalMotion(scene.packed, memory, *state)
    demand_smooth(motion)
    rate = steady_rate(motion)
    if rate is None and motion.rates.size:
        raise InvalidArgument(
            f"linearise: {scene.row_names()[motion.rates[0]]} is a row on velocities; with such rows a motion is "
            "linearised at rest and where it is steady. Give a state of steady motion, or of an equilibrium."
        )
    variations = Variations(motion, np.zeros(3) if rate is None else rate)
    ports = actuators_of(scene, variations.handles, inputs, motion.q[None], "input")
    report(0.2, f"{motion.freedom} coordinates are chosen")
    every = chosen(motion.placed, variations)
    report(0.4, f"the equations are reduced to {motion.freedom} coordinates")
    reduced = equations(motion, every)
    report(0.8, "masses, damping and stiffness are multiplied out")
    ports = ports, outputs_of(scene, variations, outputs, every, reduced)
    return Linearisation(motion, every, reduced, ports, rate)


def _moving(motion, reduced):
    """The `Moving` of all bodies by the coordinates."""
    system, bodies = motion.system, motion.system.bodies
    T, rigid, p = reduced.T, motion.rigid, motion.parameters(0)
    twists = np.zeros((len(bodies), 6, T.shape[1]))
    twists[:, :3] = T[bodies[:, :1] + np.arange(3)]
    twists[rigid, 3:] = 2.0 * transform_e(p) @ T[bodies[rigid, :1] + np.arange(3, 7)]
    A, inertia = rotation_matrix(p), np.zeros((len(bodies), 3, 3))
    inertia[rigid] = A @ system.inertia[rigid].reshape(-1, 3, 3) @ A.swapaxes(1, 2)
    return Moving(handles_of(motion.packed), twists, system.mass.copy(), inertia)
