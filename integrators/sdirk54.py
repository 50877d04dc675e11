"""SDIRK54: diagonally implicit, L-stable, stiffly accurate, order 5(4): ESDIRK5(4)7L[2]SA2.

C. A. Kennedy, M. H. Carpenter, Diagonally implicit Runge-Kutta methods for stiff ODEs, Appl. Numer. Math. 146, 221-244
(2019). Seven stages with the same diagonal, the first explicit; stage order 2; the error estimate is of order 4.
"""

from fractions import Fraction as F

from ..plugins import DiagonallyImplicit, ImplicitTableau

_G = F(23, 125)
_C = (
    F(0),
    2 * _G,
    F(7121331996143, 11335814405378),
    F(49, 353),
    F(3706679970760, 5295570149437),
    F(347, 382),
    F(1),
)
_A = (  # rows from the second column to before the diagonal
    (),
    (),
    (F(791020047304, 3561426431547),),
    (F(-158159076358, 11257294102345), F(-85517644447, 5003708988389)),
    (F(-1653327111580, 4048416487981), F(1514767744496, 9099671765375), F(14283835447591, 12247432691556)),
    (
        F(-4540011970825, 8418487046959),
        F(-1790937573418, 7393406387169),
        F(10819093665085, 7266595846747),
        F(4109463131231, 7386972500302),
    ),
    (
        F(-188593204321, 4778616380481),
        F(2809310203510, 10304234040467),
        F(1021729336898, 2364210264653),
        F(870612361811, 2470410392208),
        F(-1307970675534, 8059683598661),
    ),
)
_EMBEDDED = (
    F(-582099335757, 7214068459310),
    F(615023338567, 3362626566945),
    F(3192122436311, 6174152374399),
    F(6156034052041, 14430468657929),
    F(-1011318518279, 9693750372484),
    F(1914490192573, 13754262428401),
)


def _row(i):
    """Row i of a: the first entry makes the sum c, the last is the diagonal."""
    return (_C[i] - sum(_A[i]) - _G, *_A[i], _G) if i else (F(0),)


class SDIRK54(DiagonallyImplicit):
    """L-stable diagonally implicit Runge-Kutta method of order 5 with an error estimate of order 4, for stiff scenes.

    Examples
    --------
    A hard stop of 1e8 N/m with 1e5 N s/m, on which a mass settles; explicit methods would need steps of 10 us:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> mass = scene.add_point_mass(mass=1.0, position=(0, 0, 1))
    >>> stop = scene.add(ts.forces.Spring(mass, scene.ground, stiffness=1e8, damping=1e5))
    >>> solution = ts.simulate(scene, (0, 1), integrator=ts.integrators.SDIRK54())
    >>> print(solution.stats.steps < 500, f"{solution.position(mass)[-1, 2] - 1:.3e} m")
    True -1.000e-07 m
    """

    order = 5
    safety = 500.0  # of the sliding top's errors: 13 tol
    tableau = ImplicitTableau(
        a=tuple(tuple(map(float, _row(i))) for i in range(7)),
        c=tuple(map(float, _C)),
        order=5,
        error=tuple(float(b - d) for b, d in zip(_row(6), (1 - sum(_EMBEDDED), *_EMBEDDED), strict=True)),
        embedded_order=4,
    )
