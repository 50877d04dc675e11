"""Exceptions for input refused before a run; the status with which a run ends."""

from __future__ import annotations

import re
from enum import IntEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .hints import Solution


CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x80-\x9f]")  # what a terminal would obey, but for lines and tabs


class TsdynError(Exception):
    """Base of all errors that tsdyn raises; the message says what is wrong, where, and how to fix it.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ts.simulate(scene, (0, 1))
    Traceback (most recent call last):
    tsdyn.errors.InvalidBody: the scene has no bodies; add one with scene.add_body(...).
    """

    def __init__(self, message: str = "", *more: Any) -> None:
        super().__init__(CONTROL.sub(lambda found: repr(found[0])[1:-1], str(message)), *more)


class InvalidArgument(TsdynError, ValueError):
    """An argument has an invalid value, type or shape.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.shapes.sphere(0.5)
    Traceback (most recent call last):
    tsdyn.errors.InvalidArgument: sphere: give either mass= in kg or density= in kg/m^3.
    """


class InvalidCall(InvalidArgument, TypeError):
    """A call doesn't match the signature: an argument is misspelt, missing, duplicate or superfluous.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.Table(time=(0, 1), values=(0, 1))
    Traceback (most recent call last):
    tsdyn.errors.InvalidCall: Table() has no argument time; did you mean times? It has times, values, kind.
    """


class InvalidBody(TsdynError, ValueError):
    """The mass, inertia, pose or velocity of a body is inadmissible, or the body belongs to another scene.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.Scene().add_body(mass=-1.0, inertia=(1, 1, 1))
    Traceback (most recent call last):
    tsdyn.errors.InvalidBody: body1: mass (kg) must be a positive finite number, got -1.0.
    """


class InvalidConstraint(TsdynError, ValueError):
    """The geometry, bodies or kernels of a constraint are inadmissible.

    Examples
    --------
    >>> import tsdyn as ts
    >>> body = ts.Scene().add_body(mass=1.0, inertia=(1, 1, 1))
    >>> ts.constraints.Dot1(body, "ground", axis_a=(0, 0, 1), axis_b=(0, 0, 0))
    Traceback (most recent call last):
    tsdyn.errors.InvalidConstraint: Dot1(body1, ground): axis_b has length zero; give a direction, such as (0, 0, 1).
    """


class InvalidForce(TsdynError, ValueError):
    """The parameters, functions, bodies or kernels of a force are inadmissible.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ball = ts.Scene().add_point_mass(mass=1.0)
    >>> ts.forces.Spring(ball, "ground", point_b=(1, 0, 0), stiffness=-5.0)
    Traceback (most recent call last):
    tsdyn.errors.InvalidForce: Spring(body1, ground): stiffness must be a finite number that is not negative, got -5.0.
    """


class InconsistentState(TsdynError, ValueError):
    """Positions or velocities violate a constraint; the message names the row and its residual.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ball = ts.Scene().add_point_mass(mass=1.0)
    >>> rod = ball.scene.add(ts.constraints.Distance(ball, "ground", point_b=(1, 0, 0), length=1.5))
    >>> ts.simulate(ball.scene, (0, 1))
    Traceback (most recent call last):
    tsdyn.errors.InconsistentState: the initial position breaks 1 constraint row (allowed: 1e-09):
      Distance(body1, ground): Phi = -0.416667
    Correct the bodies' poses, or call scene.assemble() to move them to the nearest consistent ones.
    """

    constraints: tuple[Any, ...] = ()  # in conflict, if no state satisfies all of them


class RedundantConstraints(TsdynError, ValueError):
    """Rows of Phi_q are linearly dependent; the message names them.

    Examples
    --------
    Two equal joints have three rows too many:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> body = scene.add_body(mass=1.0, inertia=(1, 1, 1))
    >>> one, two = (scene.add(ts.constraints.Spherical(body, scene.ground)) for _ in range(2))
    >>> try:
    ...     ts.simulate(scene, (0, 1), redundancy="refuse")
    ... except ts.RedundantConstraints as error:
    ...     print(str(error).splitlines()[0])
    3 of the 7 constraint rows are redundant, Phi_q has rank 4:
    """


class SingularConfiguration(TsdynError, ArithmeticError):
    """The equations of motion have no unique solution: Phi_q loses rank, or D^T M D is singular, also to rounding.

    Examples
    --------
    A thin rod has no inertia about its axis:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> needle = scene.add_body(**ts.shapes.rod(1.0, mass=1.0), name="needle")
    >>> try:
    ...     ts.simulate(scene, (0, 1))
    ... except ts.SingularConfiguration as error:
    ...     print(str(error).partition(", so")[0])
    needle: rotation about the axis [0. 0. 1.] of its frame is free and carries no inertia
    """


