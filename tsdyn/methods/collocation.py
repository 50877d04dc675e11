"""Collocation methods for stiff scenes: their nodes, the numbers of the step kernel, the motion inside a step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import legendre

from ..calls import fitting_constructor
from ..errors import InvalidArgument
from ..jit.kernels import ANY, callback, kernel, stack, vector
from ..maths.dense_linalg import copy
from ..workspaces import B_DATA, load_run
from .interpolants import FILL, VALUE, Interpolant
from .tableau import demand, quadrature

if TYPE_CHECKING:
    from ..hints import Floats, Sequence


# Collocation methods for stiff scenes: their nodes, and the numbers that the step kernel reads.
#
# The motion satisfies the equations at the nodes c_i of a step, the last of which is its end; the derivative between is
# the polynomial through them. In the basis P_j of shifted Legendre polynomials, with P = P_j(c_i) and Q the integrals
# of P_j from 0 to c_i, the coefficients are A = Q P^-1. Newton's matrices of all stages at once fall apart by the
# eigenvalues of A (Hairer, Wanner, Solving ODEs II, IV.8): one is real, the others come in pairs.

MOST_STAGES = 9  # the interpolant's polynomials are on the stack


@fitting_constructor
@dataclass(frozen=True)
class CollocationTableau:
    """A collocation method: an odd number of nodes c in (0, 1], three to nine, the last one 1; its order.

    The error estimate is that of a quadrature of the order of the number of nodes, which has the step's start as a
    node besides: Hairer and Wanner, Solving ODEs II, IV.8, Eq. (8.17).

    Examples
    --------
    Radau IIA of order 5; a node in a wrong place is refused:

    >>> import tsdyn as ts
    >>> root = 6**0.5
    >>> ts.CollocationTableau(((4 - root) / 10, (4 + root) / 10, 1), order=5).order
    5
    >>> try:
    ...     ts.CollocationTableau((0.2, 0.6, 1), order=5)
    ... except ts.InvalidArgument as error:
    ...     print(error)
    CollocationTableau: the condition b c^3 = 1/4 fails by 0.01.
    """

    nodes: Sequence[float]
    order: int

    def __post_init__(self) -> None:
        c, what = np.array(self.nodes, float), "CollocationTableau"
        if not (c.ndim == 1 and c.size % 2 == 1 and 3 <= c.size <= MOST_STAGES):
            raise InvalidArgument(f"{what}: an odd number of nodes, 3 to {MOST_STAGES}, got {self.nodes!r}.")
        if not (c[0] > 0.0 and (np.diff(c) > 0.0).all() and c[-1] == 1.0):
            raise InvalidArgument(f"{what}: nodes lie in (0, 1] in ascending order, the last one is 1.")
        if not self.order >= c.size + 2:
            raise InvalidArgument(
                f"{what}: the order is to exceed the number of nodes by 2 at least, got {self.order!r}."
            )
        demand(what, **quadrature(self.coefficients[-1], c, self.order))
        values = self.eigenvalues
        if abs(values[0].imag) > 0.0 or not (values.real > 0.0).all() or (values[1::2].imag == 0.0).any():
            raise InvalidArgument(f"{what}: one eigenvalue of the coefficients is to be real, all with positive parts.")

    @property
    def c(self) -> tuple[float, ...]:
        """Times of the stages, the explicit one at the step's start included."""
        return (0.0, *self.nodes)

    @cached_property
    def basis(self) -> Floats:
        """P_j(c_i) (s, s)."""
        c = np.array(self.nodes)
        return legendre.legvander(2.0 * c - 1.0, c.size - 1)

    @cached_property
    def coefficients(self) -> Floats:
        """A (s, s); its last row holds the weights."""
        c, s = np.array(self.nodes), len(self.nodes)
        # Q of A = Q P^-1
        integrals = [legendre.legval(2.0 * c - 1.0, legendre.legint(row, lbnd=-1)) / 2.0 for row in np.eye(s)]
        return np.linalg.solve(self.basis.T, np.array(integrals)).T

    @cached_property
    def _eigen(self):
        """Eigenvalues, the real one first, then one of each pair and its conjugate; eigenvectors."""
        values, vectors = np.linalg.eig(self.coefficients)
        # The real eigenvalue first, then by falling real part; of a pair the one with positive imaginary part first
        order = sorted(range(values.size), key=lambda i: (abs(values[i].imag) > 0.0, -values[i].real, -values[i].imag))
        return values[order], vectors[:, order]

    @property
    def eigenvalues(self) -> Floats:
        """Those of A, the real one first, then pairs."""
        return self._eigen[0]

    def error_weights(self) -> Floats:
        """Weights of the error estimate: of the step's start, then of each stage."""
        first, s = self.eigenvalues[0].real, len(self.nodes)
        # sum_i b_i P_j(c_i) = integral of P_j less what the start contributes, P_j(0) = (-1)^j
        wanted = np.eye(s)[0] - first * (-1.0) ** np.arange(s)
        return np.array([first, *np.linalg.solve(self.basis.T, wanted) - self.coefficients[-1]])

    def transformations(self) -> tuple[Floats, Floats]:
        """Stages to real and imaginary parts of their eigenvectors' coefficients, and back, (s, s) each."""
        vectors = self._eigen[1]
        inverse, there, back = np.linalg.inv(vectors), [], []
        # A real combination z + z* = 2 Re z of each pair: factors two and a sign go into the way back
        for m in range(0, vectors.shape[1], 2):  # the real one, then the first of each pair
            at = max(m - 1, 0)
            pair = m > 0
            there += [inverse[at].real, inverse[at].imag][: 1 + pair]
            back += [vectors[:, at].real * (1 + pair), -2.0 * vectors[:, at].imag][: 1 + pair]
        return np.array(there), np.array(back).T

    def output(self) -> Floats:
        """Values of the derivative at the start and at the nodes to its coefficients of P_j, (s + 1, s + 1).

        Its integrals over a step are those by the weights: the quadrature is exact for it.
        """
        return np.linalg.inv(legendre.legvander(2.0 * np.array(self.c) - 1.0, len(self.nodes)))

    @cached_property
    def numbers(self) -> Floats:
        """As `RungeKuttaTableau.numbers` with the start as first stage; then those of `parts_of`."""
        c, a, s = np.array(self.c), np.pad(self.coefficients, ((1, 0), (1, 0))), len(self.nodes)
        values = self.eigenvalues
        # Of each pair one eigenvalue
        shifts = [values[0].real, *np.ravel([[z.real, z.imag] for z in values[1::2]])]
        parts = a[1:, 1:], a[1:, 1:] @ a[1:, 1:], shifts, *self.transformations(), self.output()
        rows = [[0.0, c[i], *a[i]] for i in range(s + 1)]
        return np.concatenate([[s + 1], np.ravel(rows), a[-1], self.error_weights(), [0.0], *map(np.ravel, parts)])


