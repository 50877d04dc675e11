"""What a user is told: wrong calls, names, what was forgotten, and how results and scenes print."""

import copy
import gc
import inspect
import warnings
import weakref

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.tolerances import EXACT, HELD, ROUNDING
from tsdyn.calls import fitting
from tsdyn.stress.random_calls import fuzz

C, F, I = ts.constraints, ts.forces, ts.integrators
CLASSES = [getattr(space, name) for space in (C, F, I) for name in dir(space) if name[0].isupper()]


def pendulum():
    scene = ts.Scene()
    bob = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(1.0, 0.0, 0.0), name="bob")
    scene.add(C.Revolute.at(bob, scene.ground, point=(0, 0, 0), axis=(0, 1, 0), name="pivot"))
    return scene


def two():
    scene = ts.Scene()
    return scene, scene.add_body(1.0, (1, 1, 1)), scene.add_body(1.0, (1, 1, 1), position=(1, 0, 0))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda s, a, b: C.Revolute(a, b, pont_a=(0, 0, 0)),
            r"Revolute\(\) has no argument pont_a; did you mean point_a",
        ),
        (lambda s, a, b: C.Revolute.at(a, b, pont=0), r"Revolute\.at\(\) has no argument pont; did you mean point "),
        (lambda s, a, b: C.Revolute.at(a, b, (0, 0, 0)), r"Revolute\.at\(\) takes a, b by position, .*point=, axis="),
        (lambda s, a, b: C.Universal.at(a, b, axs=0), r"Universal\.at\(\) has no argument axs; did you mean axis"),
        (lambda s, a, b: C.Fixed.at(a, b, (0, 0, 0)), r"Fixed\.at\(\) takes a, b by position, got 3"),
        (lambda s, a, b: F.PointForce(a, (0, 0, 1)), r"PointForce\(\) takes a by position, got 2 .*force="),
        (lambda s, a, b: F.PointForce(a, forse=(0, 0, 1)), "did you mean force"),
        (lambda s, a, b: F.RevoluteFriction(a, radus=1.0), "did you mean radius"),
        (lambda s, a, b: F.ContactFriction(a), r"ContactFriction\(\): missing .*kinetic"),
        (
            lambda s, a, b: s.add_body(mas=1.0, inertia=(1, 1, 1)),
            r"add_body\(\) has no argument mas; did you mean mass",
        ),
        (lambda s, a, b: s.add_body(1.0), r"add_body\(\): missing .*inertia"),
        (lambda s, a, b: ts.Scene(gravty=(0, 0, 0)), r"Scene\(\) has no argument gravty; did you mean gravity"),
        (
            lambda s, a, b: ts.simulate(s, (0, 1), t_evel=[1]),
            r"simulate\(\) has no argument t_evel; did you mean t_eval",
        ),
        (lambda s, a, b: ts.simulate(s), r"simulate\(\): missing .*t_span"),
        (lambda s, a, b: s.assemble(fixd=()), r"assemble\(\) has no argument fixd; did you mean fixed"),
        (lambda s, a, b: I.RK45(rtoll=1e-3), r"RK45\(\) has no argument rtoll; did you mean rtol"),
        (lambda s, a, b: I.Nystrom4(stepp=1e-3), r"Nystrom4\(\) .*did you mean step"),
        (lambda s, a, b: ts.motions.Sine(amplitud=1.0, frequency=2.0), "did you mean amplitude"),
    ],
)
def test_a_wrong_call_names_what_would_be_right(call, words):
    with pytest.raises(ts.InvalidCall, match=words) as caught:
        call(*two())
    assert isinstance(caught.value, TypeError)


def test_wrong_calls_of_methods_name_the_class_that_users_know():
    """Whatever class of tsdyn's own a method is written in."""
    scene = pendulum()
    run = ts.simulate(scene, (0.0, 0.01))
    cases = ts.ensemble(scene, {"bob.mass": [1.0, 2.0]}, (0.0, 0.01))
    known = {"Scene": scene, "Solution": run, "State": run.state, "Ensemble": cases, "Run": ts.prepare(scene)}
    for kind, thing in known.items():
        methods = inspect.getmembers_static(type(thing), inspect.isfunction)
        for name in [name for name, _ in methods if not name.startswith("_")]:
            with pytest.raises(ts.InvalidArgument) as caught:
                getattr(thing, name)(no_such=1)
            assert str(caught.value).startswith(f"{kind}.{name}() has no argument no_such"), caught.value
            assert " has self" not in str(caught.value)