class NoEquilibrium(TsdynError, ArithmeticError):
    """No static equilibrium was found; the message says which body falls, or accelerates still.

    Examples
    --------
    Nothing holds a ball:

    >>> import tsdyn as ts
    >>> ball = (scene := ts.Scene()).add_point_mass(mass=1.0, name="ball")
    >>> try:
    ...     scene.equilibrium()
    ... except ts.NoEquilibrium as error:
    ...     print("ball falls freely" in str(error))
    True
    """


class UnknownAttribute(TsdynError, AttributeError):
    """Assignment to an attribute that a body, constraint, force or scene doesn't have.

    Examples
    --------
    >>> import tsdyn as ts
    >>> body = ts.Scene().add_body(mass=1.0, inertia=(1, 1, 1))
    >>> body.masss = 2.0
    Traceback (most recent call last):
    tsdyn.errors.UnknownAttribute: <Body 'body1'> has no attribute 'masss' to set; did you mean mass?
    """


class UnknownParameter(InvalidArgument, KeyError):
    """A scene has no parameter of this name.

    Examples
    --------
    >>> import tsdyn as ts
    >>> body = ts.Scene().add_body(mass=1.0, inertia=(1, 1, 1), name="bob")
    >>> body.scene.parameters()["bob.mas"]
    Traceback (most recent call last):
    tsdyn.errors.UnknownParameter: the scene has no parameter 'bob.mas'; did you mean bob.mass?
    """

    __str__ = Exception.__str__  # KeyError's quotes the message


class MissingDependency(TsdynError, ImportError):
    """A feature needs an optional package that is not installed.

    Examples
    --------
    >>> import tsdyn as ts
    >>> issubclass(ts.MissingDependency, ImportError)
    True
    """


class StorageError(TsdynError, OSError):
    """A store or a checkpoint can't be written, read or gone on with.

    Examples
    --------
    >>> import tsdyn as ts
    >>> issubclass(ts.StorageError, OSError)
    True
    """


class ImportLosses(UserWarning):
    """What a file of another program describes and the scene lacks; `scene.imported` lists each.

    Examples
    --------
    >>> import tsdyn as ts
    >>> issubclass(ts.ImportLosses, UserWarning)
    True
    """


class CompilerWarning(RuntimeWarning):
    """Kernels are compiled in a slower way than usual, or a stored kernel is damaged; results are the same.

    Examples
    --------
    >>> import tsdyn as ts
    >>> issubclass(ts.CompilerWarning, RuntimeWarning)
    True
    """


class InvalidFile(TsdynError, ValueError):
    r"""A scene file has mistakes; the message lists all, with line and column.

    Attributes
    ----------
    mistakes : tuple
        (line, column, message) of each, from 1.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> import tsdyn as ts
    >>> path = Path(mkdtemp(), "scene.toml")
    >>> _ = path.write_text('version = 1\n[[body]]\nname = "bob"\nmas = 1.0\ninertia = [1, 1, 1]\n')
    >>> try:
    ...     ts.load(path)
    ... except ts.InvalidFile as error:
    ...     print(error.mistakes[0])
    (2, 1, "body 'bob' lacks mass.")
    """

    def __init__(self, message: str, mistakes: tuple[tuple[int, int, str], ...] = ()) -> None:
        super().__init__(message)
        self.mistakes = mistakes

    def __reduce__(self) -> Any:
        return type(self), (self.args[0], self.mistakes)


class StepFailure(TsdynError, ArithmeticError):
    """A run ended early; raised by `Solution.raise_if_failed`, with the partial solution as `.solution`.

    Examples
    --------
    A pendulum, stopped after two steps:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> try:
    ...     ts.simulate(scene, (0, 1), max_steps=2).raise_if_failed()
    ... except ts.StepFailure as failure:
    ...     print(failure.solution.stats.steps, failure.solution.status)
    2 max_steps
    """

    def __init__(self, message: str, solution: Solution | None = None) -> None:
        super().__init__(message)
        self.solution: Solution | Any = solution  # never None where `raise_if_failed` has raised it


class CheckFailed(TsdynError, AssertionError):
    """A check of a plug-in failed; the message names the entry, its value and the expected value.

    Examples
    --------
    >>> import tsdyn as ts
    >>> issubclass(ts.testing.CheckFailed, ts.TsdynError)
    True
    """


