"""Write the stubs of tsdyn.constraints, tsdyn.forces and tsdyn.integrators, from their signatures at run time.

    python -m tools.stubs

Type checkers do not run the code that finds these classes and that gives each its signature of `.at`: the stubs name
them. tests/project/test_types.py fails where a stub is out of date.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import numpy as np

import tsdyn as ts
from tsdyn import hints

ROOT = Path(__file__).parents[1]
FILES = {
    "constraints": ROOT / "constraints" / "__init__.pyi",
    "forces": ROOT / "tsdyn" / "forces" / "__init__.pyi",
    "integrators": ROOT / "integrators" / "__init__.pyi",
}
ATTACHED = (ts.Primitive, ts.Joint, ts.Force)
PAIRS = {  # arguments: the class of hints.py that has them as attributes
    ("point_a", "point_b"): "Points",
    ("axis_a", "axis_b"): "Axes",
    ("reference_a", "reference_b"): "References",
    ("joint", "function", "period", "which"): "JointLoads",
}
READ = {"ArrayLike": "Floats", "Prescribed": "Any", "Path": "Any", "Load": "Any", "VectorLoad": "Any"}  # what is kept


def stub(package: str) -> str:
    """Return the stub of one of the three packages."""
    module = getattr(ts, package)
    names = [name for name in module.__all__ if isinstance(getattr(module, name), type)]
    names.sort(key=lambda name: (len(getattr(module, name).__mro__), name))  # bases first
    classes = [_class(getattr(module, name), {*names, *ts.__all__}) for name in names]
    functions = [
        f"def {name}() -> {inspect.signature(getattr(module, name)).return_annotation}: ...\n"
        for name in sorted({*module.__all__} - {*names})
    ]
    body = "\n".join([*classes, *functions])
    return f"# Written by tools/stubs.py: do not edit.\n{_imports(body, {*names})}\n{body}"


def _class(cls: type, public: set[str]) -> str:
    """Attributes, `__init__`, `at`, and what no public base has."""
    known = [base for base in cls.__mro__[1:] if base.__name__ in public]
    bases = [base for base in known if not any(base in other.__mro__[1:] for other in known)]
    pairs = [pair for pair in PAIRS if issubclass(cls, ATTACHED) and {*pair} <= {*inspect.signature(cls).parameters}]
    names = [*(PAIRS[pair] for pair in pairs), *(base.__name__ for base in bases)]
    lines = [f"class {cls.__name__}({', '.join(names)}):", *_attributes(cls, sum(pairs, ()))]
    lines += _function("__init__", inspect.signature(cls.__init__))
    inherited = {name for base in bases for name in dir(base)} - {"at"}
    inherited |= {name for base in cls.__mro__ for name in inspect.get_annotations(base)}
    inherited |= {*inspect.signature(cls).parameters}  # said by _attributes
    inherited |= {name for pair in pairs for name in vars(getattr(hints, PAIRS[pair]))}
    for name in [name for name in dir(cls) if not name.startswith("_") and name not in inherited]:
        value = inspect.getattr_static(cls, name)
        if name == "at":
            signature = inspect.signature(cls.at.__func__).replace(return_annotation="Self")
            lines += ["    @classmethod", *_function(name, signature)]
        elif isinstance(value, property) and "return" in value.fget.__annotations__:
            lines += _attribute(name, value.fget.__annotations__["return"], None)
        elif isinstance(value, classmethod) and "return" in value.__func__.__annotations__:
            lines += ["    @classmethod", *_function(name, inspect.signature(value.__func__))]
        elif inspect.isfunction(value) and "return" in value.__annotations__:
            lines += _function(name, inspect.signature(value))
    return "\n".join(lines) + "\n"


def _attributes(cls: type, known: tuple[str, ...]) -> list[str]:
    """What the arguments of a constraint or force are kept as, but for those that its bases have."""
    if not issubclass(cls, ATTACHED):
        return []
    scene = ts.Scene()
    instance = cls.example(np.random.default_rng(0), *(scene.add_body(1.0, (1.0, 1.0, 1.0)) for _ in "ab"))
    lines = []
    for name, parameter in inspect.signature(cls).parameters.items():
        method = inspect.isfunction(inspect.getattr_static(cls, name, None))
        if name in ("a", "b", "name", *known) or method or not hasattr(instance, name):
            continue
        given = str(parameter.annotation)
        if given == "JointCoordinate" and isinstance(getattr(instance, name), ts.Joint):
            given = "Joint"  # of which another attribute says the coordinate
        if not _may_be_none(cls, name):
            given = given.removesuffix(" | None")
        lines += _attribute(name, READ.get(given, given), given if _may_be_set(instance, name) else None)
    return lines


def _attribute(name: str, kept: str, given: str | None) -> list[str]:
    """One attribute, by the type that is read and by that which may be set."""
    if given is None:
        return ["    @property", f"    def {name}(self) -> {kept}: ..."]
    return [f"    {name}: {kept if kept == given else f'Attribute[{given}, {kept}]'}"]


def _may_be_none(cls: type, name: str) -> bool:
    """Whether None is kept; elsewhere it asks for what follows from the bodies."""
    quantities = getattr(cls, "quantities", None)
    if not issubclass(cls, ts.Force) or name not in quantities:
        return False
    try:
        return quantities[name](None, name, ts.InvalidForce) is None
    except ts.TsdynError:
        return False


def _may_be_set(instance: object, name: str) -> bool:
    """Whether it can be set; where a joint's motor, load or friction acts is the joint's."""
    try:
        setattr(instance, name, getattr(instance, name))
    except (ts.TsdynError, AttributeError):
        return False
    return True


def _function(name: str, signature: inspect.Signature) -> list[str]:
    """A method on one line, defaults left out."""
    told = []
    for p in signature.parameters.values():
        if p.kind is p.KEYWORD_ONLY and "*" not in told:
            told.append("*")
        typed = f"{p.name}: {p.annotation}" if p.annotation is not p.empty else p.name
        told.append(typed if p.default is p.empty else f"{typed} = ...")
    return [f"    def {name}({', '.join(told)}) -> {signature.return_annotation}: ..."]


def _imports(body: str, own: set[str]) -> str:
    """The imports of all that the body names."""
    words = {*re.findall(r"\w+", body)} - own
    classes = {name for name in ts.constraints.__all__ if name[0].isupper()}
    abstract, typed = {"Callable", "Iterable", "Iterator", "Mapping", "Sequence"}, {"Any", "Self"}
    modules = (
        ("collections.abc", abstract),
        ("typing", typed),
        (".", {name for name in ts.__all__ if name[0].isupper()} - {*vars(hints)}),
        ("..constraints", classes),
        ("..hints", {*vars(hints)} - abstract - typed),
    )
    lines = [
        f"from {'..' if module == '.' else module} import {', '.join(sorted(words & names, key=_as_ruff))}"
        for module, names in modules
        if words & names
    ]
    first = sum(not line.startswith("from .") for line in lines)
    return "\n".join([*lines[:first], *([""] if first else []), *lines[first:]]) + "\n"


def _as_ruff(name: str) -> tuple[bool, str]:
    return not name.isupper(), name


def main() -> None:
    """Write all three."""
    for package, file in FILES.items():
        file.write_text(stub(package), encoding="utf-8")


if __name__ == "__main__":
    main()
