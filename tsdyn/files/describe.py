"""A scene as plain data: bodies, constraints and forces with the arguments that make them again."""

import numpy as np

from ..elements.bodies import IDENTITY, Body
from ..errors import InvalidArgument
from ..jit.code_hash import is_ours
from . import types
from .types import Unwritable, encode

VERSION = 1
BUILT = {"built_a": 0, "built_b": 1}  # orientations of a and b at which an angle is zero


def describe(scene):
    """The document of a scene.

    Raises
    ------
    InvalidArgument
        If the scene has what a file can't hold, such as a function; names each.
    """
    refused = []
    document = {
        "version": VERSION,
        "gravity": scene.gravity.tolist(),
        "body": [_body(body) for body in scene.bodies],
        "constraint": [_item(item, refused) for item in scene._added],
        "force": [_item(item, refused) for item in scene.forces],
    }
    refused += _shared([body.name for body in scene.bodies] + ["ground"], "body")
    refused += _shared([item.name for item in (*scene._added, *scene.forces)], "constraint or force")
    if refused:
        raise InvalidArgument(
            "the scene can't be written, as a file holds data and no code: " + "; ".join(refused) + ". Write functions "
            "of time with ts.motions, such as 0.1 * np.sin(2.0 * ts.motions.time), or as a ts.Table."
        )
    return {key: value for key, value in document.items() if value != []}


def outline(scene):
    """The document of a scene without the parts that a file can't hold, or that are of classes not tsdyn's own.

    Returns
    -------
    dict, list of str
        The document; the names of the parts that are left out.
    """
    left, document = [], {"version": VERSION, "gravity": scene.gravity.tolist()}
    document["body"] = [_body(body) for body in scene.bodies]
    for key, items in (("constraint", scene._added), ("force", scene.forces)):
        document[key] = []
        for item in items:
            refused = [] if is_ours(type(item).__module__) else [item.name]
            found = {} if refused else _item(item, refused)
            named = [name for value in found.values() for name in (value if isinstance(value, list) else [value])]
            if refused or any(isinstance(name, str) and name in left for name in named):
                left.append(item.name)
            else:
                document[key].append(found)
    return {key: value for key, value in document.items() if value != []}, left


def _shared(names, what):
    seen = set()
    return [f"{name!r} is the name of more than one {what}" for name in names if name in seen or seen.add(name)]


def _body(body):
    """The pairs of a body."""
    rigid = isinstance(body, Body)
    found = {"name": body.name} | ({} if rigid else {"type": types.body_type(body)})
    for name, value in body.values.items():
        value = np.diagonal(value) if name == "inertia" and _is_diagonal(value) else value
        value = encode(value)
        if not _is_plain_zero(value) and not (name == "orientation" and repr(value) == repr(IDENTITY.tolist())):
            found[name] = value
    pieces = None if callable(body._shape) else body._shape  # those of an imported file may be meshes
    drawn = [_piece(piece) for piece in pieces or () if type(piece) in types.DRAWN.values()]
    return found | ({"drawn": drawn} if drawn or pieces == () else {})


def _piece(piece):
    """The pairs of a shape to draw."""
    found = {name: encode(getattr(piece, name)) for name in types.of_shape(type(piece))}
    plain = {"position": [0.0] * 3, "rotation": np.eye(3).tolist(), "colour": "", "axis": "z"}
    return {"type": type(piece).__name__} | {name: value for name, value in found.items() if value != plain.get(name)}


def _is_diagonal(matrix):
    return not _bits(matrix - np.diag(np.diagonal(matrix))).any() and not np.signbit(matrix).any()


def _bits(array):
    return np.ascontiguousarray(array).view(np.int64)


def _is_plain_zero(value):
    """Whether a value is zero, or a list of zeros, of positive sign: what an argument that is left out is."""
    return not isinstance(value, (bool, str, dict)) and not _bits(np.array(value, float)).any()


def _item(item, refused):
    """The pairs of a constraint or force; what can't be written is added to `refused`."""
    cls = type(item)
    found = {"type": types.type_name(cls)}
    if item.named or item.name != item._untitled([body for body in (item.a, item.b) if body is not None]):
        found["name"] = item.name
    arguments = types.of_class(cls)
    references = [name for name, argument in arguments.items() if argument.kind == types.REFERENCE]
    found |= {name: getattr(item, name).name for name in types.bodies_of(cls) if getattr(item, name) is not None}
    for name in references:
        found[name] = getattr(vars(item).get(name), "name", "")
        if not found[name]:
            refused.append(f"{item.name} keeps no {name}")
    for name, argument in arguments.items():
        if argument.kind == types.COORDINATE:
            found[name] = _coordinates(vars(item)[name])
        if argument.kind == types.POINTS:
            found[name] = [[body.name, list(s)] for body, s in vars(item)[name]]
        if argument.kind in types.NAMED:
            continue
        try:
            value = encode(_value_of(item, argument))
        except Unwritable as what:
            refused.append(f"{item.name}: {name} is {what}")
            continue
        if value is not None and not _is_left_out(value, argument):
            found[name] = value
    if getattr(item, "is_idle", False):  # says so, for nothing is left out by mistake
        found |= {name: encode(vars(item)[name]) for name in item.sources if vars(item)[name] is not None}
    return found | _history(item)


def _coordinates(given):
    """[joint, kind, index] of a coordinate of a joint, or of several."""
    joint, *which = given
    return [joint.name, *which] if which and isinstance(which[0], str) else [_coordinates(each) for each in given]


def _value_of(item, argument):
    """The present value of an argument; None where an item keeps none, as what follows from others."""
    if argument.place:
        borrowed = isinstance(getattr(type(item), "coordinates", None), property)
        return None if borrowed else getattr(item, argument.name, None)
    if argument.name in vars(item):
        return vars(item)[argument.name]
    if argument.required:
        raise Unwritable("kept under another name than that of the argument")
    return None


def _is_left_out(value, argument):
    """Whether an argument that is left out has this value."""
    if argument.required or argument.default is None:
        return False
    same = repr(value) == repr(encode(argument.default))
    return same and (value is False or value == "" or _is_plain_zero(value))


def _history(item):
    """What remains of edits of a scene: the orientations at which angles are zero, and turns."""
    if not item.joint_coordinates or "built" not in vars(item):
        return {}
    found = {}
    for key, i in BUILT.items():
        body, built = (item.a, item.b)[i], item.built[i]
        if built is not None and built.tobytes() != body.values["orientation"].tobytes():
            found[key] = built.tolist()
    if np.any(item.angle_near):
        found["angle_near"] = encode(item.angle_near)
    return found
