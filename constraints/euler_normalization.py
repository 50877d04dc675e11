"""Normalisation of the Euler parameters of a rigid body.

    Phi   = (p.p - 1) / 2     (1)  [-]
    Phi_x = p^T               (2)  x = p
    gamma = pd.pd             (3)

Every rigid body of a scene has one automatically.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..plugins import Parameters, Primitive

if TYPE_CHECKING:
    from ..hints import Body


class EulerNormalization(Primitive):
    """Unit length of the Euler parameters of a rigid body; `scene.add` returns the existing row of the body.

    Parameters
    ----------
    a : Body
        A rigid body.

    Raises
    ------
    InvalidBody
        If a is a point mass.
    InvalidConstraint
        If a is the ground.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> body = scene.add_body(mass=1.0, inertia=(1, 1, 1), name="top")
    >>> scene.constraints
    (<EulerNormalization 'EulerNormalization(top)'>,)
    >>> float(scene.evaluate().Phi[0])
    0.0
    """

    rows = 1
    markers = (Parameters("a"),)
    normalises = True

    def __init__(self, a: Body, *, name: str = "") -> None:
        super().__init__(a, None, (None,), name)

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        out[0] = 0.5 * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3] - 1.0)

    @staticmethod
    def jacobian(x, par, t, out):
        """Eq. (2)."""
        for i in range(4):
            out[0, i] = x[i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        """Eq. (3)."""
        out[0] = xd[0] * xd[0] + xd[1] * xd[1] + xd[2] * xd[2] + xd[3] * xd[3]
