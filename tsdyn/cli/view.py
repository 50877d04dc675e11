"""The command `tsdyn view`: the animation of a scene's run, or of a saved solution."""

import sys
from pathlib import Path

from ..errors import InvalidArgument
from ..viewer.view import page_path
from .output import print_json
from .run import SOLUTIONS, add_force, add_json, add_method, add_scene, demand_new, options_of
from .scene_file import load_run, robot_options


def add_view_options(parser):
    """Add the options of `tsdyn view` to its parser."""
    add_scene(parser)
    add_method(parser)
    parser.add_argument("--output", metavar="PATH", help="where to write the page (default: the browser opens it)")
    add_force(parser)
    add_json(parser)


def _view(parsed):
    """Show the run of a scene, or a saved solution, as an animation in the web browser.

    A scene is run first, as `tsdyn run` does; a solution (.h5, .nc, .zarr) is shown as it is. The exit code is 0 only
    if the run reached its end.
    """
    if parsed.output is not None:
        demand_new(page_path(parsed.output), parsed.force)
    solution = _solution(parsed)
    path = solution.view(parsed.output)
    if parsed.json:
        print_json({"success": solution.success, "message": solution.message, "written": path})
    else:
        print(f"Animation: {path}")
    if not solution.success:
        print(f"tsdyn: {solution.message}", file=sys.stderr)
    return 0 if solution.success else 1


def _solution(parsed):
    if Path(parsed.scene).suffix.lower() in SOLUTIONS:
        from ..simulation.load import load

        found = load(parsed.scene)
        if not hasattr(found, "view"):
            raise InvalidArgument(
                f"{parsed.scene} is an ensemble; show a case: ts.load({parsed.scene!r}).case(0).view()"
            )
        return found
    from ..simulation.simulate import simulate

    scene, given = load_run(parsed.scene, parsed.allow_code, robot_options(parsed))
    span, options = options_of(parsed, given)
    return simulate(scene, span, **options, dense_output=True)
