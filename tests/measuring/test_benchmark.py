"""ts.benchmark: its reference, rows, table and figure; failing runs, Ctrl-C and bad arguments."""

import signal
import sys

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.reference import load
from tests.helpers.tolerances import FINE, HELD, NEAR
from tsdyn.measuring import benchmark as agreement
from tsdyn.measuring import benchmark as benchmark_report
from tsdyn.testing.integrator_scenes import SCENES

I = ts.integrators
sliding_top, two_body_pendulum = (SCENES[name][0] for name in ("sliding top", "two-body pendulum"))
SPAN = (0.0, 0.5)


@pytest.fixture(scope="module")
def small():
    return ts.benchmark(
        sliding_top(), ["rk45", I.DOP853, "nystrom4"], (1e-4, 1e-8), SPAN, steps=(1e-2, 1e-3), repeats=2
    )


def test_rows(small):
    assert [(row.method, row.setting, row.value) for row in small.rows] == [
        *(("RK45", "tolerance", tol) for tol in (1e-4, 1e-8)),
        *(("DOP853", "tolerance", tol) for tol in (1e-4, 1e-8)),
        *(("Nystrom4", "step", h) for h in (1e-2, 1e-3)),
    ]
    for coarse, fine in zip(small.rows[::2], small.rows[1::2], strict=True):
        assert 0.0 < fine.error < coarse.error < 0.1
        assert fine.steps > coarse.steps
    assert all(row.seconds > 0.0 and row.status == "success" and row.message == "" for row in small.rows)
    assert small.rows[-1].steps == 500


def test_rows_are_what_simulate_gives(small):
    solution = ts.simulate(sliding_top(), SPAN, integrator=I.RK45(1e-4, 1e-4), t_eval=np.linspace(*SPAN, 101))
    assert agreement.errors(solution, small.reference) == (small.rows[0].error_r, small.rows[0].error_A)
    assert small.rows[0].evaluations == solution.stats.evaluations


def test_the_reference_is_as_right_as_it_says():
    scene, known = load("two_body_pendulum_spatial")
    made = agreement.agreed(scene, (0.0, 10.0), known.t, 100_000)
    off = max(np.abs(made.r - known.r).max(), np.abs(made.A - known.A).max())
    assert off < made.trusted < FINE
    assert 10.0 < made.digits < 15.0


def test_errors_below_what_is_trusted_are_marked():
    scene = sliding_top()
    plain = ts.benchmark(scene, ["rk45"], (1e-8,), SPAN, repeats=1)
    assert plain.rows[0].trusted
    assert "*" not in plain.table()
    rough = plain.reference._replace(trusted=1e-3)
    marked = ts.benchmark(scene, ["rk45"], (1e-8,), SPAN, repeats=1, reference=rough)
    assert not marked.rows[0].trusted
    assert "*" in marked.table()
    assert marked.reference_digits == pytest.approx(3.0)


@pytest.mark.slow
def test_all_adaptive_methods_by_default():
    rows = ts.benchmark(two_body_pendulum(), tolerances=(1e-3,), t_span=(0.0, 0.2), repeats=1).rows
    assert {"Taylor", "RK45", "DOP853", "SDIRK54", "ImplicitTrapezoid"} <= {row.method for row in rows}
    assert all(row.message == "" for row in rows)
    assert next(row for row in rows if row.method == "SDIRK54").iteration_matrices > 0
    rows = ts.benchmark(two_body_pendulum(), None, (1e-3,), (0.0, 0.2), repeats=1, formulation="maggi-kane").rows
    assert {"RK45", "DOP853"} <= {row.method for row in rows}
    assert not {"SDIRK54", "ImplicitTrapezoid"} & {row.method for row in rows}


@pytest.mark.slow
def test_failures_are_rows():
    def broken(rtol, atol):
        raise ValueError("no such luck")

    methods = {"fails": broken, "refused": I.SDIRK54, "sound": "rk45"}
    found = ts.benchmark(sliding_top(), methods, (1e-4,), SPAN, repeats=1, formulation="maggi-kane")
    fails, refused, sound = found.rows
    assert (fails.status, fails.message) == ("refused", "ValueError: no such luck")
    assert refused.message.startswith("InvalidArgument: SDIRK54")
    assert sound.status == "success"
    assert np.isnan(fails.error)
    assert "no such luck" in str(found)