def test_a_type_error_of_the_users_own_code_stays_as_it_is():
    @fitting
    def own(number):
        return len(number)

    assert own([1, 2]) == 2
    with pytest.raises(TypeError, match="has no len") as caught:
        own(3)
    assert not isinstance(caught.value, ts.TsdynError)


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_constructors_have_signatures_and_docstrings(kind):
    parameters = inspect.signature(kind).parameters.values()
    assert parameters
    assert not [
        p for p in parameters if p.kind is p.VAR_KEYWORD or (p.kind is p.VAR_POSITIONAL and p.annotation is p.empty)
    ]
    assert "Parameters" in kind.__doc__ or "Parameters" in (kind.__mro__[1].__doc__ or "")


def test_at_has_the_arguments_of_its_class():
    assert list(inspect.signature(C.Revolute.at).parameters)[:4] == ["a", "b", "point", "axis"]
    assert "lead" in inspect.signature(C.Screw.at).parameters
    assert "lead" not in inspect.signature(C.Revolute.at).parameters
    assert "axis" in inspect.signature(C.Dot2.at).parameters  # axis_a is on one body only
    assert "turn" not in inspect.signature(F.Bushing.at).parameters  # nothing to place
    assert next(iter(inspect.signature(F.PointForce.at).parameters)) == "a"


def test_names_of_constraints_and_forces_are_unique():
    scene, a, b = two()
    first, second = (scene.add(C.Spherical(a, b)) for _ in range(2))
    assert (first.name, second.name) == ("Spherical(body1, body2)", "Spherical(body1, body2) #2")
    scene.add(C.Revolute(a, b, axis_a=(0, 0, 1), axis_b=(0, 0, 1), name="hinge"))
    with pytest.raises(ts.InvalidConstraint, match="named 'hinge' already"):
        scene.add(C.Spherical(a, b, name="hinge"))
    with pytest.raises(ts.InvalidForce, match="named 'hinge' already"):
        scene.add(F.Spring(a, b, stiffness=1.0, name="hinge"))
    first.name = "ball"
    assert scene.add(C.Spherical(a, b, name="Spherical(body1, body2)")).name == "Spherical(body1, body2)"


def test_what_is_never_added_is_warned_of_once():
    scene = pendulum()
    (bob,) = scene.bodies
    C.Revolute.at(bob, scene.ground, point=(0, 0, 0), axis=(0, 1, 0), name="forgotten")
    F.Spring(bob, scene.ground, point_b=(0, 0, 1), stiffness=1.0)
    with pytest.raises(ts.InvalidForce):
        F.Spring(bob, scene.ground, point_b=(0, 0, 1), stiffness=-1.0)  # what was refused is not missed
    with pytest.warns(UserWarning, match=r"never added: Revolute 'forgotten', Spring\(bob, ground\)\. ") as caught:
        ts.simulate(scene, (0.0, 0.01))
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ts.simulate(scene, (0.0, 0.01))


def test_scenes_print_their_bodies():
    scene = ts.Scene()
    assert repr(scene) == "<Scene of no bodies: 0 coordinates, 0 constraint rows>"
    a = scene.add_body(1.0, (1, 1, 1))
    assert repr(scene) == "<Scene of 1 rigid body: 7 coordinates, 1 constraint row>"
    scene.add_point_mass(1.0)
    scene.add(F.PointForce(a, force=(0, 0, 1)))
    words = "<Scene of 1 rigid body, 1 point mass: 10 coordinates, 1 constraint row, 1 force>"
    assert repr(scene) == words


@pytest.mark.slow_for("sdirk54")
@pytest.mark.parametrize("method", [None, "rk45", "nystrom4", "sdirk54"])
def test_solutions_print(method):
    solution = ts.simulate(pendulum(), (0.0, 0.02), integrator=method)
    for text in (str(solution), repr(solution), solution._repr_html_()):
        assert "success" in text
        assert "1 steps" not in text
    series = ts.simulate(pendulum(), (0.0, 2.0))
    assert series.stats.newton_iterations > 0
    assert series.stats.placements == 0  # what the number of sweeps was divided by
    assert "Newton sweep" in str(series)


def cubic(t, a, b, par, out):
    out[1] = 1e3 * a[1] ** 3


