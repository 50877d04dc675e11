"""Loading of a scene from a TOML or Python file, for the command line."""

import importlib.util
import sys
import warnings
from pathlib import Path
from types import MappingProxyType

from ..errors import ImportLosses, InvalidArgument
from ..simulation.load import SCENES
from ..simulation.scene import Scene


def robot_options(parsed):
    """What the command line says of a file of a robot."""
    return {"free_base": parsed.free_base, "outside": parsed.outside}


def load_run(where, allow_code=False, robot=MappingProxyType({})):
    """The scene of a file, and the arguments of `simulate` that it asks for; arguments as for `load_scene`."""
    if Path(where).suffix.lower() in SCENES:
        from ..simulation.load import scene_file

        with warnings.catch_warnings(action="ignore", category=ImportLosses):
            scene, given = scene_file(where, allow_code, **robot)
        if scene.imported and scene.imported.left_out:
            lost = scene.imported.summary()
            print(f"tsdyn: {where}: not carried over: {lost}; tsdyn check lists each.", file=sys.stderr)
        return scene, given
    if any(robot.values()):
        raise InvalidArgument("--free-base is for URDF files, and --outside for URDF, MJCF and SDF files.")
    return load_scene(where), {}


def load_document(where, allow_code=False, study=None, robot=MappingProxyType({})):
    """What a file holds, as `scene_text.Document`; `study`: keys of its table ensemble that others replace."""
    from ..files.scene_text import Document

    if Path(where).suffix.lower() == ".toml" and not any(robot.values()):
        from ..simulation.load import document_of

        return document_of(where, allow_code, study)
    scene, given = load_run(where, allow_code, robot)
    return Document(scene, given, {}, {"files": [], "plot": None, "channels": []})


def load_scene(where, allow_code=False, robot=MappingProxyType({})):
    """The scene of a TOML, URDF, MJCF or SDF file; or, of a Python file, that of its `build()`, or its `scene`.

    Parameters
    ----------
    where : str
        A path, or the name of an example; a name behind a colon is of another function, or scene, in the file.
    allow_code : bool
        Whether a TOML file may import modules of plug-ins.
    robot : dict
        Options of `ts.load` for files of robots: free_base and outside.

    Raises
    ------
    InvalidArgument
        If there is no such file or name, it can't be run, or what it gives is no scene.
    """
    if Path(where).suffix.lower() in SCENES:
        return load_run(where, allow_code, robot)[0]
    path, _, name = where.partition(":") if not Path(where).exists() else (where, "", "")
    file = _file(path)
    module = _module(file)
    given = next(
        (getattr(module, word) for word in ([name] if name else ["build", "scene"]) if hasattr(module, word)), None
    )
    if given is None:
        wanted = f"no {name!r}" if name else "neither build() nor scene"
        raise InvalidArgument(f"{file} has {wanted}; write a function build() that returns a ts.Scene.")
    if callable(given):
        try:
            given = given()
        except TypeError as error:
            raise InvalidArgument(f"{file}: {name or 'build'}() must need no argument: {error}") from error
    if not isinstance(given, Scene):
        raise InvalidArgument(f"{file}: {name or 'build'} must give a ts.Scene, got {given!r}.")
    return given


def _file(where):
    """A path as it is given, or an example's."""
    examples = Path(__file__).resolve().parents[2] / "examples"
    tried = [Path(where), examples / f"{where}.py", Path("examples") / f"{where}.py"]
    for path in tried:
        if path.is_file():
            return path.resolve()
    known = sorted(path.stem for path in examples.glob("*.py") if not path.stem.startswith("_"))
    raise InvalidArgument(
        f"no file {where!r}; give the path of a scene file (.toml), or of a Python file that has a function build()"
        + (f", or an example: {', '.join(known)}." if known else ".")
    )


def _module(file):
    """The file's module, found again under its name as kernels in it need to be."""
    if not file.suffix == ".py":
        raise InvalidArgument(
            f"{file} is neither a scene file ({', '.join(SCENES)}) nor a Python file; tsdyn info and tsdyn view read "
            "solutions."
        )
    spec = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(spec)
    before = sys.modules.get(file.stem)
    sys.modules[file.stem] = module
    sys.path.insert(0, str(file.parent))  # as where the file is run itself
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        if before is not None:
            sys.modules[file.stem] = before
        raise InvalidArgument(f"{file} can't be run: {type(error).__name__}: {error}") from error
    finally:
        sys.path.remove(str(file.parent))
    return module