def test_runs_that_need_too_many_steps():
    reference = ts.benchmark(sliding_top(), ["rk45"], (1e-4,), SPAN, repeats=1).reference
    found = ts.benchmark(
        sliding_top(), ["nystrom4"], t_span=SPAN, steps=(1e-4,), max_steps=100, repeats=1, reference=reference
    )
    assert found.rows[0].status == "max_steps"
    assert np.isnan(found.rows[0].seconds)


def test_a_point_mass_has_no_rotation():
    scene = ts.Scene()
    scene.add_point_mass(1.0, velocity=(1.0, 0.0, 2.0))
    row = ts.benchmark(scene, ["rk45"], (1e-6,), SPAN, repeats=1).rows[0]
    assert row.error_A == 0.0
    assert row.error_r < HELD


@pytest.mark.parametrize("after", [0.2, 0.9])
def test_interrupt_hands_back_what_is_there(after):
    def interrupt(fraction):
        if fraction >= after:
            signal.raise_signal(signal.SIGINT)

    outside = signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
    try:
        found = ts.benchmark(sliding_top(), ["rk45", "dop853"], (1e-4, 1e-6), SPAN, repeats=2, progress=interrupt)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, outside)
    assert found.interrupted
    assert 1 <= len(found.rows) <= 4
    assert "Interrupted" in found.table()
    assert np.isfinite(found.rows[0].seconds) == (after > 0.5)


def test_interrupt_before_there_is_a_reference(monkeypatch):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["tsdyn.measuring.benchmark"], "agreed", interrupted)
    found = ts.benchmark(sliding_top(), ["rk45"], (1e-4,), SPAN)
    assert (found.rows, found.interrupted, found.reference_digits) == ((), True, 0.0)
    assert "interrupted" in str(found)
    assert "interrupted" in found._repr_html_()


def test_text_and_notebook(small):
    text = str(small)
    lines = text.splitlines()
    assert sum(line.startswith(("RK45 ", "DOP853 ", "Nystrom4 ")) for line in lines) == 6
    assert "digits are trusted" in text
    assert benchmark_report.machine().rpartition(";")[0] in text  # the day may have ended since
    shown = small._repr_html_()
    assert shown.count("<tr>") == 7
    assert "RK45" in shown


@pytest.mark.slow
def test_plot(small, tmp_path):
    pytest.importorskip("matplotlib")
    figure = small.plot(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    assert {"RK45", "DOP853", "Nystrom4"} <= set(lines)
    np.testing.assert_array_equal(sorted(lines["RK45"].get_xdata()), sorted(row.error for row in small.rows[:2]))
    with pytest.raises(ts.InvalidArgument, match="written"):
        small.plot(tmp_path / "nowhere" / "figure.png")


def test_plot_without_matplotlib(small, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ts.MissingDependency):
        small.plot()


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        (("top",), {}, "scene"),
        ((["rk4"],), {}, "unknown integrator 'rk4'"),
        (([I.RK45()],), {}, "chooses the tolerances"),
        (([],), {}, "at least one"),
        ((3,), {}, "sequence of names"),
        ((["rk45"], 1e-4), {}, "tolerances"),
        ((["rk45"], (0.0,)), {}, "tolerances"),
        ((["rk45"], ()), {}, "tolerances"),
        ((["nystrom4"],), {}, "steps="),
        ((["nystrom4"],), {"steps": (-1.0,)}, "steps"),
        ((["rk45"], (1e-4,), (1.0, 0.0)), {}, "t_span"),
        ((["rk45"], (1e-4,)), {"t_eval": (0.5, 20.0)}, "t_eval"),
        ((["rk45"], (1e-4,)), {"repeats": 0}, "repeats"),
        ((["rk45"], (1e-4,)), {"max_steps": None}, "max_steps"),
        ((["rk45"], (1e-4,)), {"formulation": "other"}, "formulation"),
        ((["rk45"], (1e-4,)), {"reference": 1.0}, "reference"),
        ((["rk45"], (1e-4,)), {"progress": True}, "progress"),
    ],
)
def test_bad_input(arguments, options, words):
    scene = sliding_top()
    if arguments == ("top",):
        scene, arguments = "top", ()
    with pytest.raises(ts.InvalidArgument, match=words):
        ts.benchmark(scene, *arguments, **options)


def test_scenes_of_the_benchmarks_agree_with_their_references():
    from benchmarks.scenes import SCENES

    for name, scene in SCENES.items():
        reference = scene.known()
        if reference is None:
            continue
        assert reference.digits > 14, name
        found = ts.benchmark(scene.build(), ["dop853"], (1e-10,), scene.span, reference=reference, repeats=1)
        assert found.rows[0].error < NEAR
