"""A second process compiles nothing, and a process loads no kernel that it doesn't need."""

from pathlib import Path

import pytest

from tests.helpers.processes import REPORT, run
from tests.helpers.tolerances import EXACT


@pytest.mark.slow
def test_second_process_compiles_nothing(warm):
    code = (
        REPORT
        + """
from examples import top
from examples.bead_on_surface import build
for form in ("tangent", "maggi-kane"):
    tsdyn.simulate(top.build(), (0.0, 0.01), formulation=form, t_eval=[0.0, 0.0055])
    tsdyn.simulate(
        top.build(), (0.0, 0.01), formulation=form, integrator="dop853", dense_output=True, events=lambda t, _: t - 0.1
    ).at(0.001)
tsdyn.simulate(build(), (0.0, 0.01)).multipliers
report()
"""
    )
    _, environment = warm(code)
    files = sorted(Path(environment["NUMBA_CACHE_DIR"]).rglob("*"))
    second, errors = run(code, environment)
    assert second["misses"] == 0
    assert second["hits"] > 15
    assert sorted(Path(environment["NUMBA_CACHE_DIR"]).rglob("*")) == files
    assert "compiling" not in errors


FORCES = (
    REPORT
    + """
import tsdyn as ts
scene = ts.Scene()
mass = scene.add_point_mass(1.0, position=(1.0, 2.0, 2.0))
body = scene.add_body(1.0, (1.0, 1.0, 1.0))
scene.add(ts.forces.Spring(mass, body, stiffness=3.0))
scene.add(ts.forces.PointForce(body, force=lambda t: (t, 0.0, 0.0)))
scene.add(ts.forces.Torque(body, torque=lambda t, state: (state[0], 0.0, 0.0)))
def drag(t, a, b, par, out):
    out[0] = -par[0] * a[7]
scene.add(ts.forces.UserForce(mass, body, function=drag, parameters=(2.0,)))
solution = ts.simulate(scene, (0.0, 0.01))
solution.multipliers, solution.power, solution.reaction(scene.forces[0])
kernels = [force.kernels for force in scene.forces] + [kind.own_kernels for kind in ts.forces.registered()]
loaded = lambda name: sum(k[name]._address is not None for k in kernels)
report(q=solution.q[-1].tolist(), forces=loaded("force"), jacobians=loaded("jacobian"))
"""
)


@pytest.mark.slow
def test_forces_are_cached_and_only_those_used_are_loaded(warm):
    first, environment = warm(FORCES)
    second, _ = run(FORCES, environment)
    assert (second["misses"], second["q"]) == (0, first["q"])
    edited, _ = run(FORCES.replace("-par[0] * a[7]", "-par[0] * a[8]"), environment)
    assert edited["misses"] == 1  # the loop of the one function
    assert edited["q"] != first["q"]
    assert second["forces"] == 4 + 2  # those of the four; Spring's and PointForce's are their classes', too
    assert second["jacobians"] == 0  # only implicit methods ask for them
    empty = FORCES.replace("scene.add(ts.forces", "(ts.forces").replace(", solution.reaction(scene.forces[0])", "")
    without, _ = run(empty, environment)
    assert (without["misses"], without["forces"]) == (0, 0)


IMPLICIT = (
    REPORT
    + """
from tsdyn.formulations import saddle_point
from benchmarks.stiff import hung, jointed
def loaded(scene):
    kinds, slopes = ({type(c): c.kernels[name] for c in scene.constraints}.values() for name in ("stiffness", "slopes"))
    forces = [force.kernels["jacobian"] for force in scene.forces]
    own = [getattr(saddle_point, name) for name in ("linearise", "reduce", "factorise", "soften")]
    return [sum(kernel._address is not None for kernel in kernels) for kernels in (kinds, forces, own, slopes)]
scene = jointed()
for method in ("nystrom4", "rk45", "dop853"):
    tsdyn.simulate(scene, (0.0, 1e-3), integrator=method, t_eval=[0.0, 3.3e-4]).multipliers
explicit = loaded(scene)
for method in ("implicittrapezoid", "sdirk54"):
    for build in (jointed, hung):
        ends = tsdyn.simulate(build(), (0.0, 0.01), integrator=method, dense_output=True).at([0.001, 0.002]).q
report(explicit=explicit, implicit=loaded(scene), q=ends.tolist())
"""
)


@pytest.mark.slow
def test_implicit_methods_are_cached_and_load_what_explicit_ones_do_not(warm):
    first, environment = warm(IMPLICIT)
    second, errors = run(IMPLICIT, environment)
    assert (second["misses"], second["q"]) == (0, first["q"])
    assert "compiling" not in errors
    for result in (first, second):
        assert result["explicit"] == [0, 0, 0, 0]
        # Spherical, Dot1 and normalisations; TorsionalSpring; all; derivatives of rates are for forms with a basis
        assert result["implicit"] == [3, 1, 4, 0]


@pytest.mark.slow
def test_plug_in_integrator_is_cached(warm):
    code = (
        REPORT
        + """
from examples import top
from examples.plug_in_integrator import METHODS
for method in METHODS:
    for form in ("tangent", "maggi-kane"):
        tsdyn.simulate(top.build(), (0.0, 0.01), formulation=form, integrator=method(1e-6, 1e-6), t_eval=[0.0, 0.0055])
report()
"""
    )
    _, environment = warm(code)  # all of the core is in the cache
    for file in Path(environment["NUMBA_CACHE_DIR"]).rglob("*plug_in_integrator*"):
        file.unlink()
    assert run(code, environment)[0]["misses"] == 3  # two step kernels and an error estimate: nothing of the core
    assert run(code, environment)[0]["misses"] == 0