@pytest.mark.slow
@pytest.mark.parametrize(("formulation", "method"), [("tangent", "radau"), ("null-space", "sdirk54")])
def test_a_stiff_run_that_collapses_names_a_method_that_serves(formulation, method):
    """Beside an overdamped spring a point runs away from y = 1 m by 1000 y^3."""
    scene = ts.Scene()
    damped = scene.add_point_mass(1.0, position=(1, 0, 0), name="damped")
    scene.add(F.Spring(damped, scene.ground, stiffness=1e6, damping=1e6, free_length=1.0, name="damper"))
    scene.add(F.UserForce(scene.add_point_mass(1.0, position=(0, 1, 0)), function=cubic, name="push"))
    solution = ts.simulate(scene, (0, 5), integrator="dop853", formulation=formulation)
    assert solution.status is ts.Status.STEP_COLLAPSED
    assert f"The motion is stiff: integrator={method!r} may succeed." in solution.message
    ts.prepare(scene, integrator=method, formulation=formulation)  # it does serve


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda s, a, b: s.add_body(1.0, np.full((3, 3), 1e308), name="x"), ts.InvalidBody),
        (lambda s, a, b: F.PointForce(a, force=(0, 0, 1), frame=np.zeros(3)), ts.InvalidForce),
        (lambda s, a, b: F.Torque(a, torque=(0, 0, 1), frame=np.array(["body", "ground"])), ts.InvalidForce),
        (lambda s, a, b: F.PointForce(a, force=np.zeros((3, 3))), ts.InvalidForce),
        (lambda s, a, b: s.assemble(fixed=np.zeros((2, 3))), ts.InvalidBody),
        (lambda s, a, b: s.assemble(folds=np.array(["keep", "free"])), ts.InvalidArgument),
        (lambda s, a, b: ts.simulate(s, (0, 1), redundancy=np.zeros(2)), ts.InvalidArgument),
    ],
)
def test_arrays_and_huge_numbers_are_refused_by_name(call, error):
    with pytest.raises(error):
        call(*two())


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("given", [{"mass": 1e308}, {"inertia": (1e308, 1e308, 1e308)}, {"inertia": (1e-320,) * 3}])
def test_masses_whose_products_overflow_are_refused(given):
    with pytest.raises(ts.InvalidBody, match=r"box.*from 1e-300 to 1e\+150"):
        ts.Scene().add_body(**{"mass": 1.0, "inertia": (1.0, 1.0, 1.0), **given}, name="box")


@pytest.mark.filterwarnings("error")
def test_the_largest_masses_run_beside_the_smallest():
    scene = ts.Scene()
    scene.add_body(1e150, (1e150, 1e150, 1e150), angular_velocity=(0, 0, 1), name="giant")
    scene.add_body(1e-300, (1e-300, 1e-300, 1e-300), angular_velocity=(1, 0, 0), name="speck")
    run = ts.simulate(scene, (0.0, 1.0))
    assert run.success
    np.testing.assert_allclose(run.position("speck")[-1], (0.0, 0.0, -9.81 / 2), atol=ROUNDING)


@pytest.mark.parametrize("space", [ts, C, F, I, ts.motions, ts.testing, ts.shapes], ids=lambda space: space.__name__)
def test_completion_shows_what_users_use(space):
    assert set(space.__all__) <= set(dir(space))
    assert not {"np", "math", "Joint", "Point"} & set(dir(space)) or space is ts


def test_copies_of_scenes_are_scenes_of_their_own():
    scene = pendulum()
    for twin in (copy.copy(scene), copy.deepcopy(scene)):
        twin.body("bob").mass = 5.0
        twin.add_point_mass(1.0)
        assert scene.body("bob").mass == 1.0
        assert len(scene.bodies) == 1
        assert twin.bodies[0].scene is twin
        with pytest.raises(ts.InvalidConstraint, match="another scene"):
            twin.add(C.Spherical(scene.bodies[0], scene.ground))


def load(factor):
    return lambda t: (factor, 0.0, 0.0)


@pytest.mark.slow
def test_the_same_source_and_constants_are_compiled_once():
    _, a, _ = two()
    first, second, other = (F.PointForce(a, force=load(factor)).force for factor in (1.0, 1.0, 2.0))
    assert first is not second
    assert first.address == second.address
    assert first.address != other.address
    of_state = [F.PointForce(a, force=lambda t, state: (0.0, 0.0, state[0])).kernels for _ in range(2)]
    assert of_state[0] is of_state[1]


@pytest.mark.slow
def test_scenes_leave_nothing_behind():
    def run():
        scene = pendulum()
        scene.add(F.Spring(scene.bodies[0], scene.ground, point_b=(0, 0, 3), stiffness=1.0))
        ts.simulate(scene, (0.0, 0.01))
        return weakref.ref(scene), weakref.ref(scene.bodies[0])

    run()
    gone = run()
    gc.collect()
    count = len(gc.get_objects())
    assert [ref() for ref in gone] == [None, None]
    for _ in range(5):
        run()
    gc.collect()
    assert len(gc.get_objects()) < count + 5


def test_a_small_sample_of_the_fuzzer_of_calls():
    found = list(fuzz(300, seed=5, runs=0.02))
    assert not [each for each in found if each.story]
    assert {"accepted", "InvalidCall", "InvalidConstraint", "InvalidForce"} <= {each.outcome for each in found}


