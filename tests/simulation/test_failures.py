"""A run that ends early hands back what it has: finite, consistent, with the reason, the time and a remedy."""

import math

import numpy as np
import pytest

import tsdyn as ts

C = ts.constraints
Status = ts.Status
FORMS = ["tangent", "maggi-kane"]
LOST = {Status.NEWTON_FAILED, Status.CHART_LOST, Status.SINGULAR}  # of a step that cannot be made


def zero(t):
    return 0.0


def run(scene, end, step, **arguments):
    return ts.simulate(scene, (0.0, end), integrator=ts.integrators.Nystrom4(step=step), **arguments)


def check_partial(solution, statuses, begin=0.0):
    """Everything that a solution of a run that ended early has to be."""
    assert not solution.success, solution
    assert solution.status in statuses, solution.message
    reached = solution.state.t
    assert f"t = {reached:.9g} s" in solution.message
    assert solution.status.sentence in solution.message
    assert solution.status.remedy
    assert solution.status.remedy in solution.message or Status.SINGULAR.remedy in solution.message
    with pytest.raises(ts.StepFailure) as caught:
        solution.raise_if_failed()
    assert caught.value.solution is solution
    assert str(caught.value) == solution.message

    k, n = solution.t.size, solution.scene.start[0].size
    m = sum(constraint.rows for constraint in solution.scene.constraints)
    assert solution.q.shape == solution.qd.shape == solution.qdd.shape == (k, n)
    assert solution.multipliers.shape == (k, m)
    assert solution.energy.shape == (k,)
    assert solution.angular_momentum.shape == (k, 3)
    for constraint in solution.scene.constraints:
        force, torque = solution.reaction(constraint)
        assert force.shape == torque.shape == (k, 3)
    for name in ("t", "q", "qd", "qdd", "multipliers", "energy"):
        assert np.isfinite(getattr(solution, name)).all(), name
    for name, part in solution.state._asdict().items():
        assert np.isfinite(part).all(), f"state.{name}"
    assert (np.diff(solution.t) > 0.0).all()
    assert (solution.t >= begin).all()
    assert (solution.t <= reached).all()
    for part in solution.constraint_error:
        assert part.shape == (k,)
    if solution.formulation != "maggi-kane":
        assert solution.constraint_error.position.max(initial=0.0) < 1e-12
    steps = solution.steps
    assert steps.t.shape == steps.h.shape == steps.accepted.shape
    assert steps.accepted.sum() == solution.stats.steps
    assert (~steps.accepted).sum() == solution.stats.rejected
    return solution


def check_every_step(solution, begin=0.0):
    """Of a run without t_eval: the start and the end of every accepted step, the last of which is the state."""
    assert solution.t.size == solution.stats.steps + 1
    assert solution.t[0] == begin
    assert solution.t[-1] == solution.state.t
    for i, name in enumerate(("q", "qd", "qdd")):
        np.testing.assert_array_equal(getattr(solution, name)[-1], solution.state[1 + i])


def check_outputs(solution, times):
    """Of a run with t_eval: all the times that it asks for up to the end, and no other."""
    np.testing.assert_array_equal(solution.t, times[times <= solution.state.t])


def pendulum(spin=0.0):
    """A rod on a pivot, level; spin turns it about its own axis."""
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1.0, 1.0, 1.0), (1.0, 0.0, 0.0), angular_velocity=(spin, 0.0, 0.0), name="rod")
    scene.add(C.Spherical(rod, scene.ground, point_a=(-1.0, 0.0, 0.0), name="pivot"))
    return scene


# singular configurations: where they are reached, s


def chain():
    """Two links and a string from the last one's end to the first one's pivot that pays out until it is all flat."""
    scene, half, middle = ts.Scene(), 0.5, math.pi / 6
    x, z = half * math.cos(middle), half * math.sin(middle)
    links = [
        scene.add_body(1.0, (0.01, 0.1, 0.1), at, (math.cos(turn / 2), 0.0, -math.sin(turn / 2), 0.0), name=name)
        for name, at, turn in (("first", (x, 0.0, z), middle), ("second", (3 * x, 0.0, z), -middle))
    ]
    first, second = links
    scene.add(C.Spherical(scene.ground, first, point_b=(-half, 0.0, 0.0), name="pivot"))
    scene.add(C.Spherical(first, second, point_a=(half, 0.0, 0.0), point_b=(-half, 0.0, 0.0), name="knee"))
    length = (lambda t: 1.7320508075688772 + 0.2 * t * t, lambda t: 0.4 * t, lambda t: 0.4)
    scene.add(C.Distance(second, scene.ground, point_a=(half, 0.0, 0.0), length=length, name="string"))
    return scene


