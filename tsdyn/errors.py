"""Exceptions for input refused before a run; the status with which a run ends."""

from enum import IntEnum


class TsdynError(Exception):
    """Any error that tsdyn raises on purpose; the message says what is wrong, where, and how to mend it."""


class InvalidArgument(TsdynError, ValueError):
    """An argument that is neither a body nor a constraint has a wrong value, type or shape."""


class InvalidCall(InvalidArgument, TypeError):
    """A call that the signature doesn't allow: an argument is misspelt, missing, given twice or one too many."""


class InvalidBody(TsdynError, ValueError):
    """A body's mass, inertia, pose or velocity is impossible, or the body belongs to another scene."""


class InvalidConstraint(TsdynError, ValueError):
    """A constraint's geometry, bodies or kernels are impossible."""


class InvalidForce(TsdynError, ValueError):
    """A force's numbers, functions, bodies or kernels are impossible."""


class InconsistentState(TsdynError, ValueError):
    """Positions or velocities break a constraint; the message names it and its residual."""


class RedundantConstraints(TsdynError, ValueError):
    """Rows of Phi_q depend on each other; the message names them."""


class SingularConfiguration(TsdynError, ArithmeticError):
    """The equations of motion have no unique solution here: Phi_q loses rank, or D^T M D is singular."""


class UnknownAttribute(TsdynError, AttributeError):
    """An attribute that a body, constraint or scene does not have was set: a slip of the pen would change nothing."""


class MissingDependency(TsdynError, ImportError):
    """An optional package is needed for this and is not installed."""


class StepFailure(TsdynError, ArithmeticError):
    """A run ended early; raised by `Solution.raise_if_failed`, with the solution so far as `.solution`."""

    def __init__(self, message, solution=None):
        super().__init__(message)
        self.solution = solution


class CheckFailed(TsdynError, AssertionError):
    """A check of a plug-in failed; the message says which entry, what it gave and what it should have given."""


class Status(IntEnum):
    """How a run ended, or the stop of one slice of it; `sentence` says it, `remedy` what to do."""

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
        """What happened, without the place."""
        return _SENTENCES[self][0]

    @property
    def remedy(self):
        """What to try."""
        return _SENTENCES[self][1]


_SENTENCES = {
    Status.SUCCESS: ("The run reached the end of the interval.", ""),
    Status.NEWTON_FAILED: (
        "Newton's method for the position constraints (Eq. 29) did not converge, not even on a fresh chart.",
        "Take a smaller step.",
    ),
    Status.NOT_FINITE: (
        "A number stopped being finite.",
        "Look for a motion, a force or a plug-in that returns inf or nan here, or take a smaller step.",
    ),
    Status.SINGULAR: (
        "The constraint Jacobian Phi_q has lost rank: this is a singular configuration.",
        "Taylor series pass such a place where the motion is smooth, if every part of the scene has one; else start "
        "elsewhere, or remove the constraint that has become dependent.",
    ),
    Status.MASS_SINGULAR: (
        "The reduced mass matrix D^T M D is not positive definite: a direction that the constraints leave free "
        "carries no inertia.",
        "Give the body inertia about its free axis, or add the constraint that holds it.",
    ),
    Status.CHART_LOST: (
        "The motion left its chart within a single step, so which branch of the constraints it is on is not certain.",
        "Take a smaller step.",
    ),
    Status.STEP_COLLAPSED: (
        "The step that the tolerances ask for is down to rounding of the time.",
        "Look for a singular configuration, a jump in a motion or stiff parts near this time; or loosen rtol and atol.",
    ),
    Status.STAGE_FAILED: (
        "Newton's method for a stage of the implicit method did not converge, or went far from its prediction.",
        "Take a smaller step, or an adaptive one.",
    ),
    Status.MAX_STEPS: ("The run reached max_steps.", "Raise max_steps, or take a larger step."),
    Status.INTERRUPTED: ("The run was interrupted.", "Go on with simulate(scene, (t, t_end), state=solution.state)."),
    Status.EVENT: ("A terminal event ended the run.", ""),
    Status.EVENT_FAILED: ("An event function gave no number.", "Mend it, or return a finite float for every state."),
    Status.UNHELD: (
        "Constraint rows that followed from the others at the start hold no longer: together they can't be met here.",
        "Remove one of the constraints that contradict each other, or correct their points and axes.",
    ),
    Status.JAMMED: (
        "No reactions could be found with which the joints' friction is in balance.",
        "The coefficients may be so large that the mechanism jams, so that no motion follows from rigid bodies; else "
        "take a smaller step.",
    ),
    Status.STIFF: ("The motion is stiff, and an implicit method is cheaper.", "Use SDIRK54."),
    Status.SLICE_DONE: ("A slice of the run is done.", ""),
    Status.SAMPLING_FAILED: (
        "A function that is sampled gave no number.",
        "Mend it, or return a finite float for every angle and rate.",
    ),
    Status.PASSAGE: ("A singular configuration is near, and there is a way past it.", ""),
}
