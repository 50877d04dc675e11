"""Programs of functions of time and state: as those of motions, but run order by order, since the state follows so.

A program begins with

    t, instructions, offset of the constants, instructions of constants alone, offset of the rows of the results,
    results, row where the results go, rows, numbers of the program

followed by four numbers an instruction: operation, row of the result, two operands. Inputs have the first rows; they
are written by the caller at each order. A row is a series, one for each instance of the function.
"""

from ..jit.kernels import ANY, callback, caller, matrix, vector
from ..maths.recurrences import square
from .expressions import OPERATIONS, ordered
from .program import ADD, DIVIDE, MULTIPLY, POLYNOMIAL, SINE, STEP, SUBTRACT, operate
from .tolerances import PLAIN_DEGREE

HEAD, ALIGNED = 9, 8  # numbers before the instructions; those of a program are a multiple of that
T, COUNT, CONSTANTS, FIXED, RESULTS, GIVEN, PLACE, ROWS, LENGTH = range(HEAD)
SCALE, DIVIDE_BY, SQUARE = 100, 101, 102  # a constant times a series, a series over a constant, a series squared
SIGNATURE = "ppiii"  # program, rows, how many, coefficients of a row, k
call_order = caller(SIGNATURE)


@callback(SIGNATURE)
def run_order(program, rows, count, orders, k):
    """Order k of the rows after the inputs, then of the results, in rows from `place` on."""
    p, s = vector(program, ANY), matrix(rows, count, orders)
    constants, results, place = int(p[CONSTANTS]), int(p[RESULTS]), int(p[PLACE])
    for i in range(0 if k == 0 else int(p[FIXED]), int(p[COUNT])):
        at = HEAD + STEP * i
        what, y, a, b = int(p[at]), int(p[at + 1]), int(p[at + 2]), int(p[at + 3])
        if what == SCALE:
            s[y, k] = s[a, 0] * s[b, k]
        elif what == DIVIDE_BY:
            s[y, k] = s[a, k] / s[b, 0]
        elif what == SQUARE:
            s[y, k] = square(s[a], k)
        else:
            operate(p, at, constants, s, p[T], k)
    for i in range(int(p[GIVEN])):
        s[place + i, k] = s[int(p[results + i]), k]
    return 0


def may_change(program):
    """Whether the function may change within any part of a step, as sums, sines and products of a few factors don't."""
    degree = [1] * int(program[ROWS])  # of rows in the arguments, a sine's being that of its own
    for i in range(int(program[COUNT])):
        what, y, a, b = (int(x) for x in program[HEAD + STEP * i :][:STEP])
        if i < int(program[FIXED]):
            degree[y] = 0
        elif what in (ADD, SUBTRACT):
            degree[y] = max(degree[a], degree[b])
        elif what in (MULTIPLY, SQUARE):
            degree[y] = degree[a] + degree[a if what == SQUARE else b]
        elif what in (SINE, SCALE, DIVIDE_BY):
            degree[y] = degree[b if what == SCALE else a]
            degree[y + (what == SINE)] = degree[y]
        else:
            return True
        if degree[y] > PLAIN_DEGREE:
            return True
    return False


class Writer:
    """The program of some graphs.

    Parameters
    ----------
    results : list of Smooth
    inputs : int
        How many there are; they are in rows from `first` on.
    fixed : container of int
        Those that never change.
    first, place : int
        Rows where the inputs and the results begin.
    """

    def __init__(self, results, inputs, fixed, first, place):
        self.rows, self.known, self.constants = first + inputs, {}, []
        self.still, self.moving = [], []  # instructions of constants alone, and the others
        self.fixed = {first + i for i in fixed}  # rows that are constant
        row = {}
        for node in ordered(results):
            if node._operation == "input":
                row[id(node)] = first + int(node._numbers[0])
            else:
                row[id(node)] = self._row(node, [row[id(operand)] for operand in node._operands])
        self.results, self.place = [row[id(node)] for node in results], place

    def _row(self, node, operands):
        """The row of a node; the same one for the same operation on the same rows."""
        operation = OPERATIONS[node._operation]
        key = operation.code, *operands, node._numbers
        if key not in self.known:
            still = self.fixed.issuperset(operands)
            written = range(self.rows, self.rows + operation.rows)
            (self.still if still else self.moving).append(self._instruction(operation.code, operands, node, still))
            self.fixed.update(written if still else ())
            self.known[key], self.rows = written[0], written.stop
        return self.known[key] + operation.result

    def _instruction(self, what, operands, node, still):
        """Four numbers."""
        operands = list(operands)
        if node._numbers:
            operands.append(len(self.constants))
            self.constants += node._numbers
        if what == POLYNOMIAL:
            operands.append(len(node._numbers))
        if what == MULTIPLY and not still:
            a, b = operands
            if a == b:
                what = SQUARE
            elif a in self.fixed or b in self.fixed:
                what, operands = SCALE, [a, b] if a in self.fixed else [b, a]
        if what == DIVIDE and operands[1] in self.fixed and not still:
            what = DIVIDE_BY
        return [what, self.rows, *operands, *[0] * (2 - len(operands))]

    def numbers(self):
        """The program, a list of floats."""
        instructions = self.still + self.moving
        constants = HEAD + STEP * len(instructions)
        results = constants + len(self.constants)
        length = -(-(results + len(self.results)) // ALIGNED) * ALIGNED
        counts = len(instructions), constants, len(self.still), results, len(self.results), self.place, self.rows
        found = [0, *counts, length, *(number for each in instructions for number in each)]
        found += [*self.constants, *self.results]
        return [float(number) for number in found] + [0.0] * (length - len(found))
