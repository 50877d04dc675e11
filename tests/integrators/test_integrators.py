"""Every integrator passes check_integrator, and check_integrator catches methods with faults."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.built_in import INTEGRATORS
from tsdyn.jit.kernels import ANY
from tsdyn.maths.dense_linalg import copy
from tsdyn.methods import integrator
from tsdyn.methods.explicit import call_accelerate, call_place, callback, step_kernel, vector
from tsdyn.methods.interpolants import HERMITE, VALUE, Interpolant
from tsdyn.testing import integrator_checks, integrator_scenes

I = ts.integrators
CLASSICAL = I.Nystrom4.first_order


@pytest.fixture(autouse=True)
def restore_registry():
    """Classes made here are forgotten again."""
    before = dict(integrator._registry)
    yield
    integrator._registry.clear()
    integrator._registry.update(before)


@pytest.fixture
def one_scene(monkeypatch):
    """The quickest of the scenes only."""
    monkeypatch.setattr(integrator_scenes, "SCENES", {"sliding top": integrator_scenes.SCENES["sliding top"]})


@pytest.mark.slow_but("Taylor")
@pytest.mark.parametrize("kind", INTEGRATORS)
def test_built_in(kind):
    series = kind is I.Taylor
    findings = ts.testing.check_integrator((lambda **given: I.Taylor(order=6, **given)) if series else kind)
    forms = {finding.formulation for finding in findings}
    assert forms == ({"tangent"} if kind.implicit or series else {"tangent", "maggi-kane"})
    assert len(findings) == 3 * len(forms)
    assert all(len(finding.errors) == (3 if kind.embedded_order else 0) for finding in findings)


def test_a_callable_will_do(one_scene):
    ts.testing.check_integrator(lambda **settings: I.RK45(**settings))


def fails(method, match, **options):
    with pytest.raises(ts.testing.CheckFailed, match=match) as caught:
        ts.testing.check_integrator(method, **options)
    assert type(method).__name__ == "function" or method.__name__ in str(caught.value)


def test_order_declared_too_high(one_scene):
    class Five(I.Nystrom4):
        order = 5

    fails(Five, r"sliding top, formulation 'tangent': the observed order is 4\.\d\d, 5 is declared")


def test_order_declared_too_low(one_scene):
    class Three(I.Nystrom4):
        order = 3

    fails(Three, r"observed order is 4\.\d\d or more on every scene, 3 is declared")


@pytest.mark.parametrize("entry", [2, 5])
def test_wrong_coefficient(entry, one_scene):
    """A per mille off: what RungeKuttaTableau can't see where a kernel gets numbers of the method's own."""

    class Wrong(I.RK45):
        order = 5

        def kernel(self, first_order):
            step, numbers, memory = super().kernel(first_order)
            numbers = numbers.copy()
            numbers[1 + 8 * entry + 2] *= 1.001
            return step, numbers, memory

    fails(Wrong, r"observed order is [0-3]\.\d\d, 5 is declared|do not converge")


def scaled(factor):
    """RK45 with its error estimate times a factor."""

    class Bold(ts.ExplicitRungeKutta):
        order = 5
        tableau = ts.RungeKuttaTableau(
            I.RK45.tableau.a,
            I.RK45.tableau.b,
            I.RK45.tableau.c,
            5,
            tuple(factor * w for w in I.RK45.tableau.error),
            embedded_order=4,
        )

    return Bold


def test_error_estimate_too_small(one_scene):
    fails(scaled(1e-2), r"the error is .* times the tolerance; 100 times are allowed")


def test_no_error_estimate(one_scene):
    """All its weights are zero: steps grow as far as charts reach."""
    fails(scaled(0.0), r"the error is .* times the tolerance; 100 times are allowed")


def test_error_estimate_of_a_lower_order(one_scene):
    """The difference to Euler's method, declared as of order four: steps far too many at tight tolerances."""
    b = I.RK45.tableau.b
    euler = (1e-3 * (b[0] - 1.0), *(1e-3 * x for x in b[1:]), 0.0)

    class Timid(ts.ExplicitRungeKutta):
        order = 5
        tableau = ts.RungeKuttaTableau(I.RK45.tableau.a, b, I.RK45.tableau.c, 5, euler, embedded_order=4)

    fails(Timid, "the estimate has a lower order than is declared")


@callback(VALUE)
def straight(s, h, n, nx, ny, data, x, y):
    """The line between the ends."""
    data, x, y = vector(data, 6 * nx), vector(x, nx), vector(y, nx)
    for i in range(nx):
        x[i] = (1.0 - s) * data[i] + s * data[3 * nx + i]
        y[i] = (1.0 - s) * data[nx + i] + s * data[4 * nx + i]
    return 0


