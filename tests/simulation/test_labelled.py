"""Labelled arrays and data frames have the outputs with the names and units of stores."""

import numpy as np
import pytest

import tsdyn as ts
from examples import four_bar

xarray = pytest.importorskip("xarray")
pandas = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def solution():
    return ts.simulate(four_bar.build(), (0.0, 0.2), integrator="taylor", t_eval=np.linspace(0.0, 0.2, 7))


def test_labelled_arrays(solution):
    data = solution.to_xarray()
    assert data.q.dims == ("time", "coordinate")
    np.testing.assert_array_equal(data.q.sel(coordinate="crank.y"), solution.position("crank")[:, 1])
    np.testing.assert_array_equal(data.time, solution.t)
    row = solution.scene.row_names().index("Revolute 'crank pin' point[0]")
    np.testing.assert_array_equal(
        data.multipliers.sel(row="Revolute 'crank pin' point[0]"), solution.multipliers[:, row]
    )
    np.testing.assert_array_equal(data.energy, solution.energy)
    np.testing.assert_array_equal(data.position_error, solution.constraint_error.position)
    assert [data[name].attrs["units"] for name in ("time", "q", "energy", "velocity_error")] == [
        "s",
        "m or 1",
        "J",
        "m/s",
    ]
    assert data.coordinate_units.sel(coordinate="rocker.e2") == "1"
    assert data.attrs["method"] == solution.method


def test_names_and_units_are_those_of_files(solution, tmp_path):
    pytest.importorskip("h5netcdf")
    data = solution.to_xarray()
    with xarray.open_dataset(solution.save(tmp_path / "run.nc"), engine="h5netcdf") as read:
        for name in ("q", "qd", "qdd"):
            np.testing.assert_array_equal(read[name], data[name])
            assert read[name].attrs == data[name].attrs
            assert read[name].dims == data[name].dims
        assert list(read.coordinate.values) == list(data.coordinate.values)
        assert read.attrs["scene"] == data.attrs["scene"]


def test_data_frames(solution):
    frame = solution.to_dataframe()
    np.testing.assert_array_equal(frame["q"]["crank.y"], solution.position("crank")[:, 1])
    np.testing.assert_array_equal(frame["energy"].squeeze(), solution.energy)
    np.testing.assert_array_equal(frame.index, solution.t)
    units = frame.attrs["units"]
    assert units["qd", "crank.y"], units["qd", "crank.e0"] == ("m/s", "1/s")
    assert set(units) == set(frame.columns)
    assert frame["multipliers"].shape == solution.multipliers.shape
