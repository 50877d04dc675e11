"""The paper's tables: every entry keeps its bound, Maggi/Kane drifts; text, figure and command say so."""

import math
import runpy
import sys

import numpy as np
import pytest

import tsdyn as ts
from tsdyn import plots
from tsdyn.cli import main
from tsdyn.measuring import haug_tables as tables

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def measured():
    return tables.reproduce()


@pytest.fixture
def reuse(measured, monkeypatch):
    """The command takes the tables already measured."""
    monkeypatch.setattr(tables, "reproduce", lambda: measured)


def short_solution(**arguments):
    return ts.simulate(tables.sliding_top(), (0.0, 0.02), integrator=ts.integrators.Nystrom4(step=1e-3), **arguments)


def tangent_space_rows(measured):
    return [row for table in measured for row in (*table.rows, *(row for _, row in table.variants))]


def test_the_runs_are_those_of_the_paper(measured):
    assert [table.experiment.number for table in measured] == [1, 2]
    for table in measured:
        assert [row.tolerance for row in table.rows] == [1e-6, 1e-9, 1e-12]
        assert {row.formulation for row in table.rows} == {"null-space"}
        assert {row.formulation for row in table.baseline} == {"maggi-kane"}
        for row in (*table.rows, *table.baseline):
            assert row.steps == round(10.0 / table.experiment.step)
            assert row.t.size == row.steps + 1  # nothing is left out
            assert row.t[-1] == 10.0


def test_every_entry_keeps_its_bound(measured):
    for row in tangent_space_rows(measured):
        # written out, so that they can't be moved with the code that is tested
        bound = (1e-14, 1e-13, 1e-12) if row.tolerance == 1e-12 else row.published
        for level, largest, limit in zip(row.error, row.measured, bound, strict=True):
            assert level.max() == largest
            assert largest <= limit
        assert row.within == (True, True, True)
    assert all(table.within for table in measured)


def test_no_entry_is_above_the_published_power_of_ten(measured):
    for row in tangent_space_rows(measured):
        for value, published, mark in zip(row.measured, row.published, row.marks, strict=True):
            assert math.floor(math.log10(value)) <= round(math.log10(published))
            assert mark == ("<=" if value <= published else "~")


def test_maggi_kane_drifts_in_position_only(measured):
    for table in measured:
        for ours, theirs in zip(table.rows, table.baseline, strict=True):
            assert theirs.measured.position > 1000.0 * ours.measured.position
            assert theirs.error.position[-1] > 100.0 * theirs.error.position[1]
            assert theirs.measured.velocity < 10.0 * ours.measured.velocity
            assert theirs.measured.acceleration < 10.0 * ours.measured.acceleration


def test_marks_and_bounds_tell_a_broken_entry(measured):
    row = measured[0].rows[0]
    worse = type(row)(**{**vars(row), "measured": type(row.measured)(1e-8, 9e-6, 1e-3)})
    assert worse.marks == ("<=", "~", ">")
    assert worse.within == (True, False, False)
    table = type(measured[0])(measured[0].experiment, (worse,), (worse,), ())
    assert not table.within
    text = tables.as_text((table,))
    assert "BROKEN" in text
    assert "1 of 3 entries" in text
    assert "Table 1, Tol 1e-6, acceleration: 1.0e-03, 10.0 times the published 1e-4" in text


def test_text_holds_both_tables(measured):
    text = tables.as_text(measured)
    assert "Table 1. Sliding top" in text
    assert "Table 2. Two-body pendulum" in text
    for table in measured:
        for row in (*table.rows, *table.baseline):
            assert all(f"{value:.1e}" in text for value in row.measured)
    for words in ("12) rad/s; the paper", "10000 steps of 0.001 s", "20000 steps of 0.0005 s", "Maggi/Kane", "kept"):
        assert words in text
    assert max(map(len, text.splitlines())) <= 120