def test_wrong_dense_output(one_scene):
    class Straight(I.Nystrom4):
        order = 4

        def interpolant(self, first_order):
            return (
                super().interpolant(first_order) if first_order else Interpolant(HERMITE.fill, straight, HERMITE.size)
            )

    fails(Straight, r"dense output has the observed order 2\.\d\d and should have 4")


@step_kernel
def remembering(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, numbers, memory, dx, dy):
    """Heun's method, but with the derivative found at the end of the last step tried for that at the start."""
    x, y, yd, dx, dy, memory = (
        vector(x, nx),
        vector(y, nx),
        vector(yd, nx),
        vector(dx, nx),
        vector(dy, nx),
        vector(memory, ANY),
    )
    xs, ys, k, first = memory[:nx], memory[nx : 2 * nx], memory[2 * nx : 3 * nx], memory[3 * nx : 4 * nx]
    if memory[4 * nx] == 0.0:
        copy(yd, first)
    else:
        copy(k, first)
    memory[4 * nx] = 1.0
    for c in range(nx):
        xs[c], ys[c] = x[c] + h * y[c], y[c] + h * first[c]
    status = call_place(place, context, t + h, xs)
    if status == 0:
        status = call_accelerate(accelerate, context, t + h, ys, k, xs)
    for c in range(nx):
        dx[c], dy[c] = 0.5 * h * (y[c] + ys[c]), 0.5 * h * (first[c] + k[c])
    return status


def test_rejected_steps_that_leave_a_trace():
    """Tried at once on its own: in a run its charts, which it knows nothing of, break it before."""

    class Remembering(I.RK45):
        order = 2

        def kernel(self, first_order):
            if first_order:
                raise ts.InvalidArgument("in the tangent-space form only")
            _, numbers, _ = super().kernel(first_order)
            return remembering, numbers, lambda nx, ny: 14 * nx + 1

    case = next(iter(integrator_scenes.cases(Remembering)))
    with pytest.raises(ts.testing.CheckFailed, match=r"rejected steps leave a trace|and not at once"):
        integrator_checks.check_rejections(Remembering, case, "tangent", "here")
    fails(Remembering, "sliding top, formulation 'tangent'")


def test_limits_that_are_not_kept(monkeypatch):
    """A driver that overlooks them: what `simulate` reads is other than what the method was given."""

    class Hasty(I.RK45):
        order = 5

    case = next(iter(integrator_scenes.cases(Hasty)))
    integrator_checks.check_bounds(Hasty, case, "tangent", "here")
    plain = integrator_checks.run_case

    def without(name):
        def run(case, method, form, **options):
            twin = Hasty(method.rtol, method.atol, max_step=method.max_step, first_step=method.first_step)
            setattr(twin, name, None)
            return plain(case, twin, form, **options)

        return run

    for name, words in (("max_step", "longer than the max_step"), ("first_step", "not the first_step")):
        monkeypatch.setattr(integrator_checks, "run_case", without(name))
        with pytest.raises(ts.testing.CheckFailed, match=words):
            integrator_checks.check_bounds(Hasty, case, "tangent", "here")


def test_constraint_errors_are_seen():
    scene = integrator_scenes.turning_pendulum()
    solution = ts.simulate(scene, (0.0, 0.1), integrator=I.Nystrom4(0.01))
    integrator_checks.demand_levels(solution, "here")
    for name, level in (("q", "position"), ("qd", "velocity"), ("qdd", "acceleration")):
        values = getattr(solution, name).copy()
        values[3, 1] += 1e-10
        state = ts.State(solution.t, **{n: getattr(solution, n) for n in ("q", "qd", "qdd")}, multipliers=None)
        with pytest.raises(ts.testing.CheckFailed, match=f"the {level} constraint error"):
            integrator_checks.demand_levels(solution, "here", state._replace(**{name: values}))


def test_a_method_that_is_never_the_same(one_scene):
    rng = np.random.default_rng(1)

    class Moody(I.Nystrom4):
        order = 4

        def kernel(self, first_order):
            step, numbers, memory = super().kernel(first_order)
            return step, numbers * (1.0 + 1e-15 * rng.integers(0, 9, numbers.size)), memory

    fails(Moody, "is not reproducible")


@pytest.mark.parametrize(
    ("method", "words"),
    [
        (I.RK45(), "needs an Integrator class or a callable"),
        (lambda: I.RK45(), "step"),
        (lambda step: step, "needs what makes a ts.Integrator"),
        (ts.Integrator, "order"),
    ],
)
def test_bad_input(method, words):
    with pytest.raises(ts.InvalidArgument, match=words):
        ts.testing.check_integrator(method)


