"""The commands on scene files: check, info, new, convert."""

import sys
import textwrap
from pathlib import Path

from ..drawing import aligned
from ..errors import InvalidArgument, TsdynError
from ..validation import counted
from . import run
from .parser import load_document, load_run, load_scene, print_json, robot_options

SCENES = (".toml",)


def add_info_options(parser):
    """Add the options of `tsdyn info`."""
    run.add_scene(parser, "FILE", optional=True)
    parser.add_argument("--parameters", action="store_true", help="what may vary from run to run, too, with units")
    parser.add_argument("--cache", action="store_true", help="the stored kernels instead, and those that are damaged")
    parser.add_argument("--schema", action="store_true", help="the JSON Schema of scene files instead, for editors")


def add_new_options(parser):
    """Add the options of `tsdyn new`."""
    parser.add_argument("path", nargs="?", default="scene.toml", metavar="PATH", help="default scene.toml")


def add_convert_options(parser):
    """Add the options of `tsdyn convert`."""
    run.add_scene(parser, "FROM")
    parser.add_argument("target", metavar="TO", help="where to write; the suffix is the format")
    run.add_channels(parser)
    run.add_force(parser)


def _check(parsed):
    """Check a scene file, and whether the scene can start.

    All mistakes of the file are listed with line and column; then the start is compared with the constraints. The exit
    code is 0 only if a run could begin.
    """
    from ..simulation.prepared_run import demand_startable

    found = {"file": parsed.scene, "ok": True, "mistakes": [], "message": "It can start."}
    try:
        scene, given = load_run(parsed.scene, parsed.allow_code, robot_options(parsed))
        demand_startable(scene, given)
        report = scene.imported
        if report:
            found |= {"not_carried_over": [list(entry) for entry in report.left_out], "notes": list(report.notes)}
    except TsdynError as error:
        if not parsed.json:
            raise
        lines = [{"line": line, "column": column, "message": said}
                 for line, column, said in getattr(error, "mistakes", ())]  # fmt: skip
        found |= {"ok": False, "mistakes": lines, "message": str(error)}
    if parsed.json:
        print_json(found)
    else:
        print(f"{parsed.scene}: {scene!r}\nIt can start: positions and velocities satisfy the constraints.")
        if report:
            print(report)
    return 0 if found["ok"] else 1


def _info(parsed):
    """Print what is in a file: bodies, mobility, redundant rows, the method and why; or the facts of a solution.

    In place of a file, --cache: where compiled kernels are stored, how many, and which can't be loaded and why;
    --schema: the JSON Schema by which editors complete and check scene files.
    """
    if (parsed.scene is not None) + parsed.cache + parsed.schema != 1:
        raise InvalidArgument("tsdyn info takes one of FILE, --cache and --schema.")
    if parsed.cache:
        return _cache_info(parsed)
    if parsed.schema:
        from ..files.schema import schema
        from ..simulation.prepared_run import simulate
        from ..simulation.scene import Scene

        print_json(schema(Scene, simulate))
        return 0
    if Path(parsed.scene).suffix.lower() in run.SOLUTIONS:
        return _solution_info(parsed)
    from ..simulation.phase_scenes import at_start
    from ..simulation.prepared_run import first_method, reason
    from ..simulation.run_options import RunOptions
    from ..simulation.scene_cache import prepared

    # the table of a study is left unread: what it names may not be there
    document = load_document(parsed.scene, parsed.allow_code, False, robot_options(parsed))
    scene, given = document.scene, document.run
    mobility, chosen = scene.mobility(), (RunOptions(), prepared(at_start(scene)))
    why = f"{type(first_method(*chosen)).__name__}: {reason(*chosen)}"
    if parsed.json:
        print_json(_facts(scene, mobility, why, given))
        return 0
    print(f"{parsed.scene}: {scene!r}")
    _print_table("bodies", [(body.name, type(body).__name__, f"{body.mass:g} kg") for body in scene.bodies])
    items = [(item.name, type(item).__name__, counted(len(item.row_labels), "row")) for item in scene._added]
    _print_table("constraints", items)
    _print_table("forces", [(force.name, force._kind(), "") for force in scene.forces])
    if parsed.parameters:
        print(f"parameters:\n{textwrap.indent(str(scene.parameters()), '  ')}")
    print(mobility)
    print(f"Method: {why}")
    if given:
        print(f"Run: {', '.join(f'{name}={value!r}' for name, value in given.items() if name != 't_eval')}")
    return 0


def _print_table(title, rows):
    if not rows:
        return
    print(textwrap.indent("\n".join([f"{title}:", *aligned(rows, range(3))]), "  ")[2:])


