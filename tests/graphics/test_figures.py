"""Figures show the numbers of the run, return axes, and have a unit on every label."""

import re
import sys

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.hanging_chains import pendulum_matrices, pendulums
from tests.helpers.tolerances import FAIR

matplotlib = pytest.importorskip("matplotlib")
from matplotlib.figure import Figure  # noqa: E402

UNIT = re.compile(r"\((m|s|N|J|1|rad|N m|m/s|rad/s|m, m/s, m/s²)\)$")


@pytest.fixture(scope="module")
def run():
    return ts.simulate(pendulums([0.5, 0.2]), (0.0, 2.0), dense_output=True)


@pytest.fixture(autouse=True)
def no_windows():
    from matplotlib import pyplot

    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")


def labelled(*axes):
    """Whether there is a quantity with a unit on each axis that is labelled, and both are."""
    for ax in axes:
        assert UNIT.search(ax.get_ylabel()), ax.get_ylabel()
        assert UNIT.search(ax.get_xlabel()) or not ax.get_subplotspec().is_last_row(), ax.get_xlabel()
    return True


def curve(ax, label):
    return next(line for line in ax.lines if line.get_label() == label).get_ydata()


def test_a_solution_plots_errors_energies_steps_and_charts(run, tmp_path):
    axes = run.plot(tmp_path / "run.png")
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    assert axes.shape == (2, 2)
    assert labelled(*axes.flat)
    np.testing.assert_array_equal(curve(axes[0, 1], "total"), run.energy)
    np.testing.assert_array_equal(curve(axes[1, 0], "accepted"), run.steps.h[run.steps.accepted.astype(bool)])
    assert sum(line.get_xdata().size for line in axes[1, 1].lines) == len(run.charts.t)


def test_a_run_without_histories_is_plotted():
    axes = ts.simulate(pendulums([0.5]), (0.0, 0.2), history=False).plot()
    assert [text.get_text() for text in axes[1, 0].texts] == ["no history kept"]
    assert axes[0, 1].lines


def test_rejected_steps_are_crosses():
    scene = pendulums([0.5])
    solution = ts.simulate(scene, (0.0, 0.5), integrator=ts.integrators.DOP853(rtol=1e-10, atol=1e-10, first_step=0.4))
    taken = solution.steps.accepted.astype(bool)
    assert not taken.all()
    ax = ts.plots.steps(solution, Figure().subplots())
    np.testing.assert_array_equal(curve(ax, "rejected"), solution.steps.h[~taken])


def test_reactions_have_components_and_norm(run):
    axes = ts.plots.reaction(run, "pin 1")
    assert labelled(*axes)
    for ax, values in zip(axes, run.reaction("pin 1"), strict=True):
        np.testing.assert_array_equal(curve(ax, "z"), values[:, 2])
        np.testing.assert_array_equal(curve(ax, "norm"), np.linalg.norm(values, axis=1))


def test_contacts_are_bars_with_ticks_of_impacts():
    """A ball that falls for 1 s, rebounds for 1 s, and rests from 3 s; the overview has it in place of charts."""
    scene = ts.Scene(gravity=(0, 0, -10))
    ball = scene.add_point_mass(mass=1.0, position=(0, 0, 5.0), name="ball")
    contact = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": 0.5, "name": "floor"}
    scene.add(ts.constraints.PlaneContact(ball, scene.ground, **contact))
    solution = ts.simulate(scene, (0, 4.0))
    ax = solution.plot()[1, 1]
    (bar,) = ax.collections[0].get_paths()
    np.testing.assert_allclose(bar.vertices[:, 0].min(), 3.0, atol=1e-6)
    np.testing.assert_allclose(bar.vertices[:, 0].max(), 4.0)
    np.testing.assert_allclose(ax.lines[0].get_xdata()[:3], [1.0, 2.0, 2.5], atol=1e-9)
    assert [label.get_text() for label in ax.get_yticklabels()] == ["floor"]


def test_a_contact_that_sticks_is_a_bar_of_another_colour():
    """A block slides for 0.5 s."""
    scene = ts.Scene(gravity=(0, 0, -10))
    block = scene.add_point_mass(mass=1.0, velocity=(1, 0, 0), name="block")
    contact = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.2, "name": "floor"}
    scene.add(ts.constraints.PlaneContact(block, scene.ground, **contact))
    (bars,) = ts.plots.contacts(ts.simulate(scene, (0, 1.0))).collections
    ends = [bar.vertices[:, 0].max() for bar in bars.get_paths()]
    np.testing.assert_allclose(ends, [0.5, 1.0])
    slides, sticks = bars.get_facecolor()
    assert not np.array_equal(slides, sticks)


