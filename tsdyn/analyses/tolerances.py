"""Limits of linearisation, equilibria, kinematic analysis and inverse dynamics: unit, and where each comes from."""

# --- factorisation ---

# Coordinates up to which redundant rows are chosen by QR with pivoting, which costs their cube; of larger scenes by
# elimination, with this share of a pivot of S in its diagonal entry as in configuration.
DENSE, REDUNDANT_SHARE = 400, 1e-6

# --- choice of coordinates ---
# Accept the next coordinate in order if its component independent of the accepted ones is at least this fraction of the
# best candidate's.
IN_TURN = 0.1
# A coordinate is independent if this fraction of its variation is independent of the accepted ones. Squares, being
# pivots of a Gram matrix with rounding of 1e-15.
INDEPENDENT = 1e-9
# Share of the largest pivot of constraints and coordinates, unit rows, above which the coordinates are independent.
CLEAR = 1e-6

# Candidates per batch: their dense products cost as much as a sparse factorisation.
BATCH = 64

# --- steady motion ---
# rad; the turns after which a motion is compared with itself.
TURNS = 0.7, 2.1

# --- smoothness of forces ---
# Loads at both sides of a state, HALF_DIGITS of the scene's size (rad) and of the speeds away: their differences may
# deviate by this fraction of the expected change; those of a smooth law deviate by HALF_DIGITS over its scale.
ROUGH = 1e-2

# --- equilibria ---
# Residual accelerations over those of the loads alone: steps end at SUM_ROUNDING; NEGLIGIBLE is the part that the
# stiffness doesn't model; ACCEPTED at the end of all steps. Also of constraints, relative to 1 + max |q|; of
# accelerations that actuators leave where their matrix is regular, over the largest (rounding, of long chains too); and
# of loads: one below this share of the largest is idle, and is examined.
ACCEPTED = 1e-9
# Regularisation of singular factors. Weight of a translation by the scene's size against a rotation by one radian in
# the stiffness of massless bodies: chains of up to its inverse square root in links transmit forces. Softness of rows
# of unit length: factors without exchange of rows round by 1e-16 over it, so that a sign is certain above HALF_DIGITS
# of the stiffness of a body.
REGULARISED = 1e-8
# Refinements of what is solved with it, which lose half of the digits at first.
REGULARISED_SWEEPS = 2
# Factors of mu after an accepted and after a rejected step; its first and its least value; above STIFF the diagonal D
# doesn't suffice.
SOFTER, STIFFER, FIRST_MU, LEAST_MU, STIFF = 0.25, 5.0, 1e-2, 1e-9, 60.0
# Factor of a step that reduces the energy too little.
SHORTER = 0.3
# Where there is no stiffness, this fraction of the loads replaces it: steps then have their greatest length.
SLIDING = 1e-6
# Share of the terms of the stiffness that is rounding: an asymmetry up to it, and what a direction without stiffness
# has.
STIFFNESS_ROUNDING = 1e-10
# A step must do this fraction of the predicted work; a short one may leave this fraction of the residual loads.
WORTH, GOOD = 0.1, 0.9
# So many successive steps that don't halve a residual near rounding: it is rounding.
IN_VAIN = 3
# rad, or shares of the scene's size: the work of steps shorter than SHORT is rounding; if a step shorter than FINAL
# fails, the search ends.
SHORT, FINAL = 1e-4, 1e-9
# mu grows if a step exceeds its greatest length by this factor; tries of a step, or sweeps of refinement of velocities.
TOO_FAR, MOST_TRIES = 4.0, 20
# Fraction of the progress bar for the steps; the check of stability has the rest.
SEARCH = 0.7
# Steps at most; displacement over the size of the scene: a scene that moves farther is falling.
MOST_STEPS, FARTHEST = 400, 1e5
# rad, rotation in all steps: a body that has rotated farther is driven by its loads.
MOST_TURNED = 60.0
# Constraints after a step: sweeps end at ROUNDING of 1 + max |q|; one that leaves more than the fraction SLOWEST has
# stalled.
SLOWEST, MOST_SWEEPS = 0.7, 40
# rad, or shares of the scene's size: displacements away from a saddle, tried in turn.
KICKS = 0.1, 0.03, 0.01
# Residual accelerations over those of the loads alone, up to which a configuration without positive stiffness is near a
# saddle; sweeps of inverse iteration for a descent direction.
AT_SADDLE, SWEEPS = 1e-3, 8
# Degrees of freedom up to which all eigenvectors are computed; negative eigenvalues up to which only theirs are;
# shifts, as fractions of the stiffness, tried until it is positive definite.
SMALL, FEW_NEGATIVE, SHIFTS = 150, 6, (1e-4, 1e-2, 1.0, 10.0)
# Share of the stiffness below which a direction without load is neutral.
SOFT = 1e-5
# Saddles left at most.
MOST_SADDLES = 12

