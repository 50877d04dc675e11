"""Impossible arguments of constraints and joints are refused by name."""

import math

import pytest

import tsdyn as ts
from tests.helpers.refusals import (
    INF,
    KINDS,
    NAN,
    NO_NUMBERS,
    branch,
    build,
    case,
    in_parts,
    made,
    one,
    placed,
    refuse,
    text,
    zero,
)

C = ts.constraints
POINTLESS = ("Dot1", "Parallel", "ConstantAngle", "AngleDriver")
POINTS = [(kind, f"point_{x}") for kind in KINDS if kind not in POINTLESS for x in "ab"]
DIRECTIONS = ("axis", "normal", "across", "reference", "direction")
AXES = [(kind, name) for kind, arguments in KINDS.items() for name in arguments if name.startswith(DIRECTIONS)]
OPTIONAL = [("Fixed", "axis_a"), ("Fixed", "axis_b")]
OPTIONAL += [(kind, f"reference_{x}") for kind in ("Fixed", "Translational", "RotationMotor", "Screw") for x in "ab"]
OPTIONAL += [("Gear", "reference_a"), ("Gear", "reference_b"), ("RackAndPinion", "reference_b")]
PAIRS = [
    ("itself", lambda w: (w.rod, w.rod), ("rod", "itself")),
    ("both ground", lambda w: (w.ground, w.ground), ("ground",)),
    ("another scene", lambda w: (w.rod, w.stranger), ("rod", "stranger", "different scenes")),
    ("ground of another scene", lambda w: (w.rod, w.other.ground), ("rod", "different scenes")),
    ("name of no body", lambda w: (w.rod, "baed"), ("'baed'", "no body", "'bead'")),
    ("names alone", lambda w: ("rod", "bead"), ("'rod'", "not a body", "ground")),
    ("the scene", lambda w: (w.rod, w.scene), ("not a body", "ground")),
    ("class of bodies", lambda w: (w.rod, ts.Body), ("not a body", "ground")),
    ("b is None", lambda w: (w.rod, None), ("None", "not a body", "ground")),
    ("a is None", lambda w: (None, w.rod), ("None", "not a body", "ground")),
]
NO_LENGTH = (0.0, -1.0, NAN, INF, "2", "x", 1j, [1.0], (1.0, 2.0, 3.0), zero, branch, (one, zero), 10**400)
NO_VALUE = (NAN, INF, None, "0.5", "x", 1j, (1.0, 2.0, 3.0), branch, (zero, zero))


def broken_later(w, kind, name):
    """Set an attribute of a constraint that is in its scene to zero."""
    constraint = w.scene.add(made(kind)(w))
    setattr(constraint, name, 0.0)