def _facts(scene, mobility, why, given):
    """What `tsdyn info` reports about a scene, for JSON."""
    parameters = scene.parameters()
    units = parameters.units
    return {
        "bodies": [{"name": body.name, "type": type(body).__name__, "mass": float(body.mass)} for body in scene.bodies],
        "constraints": [
            {"name": item.name, "type": type(item).__name__, "rows": len(item.row_labels)} for item in scene._added
        ],
        "forces": [{"name": force.name, "type": force._kind()} for force in scene.forces],
        "coordinates": mobility.coordinates,
        "rows": mobility.rows,
        "rank": mobility.rank,
        "degrees_of_freedom": mobility.degrees_of_freedom,
        "redundant_rows": [row.name for row in mobility.redundant],
        "singular": bool(mobility.singular),
        "parameters": {name: {"value": value, "unit": units[name]} for name, value in parameters.items()},
        "method": why,
        "run": {name: str(value) for name, value in given.items() if name != "t_eval"},
    }


def _solution_info(parsed):
    """Print the facts of a solution or ensemble in a file."""
    from ..ensembles.results import Ensemble
    from ..simulation.load import load
    from .ensemble import facts, table_lines
    from .run import summary

    solution = load(parsed.scene)
    if isinstance(solution, Ensemble):
        if parsed.json:
            print_json(facts(solution))
        else:
            print("\n".join([repr(solution), *table_lines(solution)]))
        return 0
    _say_what_lacks(solution)
    if parsed.json:
        print_json(summary(solution))
        return 0
    print(f"{solution}\nProvenance")
    for name, value in solution.provenance.items():
        print(f"  {name:12}{value}")
    return 0


def _say_what_lacks(found):
    """Print to stderr what can't be shown of a file, for want of functions or classes of its owner."""
    if getattr(found, "_lacks", ""):
        print(f"tsdyn: {found._lacks}", file=sys.stderr)


def _cache_info(parsed):
    """Print what is in the folder of compiled kernels."""
    from ..jit import cache
    from ..jit.compilers import described, machine, shipped

    came = shipped()
    found = {"compiler": described(), "target": machine(), **cache.contents(), "shipped": came and str(came)}
    if parsed.json:
        print_json(found)
        return 0
    print(f"Kernels are compiled by {found['compiler']}, for {found['target'][2]}.")
    if came:
        print(f"Those of tsdyn's own came with it, compiled, in {came}")
    if found["folder"] is None:
        print("No folder can be written to, so every process compiles its kernels; set TSDYN_CACHE_DIR to one.")
        return 0
    print(f"{found['kernels']} kernels, {found['bytes'] / 1e6:.1f} MB, are in {found['folder']}")
    if found["stock"]:
        print(f"{found['stock']} more, compiled by Numba as it comes, are in its folder stock")
    for title, lines in (("damaged now", found["damaged"]), ("couldn't be loaded before", found["failures"])):
        print(f"{title}: {len(lines)}")
        for line in lines:
            print(f"  {line if isinstance(line, str) else ': '.join(line)}")
    return 0


def _new(parsed):
    """Write a scene file to start from, with comments: a pendulum with a spring and a run."""
    from ..files.scene_text import TEXT

    path = Path(parsed.path)
    if path.suffix.lower() not in SCENES:
        raise InvalidArgument(f"a scene file ends in .toml, got {parsed.path!r}.")
    try:
        with open(path, "x", encoding="utf-8") as file:
            file.write(TEXT)
    except FileExistsError:
        raise InvalidArgument(f"{path} exists; choose another name: tsdyn new other.toml.") from None
    except OSError as error:
        raise InvalidArgument(f"{path} can't be written: {error.strerror}.") from error
    if parsed.json:
        print_json({"written": path})
    else:
        print(f"{path} is written. Run it: tsdyn run {path}")
    return 0


def _convert(parsed):
    """Write a scene, or a solution, in another format.

    A scene (URDF, MJCF, SDF, or a Python file) becomes .toml, without shapes; a .toml is checked and copied as it
    stands, with comments and all tables. A solution or ensemble (.h5, .nc, .zarr) becomes another of these, or .csv.
    What exists is overwritten with --force only.
    """
    source, target = Path(parsed.scene).suffix.lower(), Path(parsed.target).suffix.lower()
    run.demand_new(parsed.target, parsed.force)
    if source in run.SOLUTIONS:
        from ..ensembles.results import Ensemble
        from ..simulation.load import load
        from .ensemble import write as write_ensemble

        run.demand_format(parsed.target)
        found = load(parsed.scene)
        _say_what_lacks(found)
        if isinstance(found, Ensemble):
            written = write_ensemble(found, parsed.target)
        else:
            written = run.write(found, parsed.target, run.channels_asked(parsed) or None)
    elif source in SCENES and target in SCENES:
        from ..simulation.load import text_of
        from ..simulation.scene import write_text

        load_document(parsed.scene, parsed.allow_code, robot=robot_options(parsed))  # refuses mistakes
        written = write_text(parsed.target, text_of(parsed.scene))
    elif target in SCENES:
        scene = load_scene(parsed.scene, parsed.allow_code, robot_options(parsed))
        written = scene.save(parsed.target)
        if scene.imported and not parsed.json:
            print(scene.imported)
    else:
        raise InvalidArgument(f"a scene is written to .toml, got {parsed.target!r}; tsdyn run --output runs it.")
    if parsed.json:
        print_json({"written": written})
    else:
        print(f"{written} is written.")
    return 0
