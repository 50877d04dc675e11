"""Ensembles in files, to the bit, and their figures: the numbers of the cases, with units."""

import json
import subprocess
import sys

import numpy as np
import pytest

import tsdyn as ts
from examples import tolerance_analysis

matplotlib = pytest.importorskip("matplotlib")
from matplotlib.figure import Figure  # noqa: E402

TIMES = np.linspace(0.0, 0.2, 6)
SPEEDS = np.array([(1, 0, 4), (1, 0, 5), (2, 0, 4), (2, 0, 5)], float)


def stones():
    scene = ts.Scene(gravity=(0, 0, -10))
    scene.add_point_mass(1.0, name="stone")
    return scene


def throws(**options):
    return ts.ensemble(stones(), {"stone.velocity": SPEEDS, "stone.mass": 2.0}, (0.0, 0.2), **options)


def heights(solution):
    return {"height": solution.position("stone")[:, 2], "highest": solution.position("stone")[:, 2].max()}


KEPT = {
    "final": {},
    "t_eval": {"keep": "t_eval", "t_eval": TIMES},
    "functions": {"keep": heights, "t_eval": TIMES},
    "one number": {"keep": lambda solution: solution.reached},
}


@pytest.mark.parametrize("suffix", [".h5", ".zarr"])
@pytest.mark.parametrize("which", KEPT)
def test_there_and_back(which, suffix, tmp_path):
    found = throws(**KEPT[which])
    again = ts.load(found.save(tmp_path / f"study{suffix}"))
    for name in ("t", "q", "qd", "status", "success", "reached", "times"):
        assert getattr(again, name).tobytes() == getattr(found, name).tobytes(), name
    assert (again.message, again.threads, again.lanes, len(again)) == (found.message, found.threads, 1, 4)
    assert again.coordinates == found.coordinates
    assert repr(again) == repr(found)
    assert again._repr_html_() == found._repr_html_()
    for one, other in ((again.parameters, found.parameters), (again.reductions(), found.reductions())):
        assert one.keys() == other.keys()
        assert all(np.array_equal(one[name], other[name]) for name in one)
    assert again.to_xarray().identical(found.to_xarray())
    assert again.to_dataframe().equals(found.to_dataframe())
    if which == "t_eval":
        assert again.case(2).q.tobytes() == found.case(2).q.tobytes()
    found.save(tmp_path / f"study{suffix}")  # replaces it
    twice = ts.load(again.save(tmp_path / f"again{suffix}"))
    assert twice.to_xarray().identical(found.to_xarray())
    if which == "final":
        assert twice.case(1).q.tobytes() == found.case(1).q.tobytes()


@pytest.mark.slow
def test_failures_assembled_starts_and_options_are_kept(tmp_path):
    scene = tolerance_analysis.build()
    lengths, masses = tolerance_analysis.draw(2)
    table = tolerance_analysis.table(lengths, masses)
    table["coupler.mass"][1] = -1.0
    free = ("coupler", "rocker")
    found = ts.ensemble(scene, table, (0.0, 0.05), assemble=free, rtol=1e-9, atol=1e-9)
    code = "import sys, tsdyn as ts; e = ts.load(sys.argv[1]); print([e.message[1], e.case(0).q.tobytes().hex()])"
    path = found.save(tmp_path / "study.h5")
    run = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=True)
    message, bits = json.loads(run.stdout.replace("'", '"'))
    assert message == found.message[1]
    assert "positive" in message
    assert bytes.fromhex(bits) == found.case(0).q.tobytes()


def test_scenes_of_functions_are_passed(tmp_path):
    def pull(t):
        return 0.0, 0.0, np.cos(t)

    scene = stones()
    scene.add(ts.forces.PointForce(scene.body("stone"), force=pull, name="wind"))
    found = ts.ensemble(scene, {"stone.mass": [1.0, 2.0]}, (0.0, 0.1))
    path = found.save(tmp_path / "study.h5")
    again = ts.load(path)
    assert np.array_equal(again.q, found.q)
    with pytest.raises(ts.StorageError, match="scene=scene"):
        again.case(0)
    assert ts.load(path, scene=scene).case(1).q.tobytes() == found.case(1).q.tobytes()
    with pytest.raises(ts.StorageError, match="another one"):
        ts.load(path, scene=stones())


