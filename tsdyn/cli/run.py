"""The commands `tsdyn run` and `tsdyn view`: a run of a scene file, its summary, results in files, its animation."""

import re
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from ..errors import InconsistentState, InvalidArgument
from ..files import run_tables, types
from ..files.formats import SUFFIXES as SOLUTIONS
from ..graphics.view import page_path
from ..observables.channels import channels_of
from .parser import load_document, load_run, print_json, robot_options

TABLES = (".csv",)
METAVARS = {float: "X", int: "N", str: "NAME"}  # what a flag is followed by


def add_run_options(parser):
    """Add the options of `tsdyn run` to its parser."""
    add_scene(parser)
    add_method(parser)
    add_output(parser)
    add_plot(parser, "the constraint errors, or the channels")
    add_channels(parser)


def add_method(parser):
    """Add how a scene is run: what the arguments of `simulate` are called here."""
    add_end(parser)
    parser.add_argument("--method", metavar="NAME", help="an integrator, such as dop853")
    parser.add_argument("--every", type=float, metavar="S", help="interval of outputs instead of every step")
    for name, argument in _flags().items():
        kind = {types.NUMBER: float, types.WHOLE: int, types.TEXT: str}[argument.kind]
        said = " or ".join(argument.options) or f"{argument.name}= of ts.simulate"
        parser.add_argument(f"--{name.replace('_', '-')}", type=kind, metavar=METAVARS[kind], help=said)


def _flags():
    """The options of a run that have a flag: numbers and words, by name."""
    from ..simulation.prepared_run import simulate

    known = run_tables.arguments(simulate)
    return {name: one for name, one in known.items() if one.kind in (types.NUMBER, types.WHOLE, types.TEXT)}


def add_end(parser):
    """Add the end of a run."""
    parser.add_argument("--to", type=float, metavar="S", help="end of the run (default: that of the file, or 10 s)")


def add_output(parser):
    """Add where results are written."""
    parser.add_argument(
        "--output", action="append", default=[], metavar="PATH",
        help="where to write results, again for more: .h5, .nc or .zarr (ts.load reads them), or .csv",
    )  # fmt: skip
    parser.add_argument("--csv", metavar="PATH", help="where to write a table")
    add_force(parser)


def add_channels(parser):
    """Add which channels a table and a figure have."""
    parser.add_argument(
        "--channels", nargs="+", action="extend", default=[], metavar="NAME",
        help="what tables and figures have, such as hinge.angle arm.position.z hinge.force; an object alone stands for "
        "its natural set",
    )  # fmt: skip


def channels_asked(parsed):
    """The names of channels, which may be apart by commas, too; a comma in brackets belongs to a name."""
    return [name for word in parsed.channels for name in re.split(r",\s*(?![^(]*\))", word) if name]


def add_force(parser):
    """Add the option without which nothing is overwritten."""
    parser.add_argument("--force", action="store_true", help="overwrite files that exist")


def add_plot(parser, what):
    """Add where a figure is drawn; "" stands for a name that the command chooses."""
    parser.add_argument("--plot", nargs="?", const="", metavar="PATH", help=f"draw {what} (default PNG)")


def add_scene(parser, metavar="SCENE", optional=False):
    """Add the file of a scene, and whether it may import plug-ins."""
    parser.add_argument(
        "scene",
        metavar=metavar,
        nargs="?" if optional else None,
        help="a TOML, URDF, MJCF or SDF file; or a Python file with a function build(), or a scene, which is then "
        "executed; file.py:name takes another one; or an example's name",
    )
    parser.add_argument("--free-base", action="store_true", help="the root link of a URDF is free to move")
    parser.add_argument("--outside", action="store_true", help="a file of a robot may name files outside its folder")
    parser.add_argument("--limits", action="store_true", help="limits of joints in a file of a robot become stops")
    parser.add_argument("--allow-code", action="store_true", help="import modules that the file names for plug-ins")


def add_json(parser):
    """Add the option of machine-readable output."""
    parser.add_argument("--json", action="store_true", help="print JSON, and nothing else")