def test_phase_portraits_and_sections_are_of_the_coordinate(run):
    ax = ts.plots.phase_portrait(run, "pin 0")
    assert labelled(ax)
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), run.angle("pin 0"))
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), run.angle_rate("pin 0"))
    times = np.linspace(0.0, 2.0, 7)
    section = ts.plots.poincare_section(run, "pin 1", times, ax)
    assert section is ax
    np.testing.assert_array_equal(ax.lines[-1].get_ydata(), run.at(times).angle_rate("pin 1"))


def test_turning_joints_are_shown_modulo_a_turn():
    scene = pendulums([0.0])
    scene.set("pin 0", rate=30.0)
    solution = ts.simulate(scene, (0.0, 1.0))
    assert np.abs(solution.angle("pin 0")).max() > 10.0
    x = ts.plots.phase_portrait(solution, "pin 0", wrap=True).lines[0].get_xdata()
    assert np.nanmax(np.abs(x)) <= np.pi
    assert np.isnan(x).sum() >= 3


def test_sliding_joints_have_displacements():
    scene = ts.Scene()
    block = scene.add_body(mass=1.0, inertia=(1, 1, 1))
    rail = scene.add(ts.constraints.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(0, 0, 1), name="rail"))
    ax = ts.plots.phase_portrait(ts.simulate(scene, (0.0, 1.0)), rail)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("displacement of rail (m)", "rate (m/s)")


def test_mode_shapes_are_titled_by_frequency():
    axes = ts.plots.mode_shapes(pendulums([0.0, 0.0, 0.0]).linearise(), count=2)
    M, K = pendulum_matrices(3)
    expected = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)) / (2.0 * np.pi)
    assert axes.shape == (2,)
    for ax, frequency in zip(axes, expected, strict=False):
        assert float(ax.get_title().split()[0]) == pytest.approx(frequency, rel=1e-3)
        assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_zlabel()) == ("x (m)", "y (m)", "z (m)")
    low = axes[0].lines
    moved = [
        line.get_data_3d() for line in low if line.get_color() == ts.drawing.VERMILION and len(line.get_xdata()) == 2
    ]
    sideways = [abs(np.asarray(line)[0]).max() for line in moved]
    assert max(sideways) == pytest.approx(0.25 * 3 * 0.7, rel=0.2)  # of the extent
    assert np.abs([np.asarray(line)[1] for line in moved]).max() < FAIR


def test_wrong_arguments_are_refused(run):
    with pytest.raises(ts.InvalidConstraint, match="did you mean"):
        ts.plots.phase_portrait(run, "pin0")
    with pytest.raises(ts.InvalidArgument, match="empty"):
        ts.plots.poincare_section(run, "pin 0", [])
    with pytest.raises(ts.InvalidArgument, match="dense_output=True"):
        ts.plots.poincare_section(ts.simulate(run.scene, (0.0, 0.1)), "pin 0", [0.05])
    with pytest.raises(ts.InvalidArgument, match="count"):
        ts.plots.mode_shapes(run.scene.linearise(), 0)
    with pytest.raises(ts.InvalidArgument, match="can't be written"):
        run.plot("nowhere/run.png")


@pytest.mark.parametrize("name", ts.plots.__all__)
def test_what_cannot_be_drawn_is_refused(name):
    """Neither a raw AttributeError for what is no solution, nor a raw TypeError for a call that doesn't fit."""
    others = {"reaction": ("h",), "phase_portrait": ("h",), "poincare_section": ("h", [0.1])}
    others |= {"quantile_bands": ("x",), "final_map": ("x", "y"), "save": ("x.png",)}
    for wrong in (3, ts.Scene(), None):
        with pytest.raises(ts.InvalidArgument, match=f"{name}: .* must be .*, got"):
            getattr(ts.plots, name)(wrong, *others.get(name, ()))


def test_calls_of_figures_that_do_not_fit(run):
    with pytest.raises(ts.InvalidCall, match="did you mean solution"):
        ts.plots.energy(soluton=run)
    with pytest.raises(ts.InvalidArgument, match=r"which ts\.simulate returns, got 3"):
        ts.plots.energy(solution=3)


def test_without_matplotlib_figures_say_what_to_install(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for draw in (run.plot, lambda: ts.plots.energy(run), lambda: ts.plots.phase_portrait(run, "pin 0")):
        with pytest.raises(ts.MissingDependency, match=r"tsdyn\[plot\]"):
            draw()


def test_a_scene_is_a_table_in_notebooks():
    scene = pendulums([0.1] * 30)
    text = scene._repr_html_()
    assert "Scene of 30 rigid bodies" in text
    assert "<td>link 3</td><td>Body</td><td>1.3 kg</td>" in text
    assert "<td>pin 1</td><td>Revolute</td><td>link 0, link 1</td>" in text
    assert text.count("and 5 more") == 2
