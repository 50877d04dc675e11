"""What commands share: their words, the scene of a file, JSON for machines."""

import argparse
import importlib.util
import json
import math
import re
import sys
import warnings
from pathlib import Path
from types import MappingProxyType

import numpy as np

from ..errors import ImportLosses, InvalidArgument
from ..simulation.load import SCENES
from ..simulation.scene import Scene
from ..validation import close

# What commands give to machines: JSON, in which what is no finite number is null; text in cells of CSV.


def print_json(data):
    """Print data as JSON."""
    print(json.dumps(plain(data), indent=1, allow_nan=False))


def plain(value):
    """Data for JSON: numbers of NumPy as Python's, NaN and infinities as None."""
    if isinstance(value, dict):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (int, str, type(None))) else str(value)


# A parser of arguments that answers a wrong word with the nearest right one.

ELSEWHERE = {  # options of other programs, and of earlier versions
    "--figure": "a figure is drawn with --plot [PATH]",
    "--no-figure": "a figure is drawn with --plot only",
    "--t-end": "the end of the run is --to",
    "--end": "the end of the run is --to",
    "--until": "the end of the run is --to",
    "--duration": "the end of the run is --to",
    "--t-start": "the start of the run stands in the file: [run] start",
    "--outputs": "the interval of outputs is --every",
    "--dt": "the interval of outputs is --every; a fixed step stands in the file: [run] method",
    "--integrator": "the integrator is --method",
    "--solver": "the integrator is --method",
    "--step": "a fixed step stands in the file: [run] method",
    "--tol": "tolerances are --rtol and --atol",
    "-o": "results are written with --output",
    "--overwrite": "files are overwritten with --force",
}


class Parser(argparse.ArgumentParser):
    """An `ArgumentParser` whose errors end with the nearest right words."""

    given = ()  # arguments of the command line, of the parsers of all commands

    def error(self, message):
        """Exit with code 2 after the usage, the message and what may have been meant; with --json as JSON, too."""
        message += self._hint(message)
        if "--json" in self.given:
            print_json({"error": "WrongUsage", "message": message})
        super().error(message)

    def _hint(self, message):
        """What may have been meant; empty if nothing is near."""
        choice = re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if choice:
            return _meant(choice[1], [word.strip(" '") for word in choice[2].split(",")])
        if re.search(r"argument --(to|every): invalid float", message):
            return "; it is a time in s. Results are written with --output"
        unknown = re.search(r"unrecognized arguments: (.*)", message)
        words = [word.partition("=")[0] for word in unknown[1].split() if word.startswith("-")] if unknown else []
        return "".join(f"; {ELSEWHERE[word]}" if word in ELSEWHERE else _meant(word, self._options()) for word in words)

    def _options(self):
        """Options of the command that is given."""
        found = list(self._option_string_actions)
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                for word in self.given:
                    if word in action.choices:
                        return [*dict.fromkeys([*found, *action.choices[word]._option_string_actions])]
        return found


def _meant(word, known):
    near = close(word, known)
    return f"; did you mean {' or '.join(near)}?" if near else ""


# Loading of a scene from a TOML or Python file, for the command line.


def robot_options(parsed):
    """What the command line says of a file of a robot."""
    return {name: getattr(parsed, name) for name in ("free_base", "outside", "limits")}


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
        raise InvalidArgument("--free-base is for URDF files, --outside and --limits for URDF, MJCF and SDF files.")
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
        Options of `ts.load` for files of robots: free_base, outside and limits.

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