def _run(parsed):
    """Run a scene file and print how good the run is.

    What the table [run] of the file says holds where no option is given; without either the run lasts 10 s, by the
    default method. The exit code is 0 only if the run reached its end, and all results were written.
    """
    from ..simulation.prepared_run import simulate

    document = load_document(parsed.scene, parsed.allow_code, robot=robot_options(parsed))
    scene, (span, options) = document.scene, options_of(parsed, document.run)
    outputs, plot = destinations(parsed, document)
    names = channels_asked(parsed) or document.output["channels"] or None
    if parsed.channels and plot is None and not any(Path(path).suffix.lower() in TABLES for path in outputs):
        raise InvalidArgument("--channels are those of a table or a figure; give --csv PATH or --plot, too.")
    if names is not None:
        channels_of(scene.packed, names)
        options["dense_output"] = options.get("dense_output", False) or plot is not None
    if not parsed.json:
        print(f"{parsed.scene}: {scene!r}", flush=True)
    solution = simulate(scene, span, progress=progress_of(parsed), **options)
    written = [str(write(solution, path, names)) for path in outputs]
    if plot is not None:
        written.append(str(_draw(solution, plot, names)))
    if parsed.json:
        print_json({**summary(solution), "written": written})
    else:
        print("\n".join([str(solution), *_lines(solution), *(f"  written   {path}" for path in written)]))
    if not solution.success:
        print(f"tsdyn: {solution.message}", file=sys.stderr)
    return 0 if solution.success else 1


def options_of(parsed, given):
    """The span, and the other arguments of `simulate`."""
    given = dict(given)
    start, end = given.pop("t_span", (0.0, run_tables.END))
    end = end if parsed.to is None else parsed.to
    if parsed.method is not None:
        given["integrator"] = parsed.method
    given |= {name: getattr(parsed, name) for name in _flags() if getattr(parsed, name) is not None}
    if parsed.every is not None:
        given["t_eval"] = run_tables.output_times(start, end, parsed.every)
    elif "t_eval" in given and parsed.to is not None:
        kept = np.asarray(given["t_eval"])
        given["t_eval"] = kept[kept <= end]
    return (start, end), given


def progress_of(parsed):
    """True where somebody sees a progress bar, else None."""
    return (sys.stderr.isatty() and not parsed.json and find_spec("tqdm") is not None) or None


def destinations(parsed, document):
    """Files of the results, and where to draw, by the options, else by the file; refused at once if not writable.

    What the file itself names is replaced by each run of it.
    """
    if parsed.csv is not None and Path(parsed.csv).suffix.lower() not in TABLES:
        raise InvalidArgument(f"--csv writes a file that ends in .csv, got {parsed.csv!r}.")
    asked = parsed.output + [parsed.csv] * (parsed.csv is not None)
    outputs, plot = asked or document.output["files"], document.output["plot"]
    for path in outputs:
        demand_format(path)
        demand_new(path, parsed.force or not asked)
    return outputs, plotted(parsed, Path(parsed.scene).stem, plot)


def plotted(parsed, stem, path=None):
    """Where to draw a figure, `path` without an option; refused at once, not after the run, if it can't be drawn."""
    if parsed.plot is not None:
        path = parsed.plot or f"{stem}.png"
    if path is not None:
        from ..drawing import demand_matplotlib

        demand_matplotlib()
        demand_folder(path)
    return path


def demand_folder(path):
    """Refuse a path in a folder that there isn't."""
    if not Path(path).resolve().parent.is_dir():
        raise InvalidArgument(f"there is no folder {Path(path).resolve().parent} to write {Path(path).name} to.")


def demand_new(path, force):
    """Refuse a path that can't be written to, or is that of a file, unless that may be overwritten."""
    demand_folder(path)
    if Path(path).exists() and not force:
        raise InvalidArgument(f"{path} exists; choose another name, or overwrite it with --force.")


def demand_format(path):
    """Refuse a path of results whose suffix says no format."""
    suffix = Path(path).suffix.lower()
    if suffix not in (*TABLES, *SOLUTIONS):
        raise InvalidArgument(f"results are written to {', '.join((*SOLUTIONS, *TABLES))}; got {path!r}.")
    if suffix in SOLUTIONS:
        from ..files.saved_file import format_at

        format_at(path)


def write(solution, path, channels=None):
    """Write a solution to a file, in the format of its suffix, a table with these channels; the path."""
    if Path(path).suffix.lower() in SOLUTIONS:
        solution.save(path)
        return path
    return solution.to_csv(path, channels)