@pytest.mark.slow
def test_figure_is_a_png_and_leaves_matplotlib_alone(measured, tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # which would choose a backend
    monkeypatch.setitem(matplotlib.rcParams, "text.color", "white")  # nor does a dark style get in

    def settings():
        return {name: matplotlib.rcParams[name] for name in matplotlib.rcParams if name != "backend"}

    before = settings()
    path = plots.save(plots.tables_figure(measured), tmp_path / "errors")
    assert path == tmp_path / "errors.png"
    assert path.read_bytes().startswith(PNG)
    assert settings() == before


def test_figure_shows_zeros_and_largest_values(measured):
    pytest.importorskip("matplotlib")
    figure = plots.tables_figure(measured)
    assert len(figure.axes) == 6
    for table, column in zip(measured, np.reshape(figure.axes, (3, 2)).T, strict=True):
        for ax, level in zip(column, tables.LEVELS, strict=True):
            _, theirs, ours = ax.lines
            assert theirs.get_ydata().max() == getattr(table.baseline[-1].measured, level)
            assert ours.get_ydata().max() == getattr(table.rows[-1].measured, level)
            assert min(theirs.get_ydata().min(), ours.get_ydata().min()) >= plots.ZERO


def test_constraint_error_draws_into_given_axes():
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    solution = short_solution()
    ax = Figure().subplots()
    assert plots.constraint_error(solution, ax) is ax
    assert [line.get_ydata().max() for line in ax.lines] == [level.max() for level in solution.constraint_error]
    assert ax.get_yscale() == "log"
    assert solution.constraint_error.position[0] == 0.0  # the top starts exactly upright
    assert ax.lines[0].get_ydata()[0] == plots.ZERO


def test_constraint_error_makes_axes_of_its_own():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    ax = plots.constraint_error(short_solution())
    assert ax.figure.number in pyplot.get_fignums()
    pyplot.close(ax.figure)


@pytest.mark.slow
def test_command_prints_and_draws(reuse, measured, capsys, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    assert main(["tables", "--plot"]) == 0
    assert capsys.readouterr().out == f"{tables.as_text(measured)}\nFigure: tables.png\n"
    assert (tmp_path / "tables.png").read_bytes().startswith(PNG)
    assert main(["tables", "--plot", "other.png"]) == 0
    assert (tmp_path / "other.png").exists()


def test_command_without_a_figure(reuse, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["tables"]) == 0
    assert "Table 2." in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "words"), [("nowhere/tables.png", "there is no folder"), ("tables.unknown", "can't be written to")]
)
def test_command_explains_a_figure_that_cannot_be_written(name, words, reuse, capsys, tmp_path):
    pytest.importorskip("matplotlib")
    assert main(["tables", "--plot", str(tmp_path / name)]) == 1
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1


def test_command_without_matplotlib(reuse, capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.chdir(tmp_path)
    assert main(["tables"]) == 0
    assert "Table 2." in capsys.readouterr().out
    assert main(["tables", "--plot"]) == 1
    assert "pip install 'tsdyn[plot]'" in capsys.readouterr().err
    with pytest.raises(ts.MissingDependency):
        plots.constraint_error(short_solution())


def test_command_fails_where_a_bound_is_broken(measured, monkeypatch):
    table = measured[0]
    broken = type(table)(table.experiment, table.baseline, table.baseline, ())
    monkeypatch.setattr(tables, "reproduce", lambda: (broken,))
    assert main(["tables"]) == 1


def test_command_reports_an_error_without_a_traceback(monkeypatch, capsys):
    def fail():
        raise ts.StepFailure("It stopped.")

    monkeypatch.setattr(tables, "reproduce", fail)
    assert main(["tables"]) == 1
    assert capsys.readouterr() == ("", "tsdyn: It stopped.\n")


@pytest.mark.parametrize(
    "arguments",
    [[], ["tabels"], ["tables", "more"], ["tables", "--plot", "a.png", "more"]],
    ids=" ".join,
)
def test_wrong_arguments(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    assert "usage: tsdyn" in capsys.readouterr().err


@pytest.mark.parametrize(("arguments", "words"), [(["--version"], ts.__version__), (["--help"], "tables")])
def test_answers_without_running(arguments, words, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 0
    assert words in capsys.readouterr().out


def test_python_m_tsdyn(capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["tsdyn", "--version"])
    with pytest.raises(SystemExit) as stop:
        runpy.run_module("tsdyn", run_name="__main__")
    assert stop.value.code == 0
    assert capsys.readouterr().out == f"tsdyn {ts.__version__}\n"
