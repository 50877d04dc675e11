"""The chart workspace of the tangent form: base point q0, normal space at q0, chart coordinates of the bodies.

The chart coordinates of a body are a row of eight floats, (rho, 0, eta, 0): r = r0 + rho, p = p0 o (d0, d) with
d = eta / 2 and d0 = sqrt(1 - |d|^2), so that p has length one. It is the paper's chart q = q0 + V v - U u with xi = V v
and U spanning W0 Phi_q0^T, W0 the inverse mass matrix: xi_p is orthogonal to p0, and the component of u along a
normalisation row is d0 - 1.
"""

from typing import NamedTuple

import numpy as np

from ..jit.aligned_arrays import zeros
from ..jit.kernels import Record
from ..rows.interface import Rows, allocate_rows, lu_factors


class ChartState(Record):
    """What is known at the present configuration."""

    time: float  # of the last position solve
    factored: int  # 1 if lower and upper hold factors of N
    off: float  # error of these factors at the configuration itself, relative
    made: int  # 1 if lower and upper hold factors of N at any configuration of this chart
    placement: int  # number of the position solve at the end of the last step; 0 if the chart is of no use


class ChartWorkspace(NamedTuple):
    """b bodies and the ground, m rows that are no normalisations; "computed by" names the kernel."""

    base: np.ndarray  # ((b + 1) * 8,)  r0 and a zero, p0; chart_validity.set_base_point
    d: np.ndarray  # ((b + 1) * 4,)  d, d0 - 1 at present; chart_coordinates.displace
    x: np.ndarray  # ((b + 1) * 8,)  its coordinates; tangent.place
    y: np.ndarray  # ((b + 1) * 8,)  their rates; tangent.accelerate
    rows0: Rows  # H0, Y0, S0: the rows at q0; chart_validity.set_base_point
    X: np.ndarray  # (m * 16,)  C Y0; chart_matrix.factorise_chart_matrix
    lower: np.ndarray  # factors of N = H C Y0; chart_matrix.factorise_chart_matrix
    upper: np.ndarray
    drift: np.ndarray  # (m,)  Phi_t
    state: ChartState


def allocate_chart(graph):
    """Lay it out; the ground doesn't move, nor does a point mass turn."""
    nb, m = len(graph.bodies), len(graph.row)
    base = zeros(8 * (nb + 1))
    base[4::8] = 1.0
    return ChartWorkspace(
        base, zeros(4 * (nb + 1)), zeros(8 * (nb + 1)), zeros(8 * (nb + 1)),
        allocate_rows(graph), zeros(16 * m), *lu_factors(graph.pattern), zeros(m), ChartState(),
    )  # fmt: skip