def two_strings():
    """A bead on two strings that are wound in until they are one straight line."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    bead = scene.add_point_mass(1.0, position=(0.0, 0.0, math.sqrt(1.25)), name="bead")
    length = (lambda t: 1.5 - 0.5 * t * t, lambda t: -t, lambda t: -1.0)
    for x in (1.0, -1.0):
        scene.add(C.Distance(bead, scene.ground, point_b=(x, 0.0, 0.0), length=length, name=f"string at {x:g}"))
    return scene


def parallelogram():
    """A parallelogram that turns at 1 rad/s towards its dead centre, where it could also fold."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    arm, velocity = np.array([math.cos(0.5), math.sin(0.5), 0.0]), (-math.sin(0.5), math.cos(0.5), 0.0)
    pins = [scene.add_point_mass(1.0, arm + np.array([x, 0.0, 0.0]), velocity, name=f"pin {x:g}") for x in (0.0, 2.0)]
    for pin, x in zip(pins, (0.0, 2.0), strict=True):
        scene.add(C.Dot2(scene.ground, pin, axis_a=(0, 0, 1), name=f"plane of {pin.name}"))
        scene.add(C.Distance(pin, scene.ground, point_b=(x, 0.0, 0.0), name=f"crank of {pin.name}"))
    scene.add(C.Distance(*pins, name="coupler"))
    scene.add(ts.forces.PointForce(pins[0], force=lambda t: (0.0, 0.0, 0.0)))  # it has no series to pass that place by
    return scene


