"""Exceptions for input refused before a run; the status with which a run ends."""

from enum import IntEnum


class TsdynError(Exception):
    """Base of all errors that tsdyn raises; the message says what is wrong, where, and how to fix it."""


class InvalidArgument(TsdynError, ValueError):
    """An argument has an invalid value, type or shape."""


class InvalidCall(InvalidArgument, TypeError):
    """A call doesn't match the signature: an argument is misspelt, missing, duplicate or superfluous."""


class InvalidBody(TsdynError, ValueError):
    """The mass, inertia, pose or velocity of a body is inadmissible, or the body belongs to another scene."""


class InvalidConstraint(TsdynError, ValueError):
    """The geometry, bodies or kernels of a constraint are inadmissible."""


class InvalidForce(TsdynError, ValueError):
    """The parameters, functions, bodies or kernels of a force are inadmissible."""


class InconsistentState(TsdynError, ValueError):
    """Positions or velocities violate a constraint; the message names the row and its residual."""


class RedundantConstraints(TsdynError, ValueError):
    """Rows of Phi_q are linearly dependent; the message names them."""


class SingularConfiguration(TsdynError, ArithmeticError):
    """The equations of motion have no unique solution: Phi_q loses rank, or D^T M D is singular."""


class UnknownAttribute(TsdynError, AttributeError):
    """Assignment to an attribute that a body, constraint, force or scene doesn't have."""


class MissingDependency(TsdynError, ImportError):
    """A feature needs an optional package that is not installed."""


class StepFailure(TsdynError, ArithmeticError):
    """A run ended early; raised by `Solution.raise_if_failed`, with the partial solution as `.solution`."""

    def __init__(self, message, solution=None):
        super().__init__(message)
        self.solution = solution


class CheckFailed(TsdynError, AssertionError):
    """A check of a plug-in failed; the message names the entry, its value and the expected value."""


class Status(IntEnum):
    """Reason for the end of a run or of a slice of it; `sentence` states it, `remedy` what to do."""

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

    def __str__(self):
        return self.name.lower()

    def __format__(self, spec):
        return format(str(self), spec)

    @property
    def sentence(self):
        """What happened, without the location."""
        return _SENTENCES[self][0]

    @property
    def remedy(self):
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
        "Go on with simulate(scene, (t, t_end), state=solution.state).",
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
    Status.STIFF: ("The motion is stiff; an implicit method is cheaper.", "Use SDIRK54."),
    Status.SLICE_DONE: ("A slice of the run is done.", ""),
    Status.SAMPLING_FAILED: (
        "The function of a sampled load returned no number.",
        "It must return a finite float for every coordinate and rate.",
    ),
    Status.PASSAGE: ("A singular configuration is near; the Taylor integrator takes over.", ""),
}
