"""The kernels written by hand, as contenders."""

from ..contender import Contender, Outcome, rotation, timed


class ByHand(Contender):
    """DOP853 with projection in absolute coordinates, or Taylor series."""

    values = tuple(10.0**-k for k in range(2, 16))

    def __init__(self, name, kinds):
        self.name, self.kinds = name, kinds

    def version(self):
        """Part of this folder."""
        return "benchmarks/by_hand"

    def serves(self, scene):
        """The mechanisms that it was written for."""
        return scene.family in self.kinds

    def prepare(self, scene):
        """Compile."""
        solve = self.kinds[scene.family](scene)
        solve(1e-2)

        def run(tol):
            seconds, (r, A, _) = timed(solve, tol)
            return Outcome(seconds, r, A if A.ndim == 3 else rotation(A))

        return run


def _top(scene):
    from . import top

    return top.solve


def _pendulum(scene):
    from . import pendulum

    start = [body["angular_velocity"] for body in scene.definition()["bodies"]]
    return lambda tol: pendulum.solve(tol, start)


def _chain(scene):
    from . import chain

    return lambda tol: chain.solve(scene.size, tol)


def _taylor_top(scene):
    from . import taylor_top

    return taylor_top.solve


def _taylor_chain(scene):
    from . import taylor_chain

    return lambda tol: taylor_chain.solve(scene.size, tol)


CONTENDERS = (
    ByHand("by hand, DOP853", {"top": _top, "pendulum": _pendulum, "chain": _chain}),
    ByHand("by hand, Taylor", {"top": _taylor_top, "chain": _taylor_chain}),
)
