"""A solution as data: files, labelled arrays, data frames, provenance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..calls import fitting_methods

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ..hints import Place


@fitting_methods
class Records:
    """Mixed into `Solution`."""

    def save(self, path: Place) -> Path:
        """Write the solution to a file, from which `ts.load` returns it; without pickle.

        Parameters
        ----------
        path : str or PathLike
            Ends in .h5, .hdf5, .nc or .zarr, which is the format (needs `tsdyn[data]`). A saved solution that is there
            is replaced. Names, dimensions, coordinates and units are those of stores, and xarray and netCDF read them.

        Returns
        -------
        Path

        Raises
        ------
        StorageError
            If there is something else at the path, or it can't be written.
        InvalidArgument
            If the path ends otherwise, or dense output is of a method of your own whose settings are no numbers.

        Notes
        -----
        The file holds outputs, histories, events, statistics, the scene, and dense output where the run kept it. A
        scene that can't be written (see `Scene.save`) is not in the file: `ts.load(path, scene=scene)`.

        Examples
        --------
        >>> from tempfile import mkdtemp
        >>> import tsdyn as ts
        >>> bob = (scene := ts.Scene(gravity=(0, 0, -10))).add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
        >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
        >>> path = ts.simulate(scene, (0, 1), dense_output=True).save(mkdtemp() + "/run.h5")
        >>> print(f"{ts.load(path).at(0.5).position('bob')[2]:.6f} m")
        -0.928200 m
        """
        from .saved_solutions import save

        return save(self, path)

    @property
    def provenance(self) -> dict[str, Any]:
        """Return where a solution comes from: version, scene, method, tolerances, machine and date.

        Returns
        -------
        dict
            source, scene (SHA-256 of its packed numbers), method, rtol, atol, ..., formulation, t_start, t_end, created
            (UTC), machine, system, python, numpy. Of a loaded solution those of the run.
        """
        from .saved_solutions import provenance

        return provenance(self)

    def to_xarray(self) -> Any:
        """Return the outputs as an xarray.Dataset with named coordinates and units (needs `tsdyn[data]`).

        Returns
        -------
        xarray.Dataset
            q, qd, qdd over (time, coordinate), coordinates being named "body.x", "body.e0" and so on, as in stores;
            multipliers over (time, row), rows by their names; position_error, velocity_error, acceleration_error,
            kinetic_energy, potential_energy and energy over time. Units are attributes; those of each coordinate are
            along `coordinate`, as `dataset.coordinate_units`. The provenance is among the attributes.

        Examples
        --------
        >>> import tsdyn as ts
        >>> stone = (scene := ts.Scene(gravity=(0, 0, -10))).add_point_mass(mass=1.0, name="stone")
        >>> data = ts.simulate(scene, (0, 1), t_eval=[0.0, 1.0]).to_xarray()
        >>> float(data.q.sel(coordinate="stone.z", time=1.0)), data.energy.attrs["units"]
        (-5.0, 'J')
        """
        from .saved_solutions import to_xarray

        return to_xarray(self)

    def to_dataframe(self, channels: str | Sequence[str] | None = None) -> Any:
        """Return the outputs as a pandas.DataFrame (needs `tsdyn[data]`).

        Parameters
        ----------
        channels : str or sequence of str, optional
            Names of channels, such as "hinge.angle" or "arm.position.z", as of `plot`; by default all outputs.

        Returns
        -------
        pandas.DataFrame
            Rows by time, s. Of channels a column each, "hinge.angle (rad)". Of all outputs columns by quantity and
            component, such as ("q", "crank.x"), ("multipliers", "rod") and ("energy", ""): the same quantities as of
            `to_xarray`. `frame.attrs["units"]` has the unit of each column.

        Raises
        ------
        MissingDependency
            If pandas is not installed.
        InvalidArgument
            If a name is that of no channel.
        StorageError
            If a channel needs parts of the scene that the solution of a file lacks.

        Examples
        --------
        >>> import tsdyn as ts
        >>> stone = (scene := ts.Scene(gravity=(0, 0, -10))).add_point_mass(mass=1.0, name="stone")
        >>> solution = ts.simulate(scene, (0, 1), t_eval=[0.0, 1.0])
        >>> frame = solution.to_dataframe()
        >>> print(frame["q"]["stone.z"].to_numpy(), frame.attrs["units"]["q", "stone.z"])
        [ 0. -5.] m
        >>> solution.to_dataframe("stone.velocity.z")["stone.velocity.z (m/s)"].to_list()
        [0.0, -10.0]
        """
        from .saved_solutions import to_dataframe

        return to_dataframe(self, channels)

    def to_csv(self, path: Place, channels: str | Sequence[str] | None = None) -> Path:
        """Write the outputs to a CSV file: a row of heads with units, then one for each output.

        Parameters
        ----------
        path : str or PathLike
            A file that is there is replaced.
        channels : str or sequence of str, optional
            Names of channels, such as "hinge.angle" or "arm.position.z", as of `plot`; by default all outputs.

        Returns
        -------
        Path

        Raises
        ------
        InvalidArgument
            If a name is that of no channel.
        StorageError
            If the file can't be written, or a channel needs parts of the scene that the solution of a file lacks.

        Examples
        --------
        >>> from tempfile import mkdtemp
        >>> import tsdyn as ts
        >>> stone = (scene := ts.Scene(gravity=(0, 0, -10))).add_point_mass(mass=1.0, name="stone")
        >>> solution = ts.simulate(scene, (0, 1), t_eval=[0.0, 1.0])
        >>> path = solution.to_csv(mkdtemp() + "/fall.csv", ["stone.position.z", "stone.velocity.z"])
        >>> print(path.read_text().strip())
        time (s),stone.position.z (m),stone.velocity.z (m/s)
        0.0,0.0,0.0
        1.0,-5.0,-10.0
        """
        from .saved_solutions import to_csv

        return to_csv(self, path, channels)
