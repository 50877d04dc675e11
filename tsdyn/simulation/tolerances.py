"""Limits of the preparation and assessment of runs; dimensionless unless a unit is named."""

# --- choice of the method ---
# Steps over which work is measured first; each measurement takes as many steps as there were before. Up to SETTLED
# steps the implicit method may take (SETTLED / steps)^2 times the work of the explicit one: its steps are short until
# fast modes have decayed, which steps at the limit of stability have kept alive.
FIRST_WINDOW, SETTLED = 10, 80
# The same where there is friction, which may come to rest: 8 steps to that, and 30 from 1e-8 s on to grow again.
RESTING = 40
# Share of what the explicit method would take for the rest of a run that the implicit one may lose before it gains: on
# bushings and springs of 1e6 to 1e12 N/m the default method takes 1.9 times the better of both at most, 4 with 0.25.
RISKED = 0.5
# Implicit steps after which the explicit method is tried; steps of either method in a trial, as many as what is left of
# a run must be worth.
PATIENCE, TRIED = 30, 20
# Factor of the steps until a method that did not pay is considered again, and until the explicit one is tried though
# the Jacobian has served all the time; of the work, with which a trial ends early.
AGAIN = 4
# The cost of an evaluation within an implicit stage, its share of the matrices included, in evaluations of an explicit
# one and in orders of a series: stiff chains of 4 to 64 links and a stiff joint take 0.8 to 1.7, and 4 to 9, overdamped
# springs of particles up to 3 and 13.
COST, SERIES_COST = 1.4, 6.5
STEP_EVALUATIONS = 16  # of a step of SDIRK54, about
# Safety factor between tolerances and step errors of SDIRK54 where it goes on: fast modes decay, and with them errors.
STIFF_SAFETY = 50.0
# Cost of an order of a series in scenes with sharp forces, where steps are as short as they are for a while only, over
# that of an evaluation: chains of four with friction, slip velocities of 1e-3 to 1e-1.
SHARP_COST = 0.1

# --- scenes far from the origin ---
# Sizes of a scene: beyond that distance from the origin it gets an origin of its own.
FAR_ORIGIN = 100.0
# Levers: at shorter distances from the origin rounding of positions touches no tolerance.
FAR_LEVER = 1e4

# --- singular configurations ---
# Smallest singular value, of the largest, below which a failure is put down to a singular configuration; coordinates up
# to which singular values are computed for that.
NEARLY_SINGULAR, MOST_SINGULAR = 0.05, 600
# Share of the length of a rope or cable below which a failure is put down to a span that vanishes.
NO_SPAN = 1e-4
# m or rad: a force that changes by as much within the second as within the first jumps there.
NEAR_BY, AT_ONCE = 1e-5, 1e-8
# Growth of the largest velocity at which a failure is put down to a motion that runs away.
BLOW_UP = 1e4

# Of the time in which forces vary: steps of a run that rounding of the forces keeps short are shorter. Changes of the
# positions by a last digit, of random signs, by which that rounding is measured; tolerances that are CLEAR of it.
# COARSE ones are above it, w EPS of a size, for rates w of 5e6 / s: it is not measured then.
SHORTENED, TRIALS, CLEAR, COARSE = 0.1, 3, 10.0, 1e-9

# --- progress ---
# s: a calculation that takes less shows no bar.
BAR_AFTER = 1.0

# --- energy ---
# Of the largest kinetic energy per second: power below it is rounding.
NO_POWER = 1e-9
# Of a piece's integral: its two halves agree with the whole; halvings at most.
AGREE, DEEPEST = 1e-11, 7
# Segments in a row that together get on by less than a part of the run: series carry the motion past nothing there.
PASSES, GOT_ON = 16, 1e-9

# --- contacts --------------------------------------------------------------------------------------------------------
# Of the scene's length, of angles in rad: a depth that no event leaves, which shows that an event was missed.
PENETRATION = 1e-9
# Of the scene's length, of angles in rad: an impact that is followed by a lower flight is the last one. Contacts of a
# tower lower each other's flights in turn, and impacts accumulate in them again and again: so each time ends early.
FLIGHT = 1e-12
# The same of flights that impacts of other contacts end, and the rate of their end over that of a free flight: contacts
# are as good as closed then. Their impacts would go on down to FLIGHT, each contact through all flights.
ACCUMULATED, PUSHED = 1e-10, 1.01
# Of the time in which accelerations move a body along the scene's length: reactions that begin as rounding of zero have
# risen or fallen so much later. Accelerations over LEVEL that are more than rounding then.
LATER, PRESSED = 1e-5, 10.0
# Roundings in a gap, of the sizes of its terms: gaps that are lifted by less have not opened.
ROUNDED = 16.0
# Events in a row without progress in time, beside one for each gap: a chain of openings that follow from each other.
MOST_AT_AN_INSTANT = 100
# Events for each unit, and one more, after which progress is judged: a run that would need CREEPING times as many more
# is ended. Towers with friction take some 300 for each contact until they rest.
EVENTS_JUDGED, CREEPING = 1000, 1e3
# Cosine of the turn of a slip since its phase began, above which the next one keeps its direction; velocity V from
# which on a slip that slows down may turn less and less, over that below which its friction has one direction: the
# force is off by 1e-4 of its turn at V.
SAME_WAY, SLOW = 1.0 - 1e-12, 100.0
# rad: a slip that has turned by more takes its direction anew before it ends; reactions change by as much, of their
# size. Velocity over V that tells it from one that begins.
TURNED, FASTER = 1e-7, 4.0
# By how much the cosine of the turn of a slip that begins is above 1/2 at least, at rest. Share of a slip that its
# event function is at least in the step in which it becomes fast: any above its rounding.
BEGINS, KEPT = 0.49, 0.1

# Of the velocity up to which friction keeps the direction of a slip that begins: what it turns by below is no event.
TURNS = 0.1

# Load of a friction over that up to which it counts as none, from which on it counts.
LOADED = 4.0
# Of the load that counts as none: rounding of reactions, along chains too.
REACTION_NOISE = 1e-3

# Coordinates of all phases of a scene that are kept, at most, and phases at least: memory of runs takes 10 kB for each
# coordinate, 0.7 GB in all.
KEPT_COORDINATES, LEAST_PHASES = 1 << 16, 8