# orders that show late


def explicit(a, b, c, order, **given):
    """A class with a tableau; the last of the order is what it declares."""
    tableau = ts.RungeKuttaTableau(a=a, b=b, c=c, order=order, **given)
    return type("Method", (ts.ExplicitRungeKutta,), {"order": order, "tableau": tableau})


TEXTBOOK = {
    "Euler": (((),), (1.0,), (0.0,), 1),
    "Heun": (((), (1.0,)), (0.5, 0.5), (0.0, 1.0), 2),
    "midpoint": (((), (0.5,)), (0.0, 1.0), (0.0, 0.5), 2),
    "Ralston": (((), (2 / 3,)), (0.25, 0.75), (0.0, 2 / 3), 2),
    "Kutta": (((), (0.5,), (-1.0, 2.0)), (1 / 6, 2 / 3, 1 / 6), (0.0, 0.5, 1.0), 3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TEXTBOOK)
def test_textbook_methods_pass(name):
    """Heun's order shows from 10,000 steps on, Euler's from 8,000 in an eighth of the span."""
    findings = ts.testing.check_integrator(explicit(*TEXTBOOK[name]))
    assert len(findings) == 6
    assert all(abs(finding.order - TEXTBOOK[name][3]) < 0.7 for finding in findings)


@pytest.mark.slow
def test_an_adaptive_pair_of_low_order_passes():
    pair = explicit(*TEXTBOOK["Heun"], error=(-0.5, 0.5, 0.0), embedded_order=1)
    assert all(len(finding.errors) == 3 for finding in ts.testing.check_integrator(pair))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "b"),
    [("Heun", (0.48, 0.52)), ("midpoint", (0.01, 0.99)), ("Ralston", (0.26, 0.74)), ("Kutta", (0.16, 0.68, 0.16))],
)
def test_wrong_weights_of_low_order_are_refused(name, b):
    """They make a method of order one or two, which the tableau says and the class does not."""
    a, _, c, order = TEXTBOOK[name]
    wrong = explicit(a, b, c, 1 if order == 2 else 2)
    wrong.order = order
    fails(wrong, rf"observed order is \d\.\d\d, {order} is declared")


@pytest.mark.parametrize(
    ("check", "kind", "words"),
    [
        (
            "check_primitive",
            ts.forces.Spring,
            r"Spring is a subclass of ts.Force: use ts.testing.check_force\(Spring\)",
        ),
        ("check_primitive", I.RK45, "check_integrator"),
        ("check_primitive", lambda a, b: ts.forces.Spring(a, b, stiffness=1.0), "check_force"),
        ("check_primitive", lambda a, b: 3, "makes a Primitive"),
        ("check_force", ts.constraints.Distance, "check_primitive"),
        ("check_force", ts.constraints.Revolute, "check_primitive"),
        ("check_integrator", ts.forces.Spring, "check_force"),
    ],
)
def test_what_another_check_is_for(check, kind, words):
    with pytest.raises(ts.InvalidArgument, match=words):
        getattr(ts.testing, check)(kind)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"b": (0.5,)}, r"one number a stage, 2 by c, got \(0.5,\)"),
        ({"a": ((), (1.0,), (1.0, 1.0))}, "one row a stage, 2 by c, got 3"),
        ({"a": ((), (np.nan,))}, "row 1 .* got"),
        ({"a": ((), ("x",))}, "row 1 .* got"),
        ({"error": (0.5, np.nan, 0.5)}, "sum of the error weights"),
        ({"order": "2"}, "order must be a whole number"),
    ],
)
def test_wrong_tableaus_are_refused(wrong, said):
    heun = {"a": ((), (1.0,)), "b": (0.5, 0.5), "c": (0.0, 1.0), "order": 2}
    with pytest.raises(ts.InvalidArgument, match=said):
        ts.RungeKuttaTableau(**heun | wrong)


def test_the_safety_factor_divides_the_tolerances_of_steps():
    class Careful(ts.integrators.RK45):
        order, safety = 0, 100.0  # order 0: in no registry

    class Margin(ts.integrators.RK45):
        order, margin = 0, 100.0  # another name of it

    expected = (1e-6 / 100.0, 1e-8 / 100.0)
    assert Careful(rtol=1e-6, atol=1e-8).step_tolerances() == expected
    assert Margin(rtol=1e-6, atol=1e-8).step_tolerances() == expected
    assert ts.integrators.RK45(rtol=1e-6, atol=1e-8).step_tolerances() != expected
    with pytest.raises(ts.InvalidArgument, match="Careless: safety"):
        type("Careless", (ts.integrators.RK45,), {"order": 0, "safety": 0.0})