def _draw(solution, path, channels):
    from matplotlib import pyplot

    from ..drawing import save
    from ..plots import constraint_error

    pyplot.switch_backend("agg")
    axes = constraint_error(solution) if channels is None else solution.plot(channels)[0]
    written = save(axes.figure, path)
    pyplot.close("all")
    return written


def summary(solution):
    """Figures of a run, for JSON."""
    error, energy = solution.constraint_error, solution.energy
    return {
        "success": bool(solution.success),
        "status": solution.status.name.lower(),
        "message": solution.message,
        "reached": float(solution.reached),
        "outputs": int(solution.t.size),
        "phases": len(solution.phases),
        "impulses": len(solution.impulses),
        "constraint_error": {name: _largest(getattr(error, name)) for name in ("position", "velocity", "acceleration")},
        "energy": {"start": float(energy[0]), "end": float(energy[-1]), "range": float(np.ptp(energy))}
        if energy.size
        else None,
        "stats": {name: value for name, value in vars(solution.stats).items()},
        "provenance": solution.provenance,
    }


def _largest(values):
    return float(values.max(initial=0.0))


def _lines(solution):
    """The errors and the energy of a run, for people."""
    found = summary(solution)
    error = found["constraint_error"]
    lines = [f"  errors    position {error['position']:.1e} m, velocity {error['velocity']:.1e} m/s, acceleration "
             f"{error['acceleration']:.1e} m/s^2 at most"]  # fmt: skip
    if found["energy"]:
        lines.append(f"  energy    {found['energy']['start']:.6g} J, range {found['energy']['range']:.1e} J")
    return lines


# The command `tsdyn view`: the animation of a scene's run, or of a saved solution.


def add_view_options(parser):
    """Add the options of `tsdyn view` to its parser."""
    add_scene(parser)
    add_method(parser)
    parser.add_argument("--no-run", action="store_true", help="show the scene at its start, assembled or not")
    parser.add_argument("--follow", metavar="BODY", help="the body that the camera goes with")
    parser.add_argument(
        "--camera", type=float, nargs=3, metavar=("X", "Y", "Z"), help="direction from the mechanism to the camera"
    )
    parser.add_argument(
        "--output", metavar="PATH", help="where to write the page, or a .gif (default: the browser opens the page)"
    )
    add_force(parser)


def _view(parsed):
    """Show the run of a scene, or a saved solution, as an animation in the web browser.

    A scene is run first, as `tsdyn run` does; a solution (.h5, .nc, .zarr) is shown as it is. With --no-run, and where
    the start violates constraints, the scene is shown at its start, with the violated rows. The exit code is 0 only if
    the run reached its end.
    """
    if parsed.output is not None:
        demand_new(page_path(parsed.output), parsed.force)
    shown = _shown(parsed)
    path = shown.view(parsed.output, camera=parsed.camera, follow=parsed.follow)
    success, message = getattr(shown, "success", True), getattr(shown, "message", "")
    if parsed.json:
        print_json({"success": success, "message": message, "written": path})
    else:
        print(f"{'Animation' if hasattr(shown, 'success') else 'Start'}: {path}")
    if not success:
        print(f"tsdyn: {message}", file=sys.stderr)
    return 0 if success else 1


def _shown(parsed):
    """The solution or the scene to show."""
    if Path(parsed.scene).suffix.lower() in SOLUTIONS:
        from ..simulation.load import load

        found = load(parsed.scene)
        if not hasattr(found, "view"):
            raise InvalidArgument(
                f"{parsed.scene} is an ensemble; show a case: ts.load({parsed.scene!r}).case(0).view()"
            )
        return found
    from ..simulation.prepared_run import simulate

    scene, given = load_run(parsed.scene, parsed.allow_code, robot_options(parsed))
    if parsed.no_run:
        return scene
    span, options = options_of(parsed, given)
    try:
        return simulate(scene, span, **options, dense_output=True)
    except InconsistentState as error:
        path = scene.view(parsed.output, camera=parsed.camera, follow=parsed.follow, t=span[0])
        raise InconsistentState(f"{error}\nThe start is drawn in {path}, with the violated rows in red.") from error
