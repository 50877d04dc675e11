"""MuJoCo with its Runge-Kutta method of order 4: a tree in minimal coordinates, and free bodies softly constrained."""

from tsdyn.measuring import engines

from .. import contender
from .tree import OnTrees


class MuJoCoTree(OnTrees):
    """Trees of hinges, slides and balls."""

    name, package, get = "MuJoCo, tree", "mujoco", "pip install mujoco"
    setting, values = "step", tuple(10.0 ** (-k / 2) for k in range(4, 11))
    joints, softness = (*engines.TREE, "Distance"), {}

    def prepare(self, scene):
        """Compile the model."""
        made = engines.MuJoCo(scene.build(), self.joints, **self.softness)

        def run(step):
            self.soften(made.model, step)
            motion = made.run(scene.end, step, 1, "rk4", contender.clock)
            return contender.Outcome(motion.seconds, motion.r[-1], motion.A[-1])

        return run

    def soften(self, model, step):
        """Set what depends on the step."""


class MuJoCoConstraints(MuJoCoTree):
    """Free bodies; points are connected softly, as stiff as the step allows."""

    name = "MuJoCo, constraints"
    joints, softness = (), {"solimp": (0.9999, 0.9999, 1e-3)}

    def serves(self, scene):
        """Spherical joints and distances."""
        if scene.definition is None or scene.size > 64:
            return False
        return {row[0] for row in scene.definition()["constraints"]} <= {"Spherical", "Distance"}

    def soften(self, model, step):
        """The stiffest constraint that the step allows."""
        model.opt.iterations, model.opt.tolerance = 100, 1e-10
        model.eq_solref[:] = 2.0 * step, 1.0