class CollocationPlaces(NamedTuple):
    """Where numbers of a collocation method of s nodes begin: s s each, but s of `shifts`, (s + 1)^2 of `output`."""

    a: int  # A
    square: int  # A^2
    shifts: int  # eigenvalues: the real one, then real and imaginary part of one of each pair
    there: int  # stages to coefficients of eigenvectors, and back
    back: int
    output: int  # what is known of a step to coefficients of P_j


@kernel
def parts_of(tableau):
    """The `CollocationPlaces` of the numbers of a tableau."""
    stages = int(tableau[0])
    s, at = stages - 1, 1 + stages * (2 + stages) + 2 * stages + 1
    m = s * s
    return CollocationPlaces(at, at + m, at + 2 * m, at + 2 * m + s, at + 3 * m + s, at + 4 * m + s)


# Motion inside a step of a collocation method: a polynomial x'' and its integrals.
#
# x'' = sum_j K_j P_j, P_j the shifted Legendre polynomials, has the values of the step's start and of the stages. Its
# integrals reach x and x' of the step's end, since the quadrature by the stages alone is exact for them.

ROOM = MOST_STAGES + 4  # polynomials, and two of higher order for the integrals


@cache
def interpolant_of(stages):
    """The `Interpolant` of methods with so many stages."""
    return Interpolant(fill_collocation, collocation, lambda n, nx, ny: 1 + (3 + stages) * nx, stages + 2)


@callback(FILL)
def fill_collocation(context, run):
    """The number of coefficients; x and x' of the start; K_j."""
    r = load_run(run)
    size, n, data, at = int(r.tableau[0]), r.x.size, r.block[B_DATA:], parts_of(r.tableau).output
    data[0] = size
    data = data[1:]
    copy(r.x_old, data)
    copy(r.y_old, data[n:])
    # K_j = sum_i output_ji k_i: values at the nodes to Legendre coefficients
    for j in range(size):
        row, out = r.tableau[at + size * j :], data[(2 + j) * n :]
        for e in range(n):
            k = 0.0
            for i in range(size):
                k += row[i] * r.memory[(2 * i + 3) * n + e]
            out[e] = k
    return 0


@kernel
def _polynomials(s, count, P):
    """P[j] = P_j(s) for j < count."""
    x = 2.0 * s - 1.0
    P[0], P[1] = 1.0, x
    # (j + 1) P_{j+1} = (2 j + 1) x P_j - j P_{j-1}
    for j in range(1, count - 1):
        P[j + 1] = ((2 * j + 1) * x * P[j] - j * P[j - 1]) / (j + 1)


@kernel
def _integrate(first, count, P, Q):
    """Q[j], j < count, the integrals from 0 to s of P_j, or of the integrals that P holds; first is that of P[0]."""
    Q[0] = first
    # int P_j = (P_{j+1} - P_{j-1}) / (2 (2 j + 1)) on [0, s]
    for j in range(1, count):
        Q[j] = (P[j + 1] - P[j - 1]) / (2.0 * (2 * j + 1))


@callback(VALUE)
def collocation(s, h, n, nx, ny, data, x, y):
    """x = x0 + s h x0' + h^2 sum_j K_j (second integral of P_j), and x'."""
    data, x, y = vector(data, ANY), vector(x, nx), vector(y, nx)
    P, Q, R, size = stack(ROOM), stack(ROOM), stack(ROOM), int(data[0])
    # P_j at s, their first integrals Q and second integrals R from 0
    _polynomials(s, size + 2, P)
    _integrate(s, size + 1, P, Q)
    _integrate(0.5 * s * s, size, Q, R)
    data = data[1:]
    # x = x0 + h (s x0' + h sum_j R_j K_j),  x' = x0' + h sum_j Q_j K_j
    for e in range(nx):
        a, b = 0.0, 0.0
        for j in range(size - 1, -1, -1):
            k = data[(2 + j) * nx + e]
            a += R[j] * k
            b += Q[j] * k
        x[e] = data[e] + h * (s * data[nx + e] + h * a)
        y[e] = data[nx + e] + h * b
    return 0


@callback(VALUE)
def second_derivative(s, h, n, nx, ny, data, x, y):
    """x'' as y; x is left alone."""
    data, y = vector(data, ANY), vector(y, nx)
    P, size = stack(ROOM), int(data[0])
    _polynomials(s, size, P)
    # sum_j P_j K_j, the smallest terms first
    for e in range(nx):
        y[e] = 0.0
        for j in range(size - 1, -1, -1):
            y[e] += P[j] * data[1 + (2 + j) * nx + e]
    return 0