def test_what_can_not_be_saved_or_read(tmp_path):
    found = throws(integrator=ts.integrators.Nystrom4(1e-2))
    again = ts.load(found.save(tmp_path / "study.h5"))
    with pytest.raises(ts.InvalidArgument, match="integrator of the ensemble is no data"):
        again.case(0)
    with pytest.raises(ts.InvalidArgument, match="cases 0 to 3"):
        ts.load(throws().save(tmp_path / "study.h5")).case(7)
    with pytest.raises(ts.InvalidArgument, match="an ensemble is saved to a path"):
        found.save(tmp_path / "study.csv")
    solution = ts.simulate(stones(), (0.0, 0.1))
    with pytest.raises(ts.StorageError, match="no saved solution"):
        solution.save(tmp_path / "study.h5")
    data = bytearray((tmp_path / "study.h5").read_bytes())
    at = data.find(SPEEDS.tobytes())
    data[at + 5] ^= 1
    (tmp_path / "study.h5").write_bytes(data)
    with pytest.raises(ts.StorageError, match="damaged"):
        ts.load(tmp_path / "study.h5")


def test_bands_are_the_quantiles():
    found = throws(keep="t_eval", t_eval=TIMES)
    ax = ts.plots.quantile_bands(found, "stone.z", Figure().subplots(), quantiles=(0.25, 0.5, 0.75))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (s)", "stone.z (m)")
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), np.quantile(found.q[:, :, 2], 0.5, axis=0))
    edges = ax.collections[0].get_paths()[0].vertices[:, 1]
    assert edges.max() == np.quantile(found.q[:, :, 2], 0.75, axis=0).max()
    assert ts.plots.quantile_bands(found, "stone.z rate", Figure().subplots()).get_ylabel() == "stone.z rate (m/s)"


def test_bands_of_what_a_function_returned_and_of_failed_cases():
    table = {"stone.mass": [1.0, -1.0, 2.0]}
    found = ts.ensemble(stones(), table, (0.0, 0.2), keep=heights, t_eval=TIMES)
    ax = ts.plots.quantile_bands(found, "height", Figure().subplots(), unit="m")
    assert ax.get_ylabel() == "height (m)"
    np.testing.assert_allclose(ax.lines[0].get_ydata(), found.kept["height"][0])
    with pytest.raises(ts.InvalidArgument, match="no series over t_eval"):
        ts.plots.quantile_bands(found, "highest")


def test_maps_over_one_and_two_parameters():
    found = throws()
    ax = ts.plots.final_map(found, "stone.z", "stone.velocity[2]", Figure().subplots())
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("stone.velocity[2] (m/s)", "stone.z (m)")
    assert sorted(ax.lines[0].get_ydata()) == sorted(found.q[:, 2])
    ax = ts.plots.final_map(found, "stone.z", ("stone.velocity[0]", "stone.velocity[2]"), Figure().subplots())
    np.testing.assert_array_equal(ax.collections[0].get_array().reshape(2, 2), found.q[:, 2].reshape(2, 2).T)
    assert ax.figure.axes[1].get_ylabel() == "stone.z (m)"
    some = ts.ensemble(stones(), {"stone.velocity": SPEEDS[:3]}, (0.0, 0.2))
    ax = ts.plots.final_map(some, "reached", ("stone.velocity[0]", "stone.velocity[2]"), Figure().subplots())
    assert len(ax.collections[0].get_offsets()) == 3


WRONG = {
    "did you mean stone.z": ("stone.zz", "stone.velocity[0]"),
    "did you mean stone.mass": ("stone.z", "stone.mas"),
    "the name of a parameter, or two": ("stone.z", ("a", "b", "c")),
    "no value 3": (3, "stone.mass"),
}


@pytest.mark.parametrize("message", WRONG)
def test_wrong_names_of_figures(message):
    with pytest.raises(ts.InvalidArgument, match=message):
        ts.plots.final_map(throws(), *WRONG[message])


def test_an_ensemble_plots_itself(tmp_path):
    from matplotlib import pyplot

    pyplot.switch_backend("agg")
    ax = throws(keep=heights, t_eval=TIMES).plot(path=tmp_path / "bands.png")
    assert ax.get_ylabel() == "height (1)"
    assert (tmp_path / "bands.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ts.InvalidArgument, match=r"To write the figure to it: ensemble\.plot\(path='ens\.png'\)"):
        throws().plot("ens.png")
    with pytest.raises(ts.InvalidArgument, match="To write the figure"):
        throws().plot(tmp_path / "ens.png")
    assert throws().plot("stone.z").get_xlabel() == "stone.velocity[0] (m/s)"
    with pytest.raises(ts.InvalidArgument, match="nothing to draw"):
        ts.ensemble(stones(), {"stone.mass": 1.0}, (0.0, 0.1), cases=2).plot()
    pyplot.close("all")
