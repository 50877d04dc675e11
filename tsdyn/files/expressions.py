"""Motions as text: arithmetic of the time t, read by a parser of its own. Nothing is executed."""

import ast
import math
import operator

import numpy as np

from ..motions.elementary import FUNCTIONS, Polynomial, Smooth, constant, ordered, time
from ..validation import close

LONGEST = 20_000  # characters of an expression that is read
DEEP, LONG = 20, 1_000  # nesting, and characters, from which on a part is written by a name of its own
TIME = "t"
SYMBOLS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/"}
OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
CONSTANTS = {"pi": math.pi}


class Misread(Exception):
    """Why an expression, or a value, can't be read."""


def _polynomial(*coefficients):
    return Polynomial(coefficients)


def _power(x, n):
    return Smooth("power", (x,), (n,)) if isinstance(x, Smooth) else x**n


OWN = {"constant": constant, "polynomial": _polynomial, "power": _power}
NAMES = (*OWN, *FUNCTIONS)


def read(text, names):
    """A number, or a motion, of an expression; names: numbers and motions that it may use.

    Raises
    ------
    Misread
    """
    if len(text) > LONGEST:
        raise Misread(f"an expression has at most {LONGEST} characters; give long parts names of their own.")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise Misread("it is no expression; write arithmetic such as '0.1 * sin(2 * t)'.") from error
    try:
        result = _value(tree, names)
    except (ArithmeticError, RecursionError, TypeError, ValueError) as error:
        raise Misread(f"it can't be evaluated: {error}") from error
    if isinstance(result, Smooth) or math.isfinite(result):
        return result
    raise Misread(f"it gives {result!r}, which is no finite number.")


def _value(node, names):
    """The value of a node of the syntax tree."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)
    if isinstance(node, ast.Name):
        return _named(node.id, names)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        value = _value(node.operand, names)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        return OPERATORS[type(node.op)](_value(node.left, names), _value(node.right, names))
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        base, exponent = _value(node.left, names), _value(node.right, names)
        if isinstance(exponent, Smooth):
            raise Misread("an exponent must be a number; write exp(x * log(base)).")
        return _real(base**exponent)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        return _called(node.func.id, [_value(part, names) for part in node.args])
    raise Misread(f"{ast.unparse(node)!r} is no arithmetic of numbers, t and the functions {', '.join(NAMES)}.")


def _named(name, names):
    if name == TIME:
        return time
    if name in names:
        return names[name]
    if name in CONSTANTS:
        return CONSTANTS[name]
    raise Misread(f"unknown name {name!r}; {_nearest(name, [TIME, *CONSTANTS, *names])}")


def _called(name, given):
    if name in OWN:
        return OWN[name](*given)
    if name not in FUNCTIONS:
        raise Misread(f"unknown function {name!r}; {_nearest(name, NAMES)}")
    if len(given) != 1:
        raise Misread(f"{name} has one argument, got {len(given)}.")
    if isinstance(given[0], Smooth):
        return FUNCTIONS[name](given[0])
    with np.errstate(all="ignore"):
        return float(getattr(np, name)(given[0]))


def _real(value):
    if isinstance(value, complex):
        raise Misread("a power of a negative number is not real.")
    return value


def _nearest(name, known):
    near = close(name, known)
    return f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(known)}."


def write(motion):
    """The text of a motion, and the parts that it names, operands first: each text, or the `Pieces` of data.

    A part has a name where it is used more than once, is data, or lies deep.
    """
    uses, texts, depths, parts = _uses(motion), {}, {}, {}
    nodes = ordered([motion])
    for node in nodes:
        depth = 1 + max((depths[id(operand)] for operand in node._operands), default=0)
        data = node._operation == "piecewise"
        text = "" if data else _text(node, texts)
        again = bool(node._operands) and (uses.get(id(node), 0) > 1 or depth > DEEP or len(text) > LONG)
        if node is not motion and (data or again):
            name = f"x{len(parts) + 1}"
            parts[name], text, depth = node._numbers if data else text, name, 0
        elif data:
            parts["x1"], text = node._numbers, "x1"
        texts[id(node)], depths[id(node)] = text, depth
    return texts[id(motion)], parts


def _uses(motion):
    """How often each node is an operand."""
    found = {}
    for node in ordered([motion]):
        for operand in node._operands:
            found[id(operand)] = found.get(id(operand), 0) + 1
    return found


def _text(node, texts):
    """The text of a node whose operands have theirs."""
    if node._operation == "polynomial":
        return _polynomial_text(node._numbers)
    operands = [
        repr(float(operand._numbers[0])) if _is_constant(operand) else texts[id(operand)] for operand in node._operands
    ]
    if node._operation in SYMBOLS:
        if all(_is_constant(operand) for operand in node._operands):
            operands = [f"constant({text})" for text in operands]
        one, other = (_wrapped(*pair) for pair in zip(node._operands, operands, strict=True))
        return f"{one} {SYMBOLS[node._operation]} {other}"
    (operand,) = (
        f"constant({text})" if _is_constant(given) else text
        for given, text in zip(node._operands, operands, strict=True)
    )
    return f"{node._operation}({', '.join([operand, *map(repr, map(float, node._numbers))])})"


def _polynomial_text(numbers):
    numbers = [float(x) for x in numbers]
    if numbers == [0.0, 1.0]:
        return TIME
    if len(numbers) == 1:
        return f"constant({numbers[0]!r})"
    return f"polynomial({', '.join(map(repr, numbers))})"


def _is_constant(node):
    return node._operation == "polynomial" and len(node._numbers) == 1


def _wrapped(node, text):
    """The text as an operand: in brackets, if it is a sum or product itself."""
    return f"({text})" if node._operation in SYMBOLS and not text.isidentifier() else text