NO_TRAVEL = (0.0, NAN, INF, None, "1", 1j, [1.0], one)
ON_BEAD = [
    ("Spherical", (lambda w: (w.bead, w.ground)), {"point_a": (1, 0, 0)}, ts.InvalidConstraint, "point_a"),
    ("Distance", (lambda w: (w.rod, w.bead)), {"point_b": (1, 0, 0)}, ts.InvalidConstraint, "point_b"),
    ("PlaneContact", (lambda w: (w.bead, w.ground)), {"point_a": (1, 0, 0)}, ts.InvalidConstraint, "point_a"),
    ("PlaneContact", (lambda w: (w.rod, w.bead)), {}, ts.InvalidBody, "normal_b"),
    ("Dot1", (lambda w: (w.bead, w.rod)), {}, ts.InvalidBody, "axis_a"),
    ("Dot1", (lambda w: (w.rod, w.bead)), {}, ts.InvalidBody, "axis_b"),
    ("Dot2", (lambda w: (w.bead, w.rod)), {}, ts.InvalidBody, "axis_a"),
    *((kind, (lambda w: (w.rod, w.bead)), {}, ts.InvalidBody, "axis_b") for kind in KINDS if "axis_b" in KINDS[kind]),
    ("PointOnLine", (lambda w: (w.bead, w.ground)), {"point_a": (1, 0, 0)}, ts.InvalidConstraint, "point_a"),
    ("Fixed", (lambda w: (w.rod, w.bead)), {}, ts.InvalidBody, "axis_b"),
    ("Fixed", (lambda w: (w.bead, w.rod)), {}, ts.InvalidBody, "axis_a"),
]
CONSTRAINTS = [
    *(
        case(f"{kind}: {name}", made(kind, pair), ts.InvalidConstraint, *words)
        for kind in KINDS
        for name, pair, words in PAIRS
    ),
    *(
        case(f"{kind}: {argument}, {what}", made(kind, **{argument: value}), ts.InvalidConstraint, "joint", argument)
        for kind, argument in POINTS + AXES
        for what, value in NO_NUMBERS.items()
    ),
    *(
        case(f"{kind}: {argument}, {what}", made(kind, **{argument: value}), ts.InvalidConstraint, "joint", argument)
        for kind, argument in OPTIONAL
        for what, value in NO_NUMBERS.items()
        if value is not None
    ),
    *(
        case(f"{kind}: {argument} zero", made(kind, **{argument: (0, 0, 0)}), ts.InvalidConstraint, "joint", argument)
        for kind, argument in AXES + OPTIONAL
    ),
    *(
        case(
            f"{kind}: reference along the axis",
            made(kind, **KINDS[kind], axis_a=(1, 0, 0), axis_b=(1, 0, 0), reference_a=(-2, 0, 0)),
            ts.InvalidConstraint,
            "joint",
            "reference_a",
            "across",
        )
        for kind in ("Fixed",)
    ),
    case(
        "Universal: neither point nor axis_b",
        lambda w: C.Universal.at(w.rod, w.ground, axis=(0, 0, 1), point_a=(1, 0, 0), name="joint"),
        ts.InvalidConstraint,
        "joint",
        "axis_b follows from point",
    ),
    case(
        "Translational: reference along the axis",
        made("Translational", reference_b=(1, 1e-9, 0)),
        ts.InvalidConstraint,
        "joint",
        "reference_b",
        "across",
    ),
    *(
        case(f"ConstantAngle: angle {text(v)}", made("ConstantAngle", angle=v), ts.InvalidConstraint, "joint", "angle")
        for v in (0.0, math.pi, -1.0, 4.0, 1e-12, NAN, INF, "1", 1j, [1.0], (one, zero, zero))
    ),
    *(
        case(f"{kind}: {name} {text(v)}", made(kind, **{name: v}), ts.InvalidConstraint, "joint", name)
        for kind, name in (
            ("AngleDriver", "angle"),
            ("RotationMotor", "angle"),
            ("TranslationMotor", "displacement"),
        )
        for v in NO_VALUE
    ),
    *(
        case(f"PointDriver: path {text(v)}", made("PointDriver", path=v), ts.InvalidConstraint, "joint", "path")
        for v in (
            None,
            1.0,
            one,
            (0.0, 0.0),
            "abc",
            (0.0, 0.0, NAN),
            (0.0, branch, 0.0),
            [0.0] * 4,
            (0, 0, (one, zero)),
        )
    ),
    *(
        case(f"{kind}: {name} {text(v)}", made(kind, **{name: v}), ts.InvalidConstraint, "joint", name)
        for kind, name in (("Thread", "lead"), ("Screw", "lead"), ("RackAndPinion", "radius"), ("Gear", "ratio"))
        for v in NO_TRAVEL
    ),
    case("Screw without a lead", made("Screw", lead=0.0), ts.InvalidConstraint, "joint", "lead", "Revolute"),
    *(
        case(f"Gear: offset {text(v)}", made("Gear", offset=v), ts.InvalidConstraint, "joint", "offset")
        for v in (NAN, INF, "1", 1j, [1.0])
    ),
    case("Gear: centres on the axis", made("Gear", axis_a=(1, 0, 0)), ts.InvalidConstraint, "joint", "line of centres"),
    *(
        case(f"Gear: {name} along the axis", made("Gear", **{name: (0, 0, 2)}), ts.InvalidConstraint, "joint", name)
        for name in ("reference_a", "reference_b")
    ),
    *(
        case(f"{kind}: {name} along the axis", made(kind, **{name: (2, 0, 0)}), ts.InvalidConstraint, "joint", name)
        for kind in ("RotationMotor", "Screw", "RackAndPinion")
        for name in ("reference_a", "reference_b")
        if (kind, name) != ("RackAndPinion", "reference_a")
    ),
    case(
        "RackAndPinion: along the axis",
        made("RackAndPinion", direction_a=(1, 1, 0)),
        ts.InvalidConstraint,
        "joint",
        "direction_a",
        "45 degrees",
    ),
    *(
        case(f"{kind}.of {what}", lambda w, k=kind, n=name, j=joint: getattr(C, k).of(j(w), **{n: 0.0}), *rest)
        for kind, name in (("RotationMotor", "angle"), ("TranslationMotor", "displacement"))
        for what, joint in (("Spherical", lambda w: w.pivot), ("a body", lambda w: w.rod), ("None", lambda w: None))
        for rest in [(ts.InvalidConstraint, f"no {name} to be driven", "Cylindrical")]
    ),
    *(
        case(f"set {kind}.{name}", lambda w, k=kind, n=name: setattr(made(k)(w), n, "x"), ts.InvalidConstraint, name)
        for kind, name in (
            ("RotationMotor", "angle"),
            ("TranslationMotor", "displacement"),
            ("PointDriver", "path"),
        )
    ),
    *(
        case(f"set {kind}.{name} in a scene", lambda w, k=kind, n=name: broken_later(w, k, n), *rest)
        for kind, name in (("Screw", "lead"), ("RackAndPinion", "radius"), ("Gear", "ratio"), ("Thread", "lead"))
        for rest in [(ts.InvalidConstraint, name, "joint")]
    ),
    case(
        "ConstantAngle of parallel axes",
        made("ConstantAngle", axis_b=(1, 0, 0)),
        ts.InvalidConstraint,
        "joint",
        "Parallel",
    ),
    *(
        case(f"{kind}.at: {name}", placed(kind, pair), ts.InvalidConstraint, *words)
        for kind in KINDS
        if kind not in ("Distance", "Dot1", "Dot2", "PlaneContact")
        for name, pair, words in PAIRS
    ),
    *(
        case(f"{kind}.at: {argument}, {what}", placed(kind, **{argument: value}), ts.InvalidConstraint, "joint", name)
        for kind, argument, name in (
            ("Revolute", "point", "point_a"),
            ("Revolute", "axis", "axis_a"),
            ("Fixed", "axis", "axis_a"),
            ("Universal", "point", "point_a"),
            ("Universal", "axis", "axis_a"),
            ("Universal", "axis_b", "axis_b"),
            ("PointOnLine", "axis", "axis_b"),
        )
        for what, value in NO_NUMBERS.items()
        if value is not None
    ),
    *(
        case(f"{kind}.at: no axis", placed(kind, axis=None), ts.InvalidConstraint, "joint", "axis_")
        for kind in ("Revolute", "Cylindrical", "Translational", "Universal", "Planar", "PointOnLine", "Parallel")
    ),
    *(
        case(f"{kind}.at: axis zero", placed(kind, axis=(0, 0, 0)), ts.InvalidConstraint, "joint", "axis_")
        for kind in ("Revolute", "Cylindrical", "Translational", "Planar", "PointOnLine", "Parallel")
    ),
    *(
        case(f"Distance: length {text(v)}", made("Distance", length=v), ts.InvalidConstraint, "joint", "length")
        for v in NO_LENGTH
    ),
    case(
        "Distance of two points in one place",
        made("Distance", length=None, point_a=(-1, 0, 0)),
        ts.InvalidConstraint,
        "joint",
        "Spherical",
    ),
    *(
        case(f"{kind}: value {text(v)}", made(kind, value=v), ts.InvalidConstraint, "joint", "value")
        for kind in ("Dot1", "Dot2")
        for v in NO_VALUE
    ),
    *(
        case(f"Dot1: value {text(v)}", made("Dot1", value=v), ts.InvalidConstraint, "joint", "cosine", "parallel")
        for v in (1.0, -1.0, 1.5, (one, zero, zero))
    ),
    *(
        case(f"{kind} on a point mass: {word}", made(kind, pair, **arguments), error, "joint", word, "bead")
        for kind, pair, arguments, error, word in ON_BEAD
    ),
    case("EulerNormalization of a point mass", lambda w: C.EulerNormalization(w.bead), ts.InvalidBody, "bead"),
    case("EulerNormalization of the ground", lambda w: C.EulerNormalization(w.ground), ts.InvalidConstraint, "ground"),
    case("EulerNormalization of None", lambda w: C.EulerNormalization(None), ts.InvalidConstraint, "not a body"),
    case("added twice", lambda w: w.scene.add(w.pivot), ts.InvalidConstraint, "pivot", "once"),
    case(
        "part of a joint",
        lambda w: w.scene.add(C.Revolute.at(w.rod, w.ground, point=(0, 0, 0), axis=(1, 0, 0)).parts[0]),
        ts.InvalidConstraint,
        "Revolute(rod, ground) point",
        "add that",
    ),
    case(
        "joint added twice",
        lambda w: [w.scene.add(j) for j in [C.Fixed.at(w.rod, w.ground, name="weld")] * 2],
        ts.InvalidConstraint,
        "weld",
        "once",
    ),
    case(
        "joint added to another scene",
        lambda w: w.other.add(C.Fixed.at(w.rod, w.ground, name="weld")),
        ts.InvalidConstraint,
        "weld",
        "another scene",
    ),
    case("base of joints", lambda w: w.scene.add(ts.Joint(w.rod, w.ground)), ts.InvalidConstraint, "subclass"),
    case("added to another scene", lambda w: w.other.add(w.pivot), ts.InvalidConstraint, "pivot", "another scene"),
    case(
        "normalisation of another scene",
        lambda w: w.scene.add(C.EulerNormalization(w.stranger)),
        ts.InvalidConstraint,
        "stranger",
        "another scene",
    ),
    *(
        case(f"add {what}", lambda w, f=item: w.scene.add(f(w)), ts.InvalidConstraint, "not a constraint", "instance")
        for what, item in {
            "None": lambda w: None,
            "a body": lambda w: w.rod,
            "the scene": lambda w: w.scene,
            "a class": lambda w: C.Spherical,
            "a name": lambda w: "Spherical",
            "a list": lambda w: [w.pivot],
        }.items()
    ),
]


@pytest.mark.parametrize("cases", in_parts(CONSTRAINTS, 20))
def test_constraints(cases):
    for row in cases:
        call, error, words = row.values
        refuse(lambda call=call: call(build()), error, words, row.id)