@pytest.mark.slow
def test_threads_that_start_together(warm):
    """In a process that has loaded nothing yet."""
    code = (
        REPORT
        + """
from concurrent.futures import ThreadPoolExecutor
from examples import top
with ThreadPoolExecutor(4) as pool:
    ends = list(pool.map(lambda _: tsdyn.simulate(top.build(), (0.0, 0.1)).q[-1].tolist(), range(8)))
report(same=all(end == ends[0] for end in ends))
"""
    )
    _, environment = warm(code)
    result, _ = run(code, environment)
    assert (result["same"], result["misses"]) == (True, 0)


@pytest.mark.slow
def test_debug_mode_runs_plain_python():
    code = (
        REPORT
        + """
from examples import top
from tsdyn.jit import kernels as _kernel
end = tsdyn.simulate(top.build(), (0.0, 0.01), t_eval=[0.0055, 0.01])
report(q=end.q.tolist(), debug=_kernel.DEBUG)
"""
    )
    compiled, _ = run(code, {})
    plain, _ = run(code, {"TSDYN_DEBUG": "1"})
    assert (compiled["debug"], plain["debug"]) == (False, True)
    assert plain["misses"] == plain["hits"] == 0
    assert [pytest.approx(row, abs=EXACT) for row in compiled["q"]] == plain["q"]


DRIVEN = (
    REPORT
    + """
import numpy as np
import tsdyn as ts
C, M = ts.constraints, ts.motions
def scene(angle, travel):
    scene = ts.Scene()
    wheel = scene.add_body(1.0, (1.0, 1.0, 1.0))
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(C.RotationMotor.of(hinge, angle=angle))
    other = scene.add_body(1.0, (1.0, 1.0, 1.0), position=(2.0, 0.0, 0.0))
    scene.add(C.Revolute.at(scene.ground, other, point=(2, 0, 0), axis=(0, 0, 1)))
    scene.add(C.Gear.at(wheel, other, point_a=(0, 0, 0), point_b=(2, 0, 0), axis=(0, 0, 1), ratio=-0.7))
    nut = scene.add_body(1.0, (1.0, 1.0, 1.0))
    scene.add(C.Screw.at(scene.ground, nut, point=(0, 0, 0), axis=(1, 0, 0), lead=0.1))
    bead = scene.add_point_mass(1.0)
    scene.add(C.PointDriver(scene.ground, bead, path=(travel, 0.0, travel)))
    return scene
ends = []
for angle, travel in ((M.Sine(1.0, 2.0), M.Polynomial((0, 0, 1))), MORE):
    for method in ("taylor", "dop853"):
        ends.append(ts.simulate(scene(angle, travel), (0.0, 0.1), integrator=method, initial_tol=10.0).q[-1].tolist())
alone = scene(lambda t: t + 0.1 * np.sin(t), lambda t: t * t)
ends.append(ts.simulate(alone, (0.0, 0.1), integrator="dop853", initial_tol=10.0).q[-1].tolist())
report(q=ends)
"""
)


@pytest.mark.slow
def test_new_motions_compile_nothing(warm):
    """Whatever is prescribed is numbers for kernels that are there."""
    few, more = (
        "(np.tanh(M.Ramp()), M.Ramp())",
        "(np.tanh(M.Ramp(0.0, 3.0)), M.Exponential(1.0, 2.0) * M.Sine(1.0, 3.0))",
    )
    first, environment = warm(DRIVEN.replace("MORE", few))
    second, errors = run(DRIVEN.replace("MORE", more), environment)
    assert second["misses"] == 0
    assert "compiling" not in errors
    assert second["q"][0] == first["q"][0]


@pytest.mark.slow
def test_a_scene_without_motions_loads_none_of_it():
    code = (
        REPORT
        + """
from examples import slider_crank
from tsdyn.motions.program import run_program
for method in ("taylor", "dop853"):
    tsdyn.simulate(slider_crank.build(), (0.0, 0.01), integrator=method)
kinds = [kind.kernels for kind in tsdyn.constraints.registered()]
loaded = [name for kernels in kinds for name, kernel in kernels.items() if kernel._address is not None]
report(program=run_program._address is not None, loaded=loaded)
"""
    )
    found, _ = run(code, {})
    assert not found["program"]
    assert not {"driven_series", "far_driven_series", "remember", "drift", "phi_t"} & set(found["loaded"])


@pytest.mark.slow
def test_a_second_process_compiles_nothing_for_lanes(warm):
    code = (
        REPORT
        + """
import tsdyn as ts
scene = ts.Scene(gravity=(0, 0, -10))
rod = scene.add_body(1.0, (0.1, 0.1, 0.05), position=(0.5, 0, 0), name="rod")
scene.add(ts.constraints.Spherical(scene.ground, rod, point_b=(-0.5, 0, 0)))
found = ts.ensemble(scene, {"rod.mass": [1.0, 2.0, 3.0, 4.0, 5.0]}, (0, 0.1), lanes=4)
report(q=found.q.tolist())
"""
    )
    first, environment = warm(code)
    second, errors = run(code, environment)
    assert (second["misses"], second["q"]) == (0, first["q"])
    assert "compiling" not in errors