def test_the_axis_and_references_of_a_torsional_spring_are_derived():
    scene = ts.Scene()
    turned = Rotation.from_euler("zyx", (0.3, 0.7, -0.4))
    body = scene.add_body(1.0, (1.0, 1.0, 1.0), orientation=turned)
    axis = np.array((0.0, 0.6, 0.8))
    own = turned.inv().apply(axis)
    scene.add(C.Revolute.at(scene.ground, body, point=(0, 0, 0), axis=axis))
    springs = [
        F.TorsionalSpring(scene.ground, body, axis_a=axis, stiffness=2.0),
        F.TorsionalSpring(scene.ground, body, axis_b=own, stiffness=2.0),
        F.TorsionalSpring(scene.ground, body, axis_a=axis, axis_b=own, reference_b=(1, 0, 0), stiffness=2.0),
        F.TorsionalSpring.at(scene.ground, body, axis=axis, stiffness=2.0),
        F.TorsionalSpring.at(scene.ground, body, axis=axis, reference=(1, 0, 0), stiffness=2.0),
    ]
    for i, spring in enumerate(springs):
        spring.name = f"spring {i}"
        scene.add(spring)
        np.testing.assert_allclose(spring.axis_a, axis, atol=EXACT)
        np.testing.assert_allclose(spring.axis_b, own, atol=EXACT)
    solution = ts.simulate(scene, (0.0, 0.02))
    assert np.abs(solution.reaction(springs[0])[1]).max() < HELD
    body.angular_velocity = own
    moved = ts.simulate(scene, (0.0, 0.02))
    for spring in springs:
        np.testing.assert_allclose(moved.angle(spring)[-1], moved.angle(springs[0])[-1], atol=HELD)
    springs[0].axis_b = own
    with pytest.raises(ts.InvalidForce, match="axis_b is not along axis_a"):
        F.TorsionalSpring(scene.ground, body, axis_a=axis, axis_b=axis, stiffness=2.0)
    with pytest.raises(ts.InvalidForce, match="axis_a"):
        F.TorsionalSpring(scene.ground, body, stiffness=2.0)


def test_bodies_by_name_beside_a_handle():
    scene = ts.Scene()
    crank = scene.add_body(1.0, (1, 1, 1), name="crank")
    rod = scene.add_body(1.0, (1, 1, 1), position=(1, 0, 0), name="rod")
    assert C.Revolute(crank, "rod", axis_a=(0, 0, 1), axis_b=(0, 0, 1)).b is rod
    assert C.Revolute.at("crank", rod, point=(0, 0, 0), axis=(0, 0, 1)).a is crank
    assert C.Spherical(a="crank", b=scene.ground).a is crank
    assert F.Spring(crank, "ground", point_b=(0, 0, 1), stiffness=1.0).b is scene.ground
    with pytest.raises(ts.InvalidConstraint, match="knee: no body is named 'rood'; did you mean 'rod'"):
        C.Spherical(crank, "rood", name="knee")
    with pytest.raises(ts.InvalidConstraint, match=r"'crank' is not a body; .* beside the handle of the other"):
        C.Spherical("crank", "rod")


def test_directions_of_any_length():
    body = ts.Scene().add_body(1.0, (1, 1, 1))
    for length in (1e-300, 1e308):
        given = C.Dot1(body, body.scene.ground, axis_a=(length, 0, 0), axis_b=(0, length, 0))
        np.testing.assert_array_equal((given.axis_a, given.axis_b), np.eye(3)[:2])


def test_a_point_whose_square_overflows_is_refused():
    scene = ts.Scene()
    body = scene.add_body(1.0, (1, 1, 1))
    with pytest.raises(ts.InvalidConstraint, match=r"point_a must be within 1e\+150 m"):
        C.Distance(scene.ground, body, point_a=(1e308, 0, 0))


@pytest.mark.parametrize(
    "integrator", ["nystrom4", ts.integrators.Nystrom4, ts.integrators.Nystrom4(step=1e-3)], ids=repr
)
def test_tolerances_of_fixed_steps(integrator):
    with pytest.raises(
        ts.InvalidArgument, match=r"fixed steps and no use for rtol: .*Nystrom4\(step=.*integrator='rk45'"
    ):
        ts.simulate(pendulum(), (0.0, 1.0), integrator=integrator, rtol=1e-6)


def test_tolerances_of_an_unknown_method():
    with pytest.raises(ts.InvalidArgument, match="nystrom4"):
        ts.simulate(pendulum(), (0.0, 1.0), integrator="nystrom", rtol=1e-6)