def turntable():
    """A body turned about z by its Dot1 until the two axes are parallel."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    turn, rate = math.pi / 3, -0.4 / math.sin(math.pi / 3)
    body = scene.add_body(
        1.0, (1, 1, 1), orientation=(math.cos(turn / 2), 0, 0, math.sin(turn / 2)), angular_velocity=(0, 0, rate)
    )
    cosine = (lambda t: 0.5 + 0.4 * t, lambda t: 0.4, zero)
    scene.add(C.Dot1(body, scene.ground, axis_a=(1, 0, 0), axis_b=(1, 0, 0), value=cosine, name="turn"))
    scene.add(C.Dot1(body, scene.ground, axis_a=(1, 0, 0), axis_b=(0, 0, 1), name="level"))
    return scene


SINGULAR = {
    "chain": (chain, math.sqrt((2.0 - math.sqrt(3.0)) / 0.2)),
    "two strings": (two_strings, 1.0),
    "parallelogram": (parallelogram, math.pi - 0.5),
    "turntable": (turntable, 1.25),
}


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("step", [1e-3, 1e-2, 1e-1])
@pytest.mark.parametrize(("build", "instant"), SINGULAR.values(), ids=SINGULAR.keys())
def test_singular_configuration(build, instant, step, formulation):
    solution = check_partial(run(build(), 2.0 * instant, step, formulation=formulation), LOST)
    check_every_step(solution)
    late = step if formulation == "maggi-kane" else 1e-9  # its q has left the constraints, and what it meets is its own
    assert solution.t[-1] <= instant + late
    assert solution.t[-1] > instant - (8.0 * step if step < 0.1 else instant)


@pytest.mark.parametrize("build", [build for build, _ in SINGULAR.values()], ids=SINGULAR.keys())
def test_singular_configuration_is_called_so(build):
    """A smaller step does not help there: the message says what does not fit any more."""
    scene = build()
    message = run(scene, 5.0, 1e-3).message
    names = [c.name for c in scene.constraints if not isinstance(c, C.EulerNormalization)]
    assert any(name in message for name in names), message


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("build", [build for build, _ in SINGULAR.values()], ids=SINGULAR.keys())
def test_singular_configuration_with_t_eval(build, formulation):
    times = np.linspace(0.0, 5.0, 301)
    solution = check_partial(run(build(), 5.0, 1e-2, formulation=formulation, t_eval=times), LOST)
    check_outputs(solution, times)


class Fading(ts.Primitive):
    """A height that is held until t = 0.505 and then forgotten: the row of Phi_q is zero from there on."""

    rows = 1
    markers = (ts.Point("a"),)

    def __init__(self, a, *, name=""):
        super().__init__(a, None, ((0.0, 0.0, 0.0),), name)
        self.weight = ts.Motion(lambda t: 1.0 if t < 0.505 else 0.0, zero, zero, name)

    def parameters(self):
        return (self.weight,)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = par[0] * x[2]

    @staticmethod
    def jacobian(x, par, t, out):
        out[0, 2] = par[0]

    @staticmethod
    def phi_t(x, par, t, out):
        out[0] = par[1] * x[2]

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = 2.0 * par[1] * xd[2] + par[2] * x[2]


@pytest.mark.parametrize("formulation", FORMS)
def test_lost_rank(formulation):
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, velocity=(1.0, 0.0, 0.0), name="bead")
    scene.add(Fading(bead, name="fading"))
    scene.add(C.Dot2(scene.ground, bead, axis_a=(0, 1, 0), name="lane"))
    solution = check_partial(run(scene, 1.0, 1e-2, formulation=formulation), {Status.SINGULAR})
    check_every_step(solution)
    assert solution.t[-1] == pytest.approx(0.5)


# steps too large


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize(("spin", "step"), [(0.0, 1.0), (0.0, 2.0), (0.0, 5.0), (30.0, 0.1), (30.0, 0.5), (300.0, 0.1)])
def test_step_far_too_large(spin, step, formulation):
    solution = check_partial(run(pendulum(spin), 5.0, step, formulation=formulation), LOST)
    check_every_step(solution)
    assert "smaller step" in solution.message
    assert run(pendulum(spin), 0.05, 1e-4, formulation=formulation).success


@pytest.mark.parametrize("formulation", FORMS)
def test_newton_fails_at_once(formulation):
    scene = ts.Scene()
    body = scene.add_body(1.0, (1.0, 2.0, 2.5), angular_velocity=(1.0, 30.0, 2.0))
    times = np.array([0.0, 0.3, 2.0])
    solution = check_partial(run(scene, 2.0, 0.2, formulation=formulation, t_eval=times), LOST)
    check_outputs(solution, times)
    assert solution.stats.steps == 0
    np.testing.assert_array_equal(solution.state.q, body.q)
    np.testing.assert_allclose(solution.angular_velocity(body)[-1], body.angular_velocity, atol=1e-14)


# motions that stop being numbers


def breaking(value):
    return lambda t: 0.0 if t < 0.505 else value


BROKEN = {name: breaking(value) for name, value in {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}.items()}


def lift(motion, driven):
    """A bead whose height is prescribed; driven wholly, or free in the plane."""
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, velocity=(0.0 if driven else 1.0, 0.0, 0.0), name="bead")
    scene.add(C.Dot2(scene.ground, bead, axis_a=(0, 0, 1), value=motion, name="lift"))
    if driven:
        scene.add(C.Dot2(scene.ground, bead, axis_a=(1, 0, 0), name="x"))
        scene.add(C.Dot2(scene.ground, bead, axis_a=(0, 1, 0), name="y"))
    return scene


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("driven", [False, True], ids=["free", "driven"])
@pytest.mark.parametrize("part", [0, 1, 2], ids=["f", "fd", "fdd"])
@pytest.mark.parametrize("broken", BROKEN.values(), ids=BROKEN.keys())
def test_motion_stops_being_a_number(broken, part, driven, formulation):
    motion = [zero, zero, zero]
    motion[part] = broken
    solution = check_partial(run(lift(motion, driven), 1.0, 1e-2, formulation=formulation), {Status.NOT_FINITE})
    check_every_step(solution)
    assert solution.t[-1] == pytest.approx(0.5)
    assert "motion" in solution.message


@pytest.mark.parametrize("driven", [False, True], ids=["free", "driven"])
def test_motion_stops_being_a_number_with_t_eval(driven):
    times = np.linspace(0.0, 1.0, 37)
    solution = check_partial(
        run(lift((zero, zero, BROKEN["nan"]), driven), 1.0, 1e-2, t_eval=times), {Status.NOT_FINITE}
    )
    check_outputs(solution, times)


def test_motion_is_no_number_where_no_step_looks():
    gap = (lambda t: math.nan if 0.4951 < t < 0.4959 else 0.0, zero, zero)
    assert run(lift(gap, False), 1.0, 1e-2).success
    times = np.array([0.1, 0.4, 0.4955, 0.6])
    solution = check_partial(run(lift(gap, False), 1.0, 1e-2, t_eval=times), {Status.NOT_FINITE})
    np.testing.assert_array_equal(solution.t, times[:2])


@pytest.mark.parametrize("name", ["nan", "inf"])
@pytest.mark.parametrize("part", [0, 1, 2], ids=["f", "fd", "fdd"])
def test_motion_is_no_number_at_the_start(name, part):
    """Nothing runs, and it is not the bodies that are told to move."""
    motion = [zero, zero, zero]
    motion[part] = BROKEN[name]
    with pytest.raises(ts.TsdynError, match="finite") as caught:
        ts.simulate(lift(motion, False), (0.6, 1.0), integrator=ts.integrators.Nystrom4(1e-2))
    assert "poses" not in str(caught.value)
    assert "velocities" not in str(caught.value)


class Rotten(ts.Primitive):
    """A point held at the origin, whose gamma is no number from t = 0.505 on."""

    rows = 3
    markers = (ts.Point("a"),)

    def __init__(self, a, *, name=""):
        super().__init__(a, None, ((0.0, 0.0, 0.0),), name)

    @staticmethod
    def phi(x, par, t, out):
        for i in range(3):
            out[i] = x[i]

    @staticmethod
    def jacobian(x, par, t, out):
        for i in range(3):
            out[i, i] = 1.0

    @staticmethod
    def gamma(x, xd, par, t, out):
        for i in range(3):
            out[i] = 0.0 * np.sqrt(0.505 - t)


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("kind", ["rigid body", "point mass"])
def test_plug_in_stops_being_a_number(kind, formulation):
    """Whether or not a degree of freedom is left."""
    scene = ts.Scene()
    inertia = {"inertia": (1.0, 1.0, 1.0)} if kind == "rigid body" else {}
    body = (scene.add_body if inertia else scene.add_point_mass)(mass=1.0, **inertia)
    scene.add(Rotten(body, name="rotten"))
    solution = check_partial(run(scene, 1.0, 1e-2, formulation=formulation), {Status.NOT_FINITE})
    check_every_step(solution)
    assert solution.t[-1] == pytest.approx(0.5)


def late_error(t):
    if 0.6 < t < 0.65:  # away from the times at which derivatives are checked
        raise ValueError("between two pages of the table")
    return 1.0


def test_motion_that_raises_is_never_taken_for_zero():
    scene = lift((late_error, zero, zero), False)
    scene.bodies[0].position = (0.0, 0.0, 1.0)
    try:
        solution = run(scene, 1.0, 1e-2)
    except ts.InvalidConstraint as error:
        assert "lift" in str(error)  # noqa: PT017  (refused before the run: as good)
        return
    check_partial(solution, {Status.NOT_FINITE})
    assert (solution.q[:, 2] == 1.0).all()


def test_plug_in_that_raises_is_never_taken_for_zero():
    def phi(x, par, t, out):
        if t > 0.105:
            raise ValueError("beyond the last page of the table")
        out[0] = x[2]

    def jacobian(x, par, t, out):
        out[0, 2] = 1.0

    def gamma(x, xd, par, t, out):
        out[0] = 0.0

    def start(self, a):
        ts.Primitive.__init__(self, a, None, ((0.0, 0.0, 0.0),), "level")

    kernels = {name: staticmethod(f) for name, f in {"phi": phi, "jacobian": jacobian, "gamma": gamma}.items()}
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, name="bead")
    try:
        kind = type("Raising", (ts.Primitive,), {"rows": 1, "markers": (ts.Point("a"),), "__init__": start, **kernels})
        scene.add(kind(bead))
        solution = run(scene, 0.2, 1e-2)
    except ts.InvalidConstraint as error:
        assert "Raising" in str(error) or "level" in str(error)  # noqa: PT017  (refused before the run: as good)
        return
    assert not solution.success
    assert solution.state.t == pytest.approx(0.1)


def test_overflow_ends_the_run():
    scene = ts.Scene()
    scene.add_point_mass(1.0, velocity=(1e308, 0.0, 0.0), name="bead")
    solution = run(scene, 10.0, 0.1)
    assert solution.status == Status.NOT_FINITE
    for name in ("t", "q", "qd", "qdd"):
        assert np.isfinite(getattr(solution, name)).all()
    assert solution.state.t == solution.t[-1] < 1.8


# axes without inertia


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("joint", [None, "ball"])
def test_free_axis_without_inertia_is_refused_whatever_the_pose(joint, formulation, rng):
    for _ in range(40):
        scene = ts.Scene()
        scene.add_body(2.0, (1.0, 1.0, 1.0), (9.0, 9.0, 9.0), name="bystander")
        p = rng.normal(size=4)
        rod = scene.add_body(
            1.0,
            (1.0, 1.0, 0.0),
            rng.normal(size=3),
            p / np.linalg.norm(p),
            angular_velocity=rng.normal(size=3),
            name="rod",
        )
        if joint:
            scene.add(C.Spherical(rod, scene.ground, point_a=(0.0, 0.0, -1.0), name="joint"))
            scene.assemble()
        with pytest.raises(ts.SingularConfiguration, match=r"rod.*inertia") as caught:
            run(scene, 1.0, 1e-2, formulation=formulation)
        assert "Give it inertia" in str(caught.value)


def held_rod(speed):
    """A rod without inertia about its length, which a Dot1 holds but for the instant at which it points along y."""
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1.0, 1.0, 0.0), angular_velocity=(speed, 0.0, 0.0), name="rod")
    scene.add(C.Dot1(rod, scene.ground, axis_a=(1, 0, 0), axis_b=(0, 1, 0), name="key"))
    return scene


@pytest.mark.parametrize("formulation", FORMS)
def test_axis_without_inertia_that_is_held(formulation):
    solution = run(held_rod(0.5), 1.0, 1e-2, formulation=formulation).raise_if_failed()
    np.testing.assert_allclose(solution.angular_velocity(solution.scene.bodies[0]), [[0.5, 0.0, 0.0]] * 101, atol=1e-9)


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("steps", [100, 1000])
def test_axis_without_inertia_that_comes_free(steps, formulation):
    step = math.pi / 2 / steps
    solution = check_partial(run(held_rod(1.0), 3.0, step, formulation=formulation), {Status.MASS_SINGULAR})
    check_every_step(solution)
    assert solution.t[-1] == pytest.approx(math.pi / 2 - step)


# ends that are asked for


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("most", [1, 10, 99])
def test_max_steps(most, formulation):
    scene = pendulum()
    whole = run(scene, 1.0, 1e-2, formulation=formulation).raise_if_failed()
    solution = check_partial(run(scene, 1.0, 1e-2, formulation=formulation, max_steps=most), {Status.MAX_STEPS})
    check_every_step(solution)
    assert solution.stats.steps == most
    assert "max_steps" in solution.message
    for name in ("t", "q", "qd", "qdd"):
        np.testing.assert_array_equal(getattr(solution, name), getattr(whole, name)[: most + 1])
    assert run(scene, 1.0, 1e-2, formulation=formulation, max_steps=100).success


@pytest.mark.parametrize("times", [[0.0, 0.005, 0.06, 0.1, 0.100001], [0.0, 1.0], [0.5]], ids=str)
def test_max_steps_with_t_eval(times):
    times = np.array(times)
    solution = check_partial(run(pendulum(), 1.0, 1e-2, max_steps=10, t_eval=times), {Status.MAX_STEPS})
    assert solution.state.t == pytest.approx(0.1)
    check_outputs(solution, times)


@pytest.mark.parametrize("formulation", FORMS)
def test_a_run_goes_on_from_its_state(formulation):
    scene = pendulum()
    whole = run(scene, 1.0, 1e-3, formulation=formulation)
    half = run(scene, 1.0, 1e-3, formulation=formulation, max_steps=400)
    begin = half.state.t
    rest = ts.simulate(scene, (begin, 1.0), integrator=ts.integrators.Nystrom4(1e-3), state=half.state)
    np.testing.assert_allclose(rest.raise_if_failed().q[-1], whole.q[-1], atol=1e-9)


class Interrupt:
    """A progress function that raises at its n-th call, and keeps what it was told."""

    def __init__(self, error, call):
        self.error, self.call, self.fractions = error, call, []

    def __call__(self, fraction):
        self.fractions.append(fraction)
        if len(self.fractions) == self.call:
            raise self.error


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("call", [1, 2, 3])
def test_interrupt(call, formulation):
    scene = pendulum()
    progress = Interrupt(KeyboardInterrupt(), call)
    solution = check_partial(run(scene, 20.0, 1e-3, formulation=formulation, progress=progress), {Status.INTERRUPTED})
    check_every_step(solution)
    assert len(progress.fractions) == call
    assert progress.fractions[-1] == pytest.approx(solution.t[-1] / 20.0)
    assert 0 < solution.stats.steps < 20000
    whole = run(scene, 20.0, 1e-3, formulation=formulation, max_steps=solution.stats.steps)
    np.testing.assert_array_equal(solution.q, whole.q)


def test_interrupt_after_the_last_step_is_too_late():
    solution = run(pendulum(), 0.5, 1e-3, progress=Interrupt(KeyboardInterrupt(), 1))
    assert solution.t[-1] == 0.5
    assert solution.success


def test_interrupt_with_t_eval():
    times = np.linspace(0.0, 20.0, 77)
    solution = run(pendulum(), 20.0, 1e-3, progress=Interrupt(KeyboardInterrupt(), 2), t_eval=times)
    check_outputs(check_partial(solution, {Status.INTERRUPTED}), times)


@pytest.mark.parametrize("error", [ZeroDivisionError("oops"), RuntimeError("window closed"), StopIteration()], ids=repr)
def test_progress_that_raises(error):
    """Hours of computing are not lost to a progress bar: the solution so far comes back, and says who stopped it."""
    solution = run(pendulum(), 20.0, 1e-3, progress=Interrupt(error, 2))
    check_every_step(check_partial(solution, {Status.INTERRUPTED}))
    assert type(error).__name__ in solution.message
    assert str(error) in solution.message


def test_progress_reaches_the_end():
    progress = Interrupt(None, 0)
    run(pendulum(), 5.0, 1e-3, progress=progress).raise_if_failed()
    assert progress.fractions == sorted(progress.fractions)
    assert progress.fractions[-1] == 1.0


def test_success_is_no_failure():
    solution = run(pendulum(), 1.0, 1e-2)
    assert solution.raise_if_failed() is solution
    assert solution.status == Status.SUCCESS


def test_every_status_has_a_sentence_and_failures_a_remedy():
    for status in Status:
        assert status.sentence.endswith(".")
        assert bool(status.remedy) == (status not in (Status.SUCCESS, Status.EVENT, Status.SLICE_DONE, Status.PASSAGE))


@pytest.mark.parametrize("count", [1, 2])
def test_message_counts_in_english(count):
    message = run(pendulum(), 1.0, 1e-2, max_steps=count).message
    assert ("1 step." in message) if count == 1 else ("2 steps." in message)


def test_failed_runs_leave_the_scene_alone_and_do_not_matter_to_the_next():
    scene = pendulum()
    before = [part.copy() for part in scene.start]
    good = run(scene, 1.0, 1e-2)
    for arguments in ({"max_steps": 3}, {"progress": Interrupt(KeyboardInterrupt(), 1)}):
        run(scene, 1.0, 1e-2, **arguments)
    run(scene, 5.0, 1.0)
    for part, now in zip(before, scene.start, strict=True):
        np.testing.assert_array_equal(part, now)
    np.testing.assert_array_equal(run(scene, 1.0, 1e-2).q, good.q)
