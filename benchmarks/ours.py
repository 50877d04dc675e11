"""tsdyn as contender: the default method and every registered one; times are those of warm calls of `simulate`."""

from inspect import signature

import tsdyn as ts
from tsdyn.measuring.benchmark import poses

from .contender import Contender, Outcome, timed


class Ours(Contender):
    """One method of ts.integrators, or the default."""

    def __init__(self, name="tsdyn", kind=None):
        self.name, self.kind = name, kind
        known = {} if kind is None else signature(kind).parameters
        if kind is None or "rtol" in known:
            self.arguments = lambda value: {"rtol": value, "atol": value}
        elif "tol" in known:
            self.arguments = lambda value: {"tol": value}
        else:
            self.setting, self.values = "step", tuple(10.0 ** (-k / 2) for k in range(4, 10))
            self.arguments = lambda value: {"step": value}

    def version(self):
        """The package's."""
        return ts.__version__

    def serves(self, scene):
        """All but what would take minutes."""
        return self.kind is None or self.kind.__name__ not in scene.without

    def prepare(self, scene):
        """Build, and compile by a first run."""
        built = scene.build()
        span = (0.0, scene.end)

        def call(value):
            how = self.arguments(value) if self.kind is None else {"integrator": self.kind(**self.arguments(value))}
            return ts.simulate(built, span, t_eval=span, max_steps=scene.max_steps, **how)

        call(self.values[0])

        def run(value):
            seconds, solution = timed(call, value)
            if not solution.success:
                raise RuntimeError(solution.message)
            r, A = poses(solution)
            return Outcome(seconds, r[-1], A[-1])

        return run


def contenders():
    """The default, and every method that the package brings."""
    kinds = [kind for kind in ts.integrators.registered() if kind.__module__.startswith("tsdyn.")]
    return (Ours(), *(Ours(f"tsdyn, {kind.__name__}", kind) for kind in kinds))