# --- relative equilibria ---
# Newton steps at most, and halvings of one.
MOST_NEWTON, HALVINGS = 60, 12


# --- steps along a branch ---
# Share of a step by which velocities, times the step, may differ from their prediction; another branch has others.
LARGEST_CHANGE = 0.2
# rad, or share of the scene's size: a change that is no sign of another branch, as where a motion starts from rest.
NO_CHANGE = 1e-3
# Share of what is allowed below which the next step is longer, and its factor.
CLOSE, GROWTH = 0.2, 2.0
# Steps over the times asked for, at least: a motion that comes back to rest in between is seen.
LEAST_STEPS = 50
# Share of the span below which a step is none; and share of the time: rounding of a shorter one is a thousandth of it.
SHORTEST, SEEN = 1e-11, 2e-13
# Steps in one call of the compiled code: some hundredths of a second, so that Ctrl-C is answered.
SLICE = 20000

# --- inverse dynamics ---
# Weight of accelerations that actuators can't give, over the largest square of a unit load with unit masses: small
# against the loads that they can give, and large enough for a pivot.
DELTA = 1e-10
# Residual of a given motion that is accepted, relative to 1 + max |q|, |qd| or |qdd|, and accelerations that actuators
# may leave, over the largest: runs give them to their tolerances. Constraints that a step towards an equilibrium may
# leave, relative to 1 + max |q|.
CONSISTENT = 1e-6
# Coordinates up to which the matrices of an instant are dense: a dense factorisation takes less time there.
DENSE_INSTANT = 120

# --- contacts --------------------------------------------------------------------------------------------------------
# Of coefficients of restitution: where less than that would act at an impact with friction, nothing acts. A jammed end
# rises by no more than the tolerance of the cone at a share of 1e-10.
LEAST_SHARE = 1e-3
# A rate of a gap is zero up to NEGLIGIBLE of its terms: velocities after an impact are right to rounding, those of a
# chain to some hundred roundings. Of accelerations, and of reactions as the accelerations that they cause:
LEVEL = 1e-11
# Relative error of reactions and velocities at an event, which are right to ten digits there. So the friction of a
# contact has reached its bound where it lacks less of it; a load below this share of the forces and inertial forces on
# the two bodies is none; and a friction that slips by less than this share of the two velocities, and of what
# accelerations have made since the start, takes part in the event of another, as if it rested.
EVENT_ERROR = 1e-9
# Of the largest reaction: contacts whose reactions pull by more are not closed, though rounding may explain it next to
# singular states.
PULLS = 1e-6
# Of the velocities of bodies, and of those that they reach along the scene's length: the slip of a contact below which
# its friction keeps a direction. Where slip begins slowly, as v = c t^2 / 2, and its direction turns, the friction
# turns v within v / (mu g): from 1e-6 m/s on, for 1 m and 9.81 m/s^2, that takes some hundred steps, from 1e-9 on 30
# times as many; the place is right to v sqrt(2 v / c), 1e-9 m.
AHEAD = 3e-7
# Of that slip: one below which a slip that turns has come to rest, and the least: iterations of stages leave 1e-13 m/s.
SLOWEST_SLIP, LEAST_SLIP = 1e-2, 1e-5
# Cosine of the turn of a slow slip from which on it may take the direction between, 8 degrees at an event; steps to it.
NEAR_WAY, SECANTS = 0.98, 3
# Steps to the directions in which slips of contacts that share their loads begin: half of the turn that is left each.
WAYS = 64
# Share of the bound of friction that decides then: the contact slides, though its acceleration is rounding.
WITHIN_BOUND = 1.0 - 1e-10
# Of the largest reaction: contacts that carry less share changes of the load as if they carried this.
LEAST_WEIGHT = 1e-3
# Square of the sine of the angle between a slip of a contact that sticks and the rows that hold, above which it is
# independent of them by far.
FAR = 1e-2
# Rounding of a gap that has just opened, over its rate times the time since, from which on its rate counts beside it:
# flights above rounding end at 1/16.
JUST_OPENED = 1.0 / 14.0

# --- friction at rest ------------------------------------------------------------------------------------------------
# m/s or rad/s: velocities for which STOPPED, and SLIP of elements, are given: of bodies under gravity, along 1 m.
# A body that slides in a plane, more slowly than STOPPED, has come to rest where its direction turns: ten times the
# velocity below which its direction is kept.
USUAL, STOPPED = 3.0, 1e-8
# Over SLIP of elements: below this friction keeps its direction where slip begins, as AHEAD has it of contacts.
KEPT_WAY = 300.0
# Roundings of the time within which an acceleration changes velocities by none: an event's time is right to some ten.
RESTS = 100.0
# Rounds of pivoting over those for all units at once; after as many, or where modes come back, one unit at a time. Also
# rounds in which contacts and frictions of joints are decided in turn: each changes the modes of some.
PIVOTS = 30
# Reaction over the bound from which on a unit whose event has come slides.
BROKEN = 1.0 - 1e-7
