"""What shows a run: an animation, and figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..calls import fitting_methods

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path


@fitting_methods
class Showing:
    """Mixed into `Solution`; what draws is loaded when it is asked for."""

    def view(
        self,
        path: str | Path | None = None,
        *,
        shapes: Mapping[Any, Any] | None = None,
        trails: Sequence[Any] | None = None,
    ) -> Any:
        """Show the run as an interactive 3-D animation: one HTML page, which works offline.

        Parameters
        ----------
        path : str or Path, optional
            The file to write, of suffix .html if it has none. By default a notebook shows the page inline; elsewhere it
            is written to a temporary file, which the web browser opens.
        shapes : dict, optional
            Body, ground or name -> what to draw for it: one of `ts.shapes` (`Box`, `Sphere`, `Cylinder`, `Mesh`, or a
            shape with mass) or a list of them, in the frame of the body. Other bodies are drawn as the uniform solid
            with their inertia, and rods to their joints.
        trails : sequence, optional
            Whose ways are shown: bodies, for their centroids, or pairs (body, point), point (3,) in the body frame, m.
            By default the centroids of up to eight bodies.

        Returns
        -------
        Path, or View in a notebook

        Raises
        ------
        InvalidArgument
            If there are no outputs, a shape or trail is none, or the file can't be written.
        InvalidBody
            If a key of shapes, or what should leave a trail, is not a body of this solution's scene.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> import tsdyn as ts
        >>> bob = (scene := ts.Scene()).add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
        >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
        >>> solution = ts.simulate(scene, (0, 2))
        >>> with TemporaryDirectory() as folder:
        ...     page = solution.view(Path(folder) / "pendulum", shapes={"bob": ts.shapes.Sphere(0.1, colour="red")})
        ...     print(page.name)
        pendulum.html
        """
        from ..viewer.view import show

        return show(self, path, shapes, trails)

    def plot(self, path: str | Path | None = None) -> Any:
        """Draw constraint errors, energies, steps and charts over time.

        `ts.plots` has these and other figures by themselves.

        Parameters
        ----------
        path : str or Path, optional
            A file to write the figure to, in the format of its suffix.

        Returns
        -------
        ndarray (2, 2) of matplotlib Axes

        Raises
        ------
        MissingDependency
            If matplotlib is not installed.
        InvalidArgument
            If the file can't be written.

        Examples
        --------
        >>> import matplotlib
        >>> import tsdyn as ts
        >>> matplotlib.use("agg")
        >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0)
        >>> axes = ts.simulate(scene, (0, 1)).plot()
        >>> axes[0, 1].get_ylabel()
        'energy (J)'
        """
        from ..figures.overview import overview

        return overview(self, path)
