"""MuJoCo with its Runge-Kutta method of order 4: a tree in minimal coordinates, and free bodies softly constrained."""

import numpy as np

from ..contender import Contender, Outcome, rotation, timed
from .tree import is_tree, links

STEPS = tuple(10.0 ** (-k / 2) for k in range(4, 11))


def _inertia(spec_body, body):
    spec_body.mass, spec_body.inertia = body["mass"], np.diag(body["inertia"])
    spec_body.ipos, spec_body.iquat, spec_body.explicitinertial = (0, 0, 0), (1, 0, 0, 0), True


class MuJoCo(Contender):
    """What both have in common."""

    setting, values = "step", STEPS
    get = "pip install mujoco"

    def version(self):
        """The package's."""
        import mujoco

        return f"MuJoCo {mujoco.__version__}"

    def prepare(self, scene):
        """Compile the model."""
        import mujoco

        definition = scene.definition()
        spec = mujoco.MjSpec()
        spec.option.gravity = definition["gravity"]
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        names, velocity = self.fill(mujoco, spec, definition)
        model = spec.compile()
        ids = [model.body(name).id for name in names]
        data = mujoco.MjData(model)
        load = np.zeros((model.nbody, 6))
        for _, body, arguments in definition.get("forces", ()):
            load[ids[body - 1], :3] = arguments["force"]

        def run(step):
            count = round(scene.end / step)
            mujoco.mj_resetData(model, data)
            self.soften(model, scene.end / count)
            model.opt.timestep = scene.end / count
            data.qvel[:] = velocity
            data.xfrc_applied[:] = load
            seconds, _ = timed(mujoco.mj_step, model, data, count)
            mujoco.mj_forward(model, data)
            return Outcome(seconds, data.xpos[ids].copy(), rotation(data.xquat[ids]))

        return run

    def soften(self, model, step):
        """Set what depends on the step."""


class MuJoCoTree(MuJoCo):
    """Trees of hinges, slides and balls."""

    name = "MuJoCo, tree"

    def serves(self, scene):
        """Trees."""
        return is_tree(scene) and scene.size <= 64

    def fill(self, mujoco, spec, definition):
        """Nested bodies; returns their names, and the velocity at the start."""
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        kinds = {kind: getattr(mujoco.mjtJoint, f"mjJNT_{kind.upper()}") for kind in ("slide", "hinge", "ball")}
        made, velocity = {-1: spec.worldbody}, []
        for link in links(definition)[0]:
            way = [move.step for move in link.moves]
            quat = np.empty(4)
            mujoco.mju_mat2Quat(quat, np.ascontiguousarray(link.turn).ravel())
            body = made[link.parent].add_body(
                name=f"body{link.body}", pos=link.place + link.turn @ (sum(way) + link.centre), quat=quat
            )
            _inertia(body, definition["bodies"][link.body])
            for k, move in enumerate(link.moves):
                at = -(link.centre + sum(way[k + 1 :], np.zeros(3)))
                axis = {} if move.axis is None else {"axis": move.axis}
                body.add_joint(type=kinds[move.kind], pos=at, **axis)
                velocity.extend(np.atleast_1d(move.rate))
            made[link.body] = body
        return [f"body{i}" for i in range(len(definition["bodies"]))], velocity


class MuJoCoConstraints(MuJoCo):
    """Free bodies; points are connected softly, as stiff as the step allows."""

    name = "MuJoCo, constraints"

    def serves(self, scene):
        """Spherical joints and distances."""
        if scene.definition is None or scene.size > 64:
            return False
        return {row[0] for row in scene.definition()["constraints"]} <= {"Spherical", "Distance"}

    def fill(self, mujoco, spec, definition):
        """Free bodies and equalities; returns their names, and the velocity at the start."""
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        spec.option.iterations, spec.option.tolerance = 100, 1e-10
        made, velocity = [spec.worldbody], []
        for i, given in enumerate(definition["bodies"]):
            body = spec.worldbody.add_body(name=f"body{i}", pos=given["position"], quat=given["orientation"])
            _inertia(body, given)
            body.add_freejoint()
            velocity += [*given["velocity"], *given["angular_velocity"]]
            made.append(body)
        for i, (kind, a, b, given) in enumerate(definition["constraints"]):
            points = [np.zeros(3), *(np.array(given[name], float) for name in ("point_a", "point_b"))][1:]
            ends = [
                made[body].add_site(name=f"end{i}{side}", pos=at)
                for side, body, at in zip("ab", (a, b), points, strict=True)
            ]
            if kind == "Spherical":
                equality = spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE)
                equality.name1, equality.name2 = ends[0].name, ends[1].name
            else:
                tendon = spec.add_tendon(name=f"rod{i}")
                for one in ends:
                    tendon.wrap_site(one.name)
                equality = spec.add_equality(type=mujoco.mjtEq.mjEQ_TENDON, name1=tendon.name)
            equality.solimp[:3] = 0.9999, 0.9999, 1e-3
        return [f"body{i}" for i in range(len(definition["bodies"]))], velocity

    def soften(self, model, step):
        """The stiffest constraint that the step allows."""
        model.eq_solref[:] = 2.0 * step, 1.0
