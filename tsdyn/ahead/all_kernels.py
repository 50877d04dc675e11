"""The kernels that `tsdyn compile` compiles: all that a first run may need, or all that there are."""

import contextlib
import sys
from importlib import import_module
from pathlib import Path

from ..elements import force, primitive
from ..formulations.registry import FORMULATIONS
from ..integrators import Taylor
from ..jit import cache
from ..jit.code_hash import is_ours
from ..jit.compiled import DEBUG, is_declared, is_stored
from ..rows.interface import ELIMINATION
from .first_run import of_constraint, of_force, of_method
from .workers import compile_ahead, name_of


def compile_kernels(everything=False):
    """Compile what the default method needs for any built-in constraint and force, or all kernels there are.

    Returns how many there are, the folder that has them, and {name: problem} of those that it has not.
    """
    if DEBUG:
        return 0, None, {"everything": "TSDYN_DEBUG is set, so nothing is compiled"}
    names = named(everything)
    if cache.folder() is None:
        return len(names), None, {"everything": "no folder can be written to; set TSDYN_CACHE_DIR to one"}
    failed = compile_ahead(names.values(), asked=True)
    absent = {name: "the file could not be written" for name, kernel in names.items() if not is_stored(kernel)}
    return len(names), cache.folder(), absent | failed


def named(everything):
    """The kernels, by the names that other processes know them by."""
    return {name: kernel for kernel in (_all() if everything else _default()) if (name := name_of(kernel))}


def _default():
    yield from ELIMINATION["symmetric"]
    form = FORMULATIONS["tangent"]
    for rough in (False, True):
        yield from of_method(Taylor(1e-8), form, True, rough=rough)
    for kind in _built_in(primitive.registered()):
        for moving in (False, *[True] * ("phi_t" in kind.kernels)):
            yield from of_constraint(kind, moving)
    for kind in _built_in(force.registered()):
        yield from of_force(kind.own_kernels)


def _all():
    home = Path(__file__).parents[1]
    for file in home.rglob("*.py"):  # modules that are imported when they are needed have kernels, too
        if not file.stem.startswith("__"):
            with contextlib.suppress(ModuleNotFoundError):  # an optional package's
                import_module(".".join((home.name, *file.relative_to(home).with_suffix("").parts)))
    for kind in _built_in({**primitive.registered(), **force.registered()}):
        yield from getattr(kind, "own_kernels", kind.kernels).values()
    for module in [value for name, value in sys.modules.items() if is_ours(name)]:
        yield from filter(is_declared, vars(module).values())


def _built_in(registered):
    return [kind for name, kind in registered.items() if is_ours(name)]