class Status(IntEnum):
    """Reason for the end of a run or of a slice of it; `sentence` states it, `remedy` what to do.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> solution = ts.simulate(scene, (0, 1), max_steps=2)
    >>> solution.status == ts.Status.MAX_STEPS, solution.status.sentence
    (True, 'The run reached max_steps.')
    """

    SUCCESS = 0
    NEWTON_FAILED = 1
    NOT_FINITE = 2
    SINGULAR = 3
    MASS_SINGULAR = 4
    MAX_STEPS = 5
    INTERRUPTED = 6
    CHART_LOST = 7
    STEP_COLLAPSED = 8
    SLICE_DONE = 9
    EVENT = 10
    EVENT_FAILED = 11
    STAGE_FAILED = 12
    STIFF = 13
    UNHELD = 14
    JAMMED = 15
    PASSAGE = 16
    SAMPLING_FAILED = 17
    STORE_FAILED = 18
    CASE_FAILED = 19
    NOT_RUN = 20
    SERIES_ENDED = 21
    CONTACT_FAILED = 22
    ACTION_FAILED = 23

    def __str__(self) -> str:
        return self.name.lower()

    def __format__(self, spec: str) -> str:
        return format(str(self), spec)

    @property
    def sentence(self) -> str:
        """What happened, without the location."""
        return _SENTENCES[self][0]

    @property
    def remedy(self) -> str:
        """What to try."""
        return _SENTENCES[self][1]


_SENTENCES = {
    Status.SUCCESS: ("The run reached the end of the interval.", ""),
    Status.NEWTON_FAILED: (
        "Newton's method for the position constraints (Eq. 29) did not converge, even on a new chart.",
        "Take a smaller step.",
    ),
    Status.NOT_FINITE: (
        "A number is no longer finite.",
        "Check for a motion, force or plug-in that returns inf or nan here, or take a smaller step.",
    ),
    Status.SINGULAR: (
        "The constraint Jacobian Phi_q has lost rank: this is a singular configuration.",
        "The Taylor integrator passes a singular configuration if the motion is smooth and every part of the scene has "
        "a series; else start from another configuration, or remove the constraint that has become dependent.",
    ),
    Status.MASS_SINGULAR: (
        "The reduced mass matrix D^T M D is not positive definite: a free direction has no inertia.",
        "Give the body inertia about its free axis, or constrain that axis.",
    ),
    Status.CHART_LOST: (
        "The motion left its chart within one step, so its branch of the constraints is uncertain.",
        "Take a smaller step.",
    ),
    Status.STEP_COLLAPSED: (
        "The step size that the tolerances require has reached the rounding of the time.",
        "Check for a singular configuration, a jump in a motion or stiffness near this time, or loosen rtol and atol.",
    ),
    Status.STAGE_FAILED: (
        "Newton's method for an implicit stage did not converge, or ended far from its prediction.",
        "Take a smaller step, or an adaptive method.",
    ),
    Status.MAX_STEPS: ("The run reached max_steps.", "Raise max_steps, or take a larger step."),
    Status.INTERRUPTED: (
        "The run was interrupted.",
        "Continue with simulate(scene, (t, t_end), state=solution.state).",
    ),
    Status.EVENT: ("A terminal event ended the run.", ""),
    Status.EVENT_FAILED: ("An event function returned no number.", "It must return a finite float for every state."),
    Status.UNHELD: (
        "Constraint rows that were redundant at the start no longer hold: the constraints are incompatible here.",
        "Remove one of the conflicting constraints, or correct their points and axes.",
    ),
    Status.JAMMED: (
        "No reactions are consistent with the friction of the joints.",
        "The mechanism may jam: with large friction coefficients rigid-body dynamics has no solution. Otherwise take a "
        "smaller step.",
    ),
    Status.STIFF: ("The motion has become stiff, or is stiff no more; another method takes over.", ""),
    Status.SLICE_DONE: ("A slice of the run is done.", ""),
    Status.SAMPLING_FAILED: (
        "The function of a sampled load returned no number.",
        "It must return a finite float for every coordinate and rate.",
    ),
    Status.PASSAGE: ("A singular configuration is near; the Taylor integrator takes over.", ""),
    Status.STORE_FAILED: (
        "The store could not be written any further.",
        "When that is mended, ts.resume goes on from the last checkpoint.",
    ),
    Status.CASE_FAILED: (
        "The case could not be run, or what was to be kept of it could not be found.",
        "Run it alone: ensemble.case(i).",
    ),
    Status.NOT_RUN: ("The case has not been run.", "Go on: resume=True with a store, or run it: ensemble.case(i)."),
    Status.SERIES_ENDED: (
        "A fixed step by series passes a place where the law of a force is not analytic, such as zero length "
        "of a spring.",
        "Leave out step=, so that steps end before such places, or take 'dop853' or 'nystrom4', which use no series.",
    ),
    Status.CONTACT_FAILED: (
        "The contacts leave no way on.",
        "Look at the contacts named, at what drives their bodies together, and at their coefficients of restitution.",
    ),
    Status.ACTION_FAILED: (
        "What the action of an event asks for can't be carried out.",
        "Correct the action; solution.state is the state at the event.",
    ),
}
