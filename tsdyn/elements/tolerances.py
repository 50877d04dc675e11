"""Limits of bodies, markers and compiled loops, each with its unit and where it comes from."""

from ..maths.tolerances import COMPLEX_STEP

# Largest numbers whose squares are numbers: m, of a point; kg, and kg m^2 of the largest moment of inertia.
SQUARABLE = 1e150

# | |p| - 1 | of Euler parameters as they are given: those written with seven digits pass, degrees in place of radians
# do not. They are made of unit length afterwards. Of A^T A - I of a rotation matrix likewise.
UNIT_LENGTH = 1e-6

# Sine of an angle. Of a reference the part across an axis gives a direction; at 1e-6 ten digits of it are left.
PARALLEL = 1e-6
# The same for a direction that is found, not given: seven digits suffice to count turns by, and for the lowest point of
# a disc. Also 1 + cosine of two axes, below which they are opposed, and the least turn from one to the other is not
# unique.
UNDIRECTED = 1e-9

# Complex step of constraints, in which no squares of small numbers count; of forces it is COMPLEX_STEP of maths.
CONSTRAINT_STEP = 1e-100
# Of central differences of fourth order, relative to x: the fifth root of the rounding error, their optimum.
FORCE_QUOTIENT = 7e-4

# Series of forces against their laws (loops/law_check.py). OFF: what sharp ones may be off by, as a velocity over the
# tolerance of a step. OFF_SELDOM: the same of laws that are analytic but at few places; flights past the anchor of a
# spring are off by twice the tolerance at most at 200, as at 20, and by forty times at 1000. LAW_TOLERANCE: as a share
# of the velocity of its point, below which terms that cancel within a law count.
OFF, OFF_SELDOM, LAW_TOLERANCE = 2000.0, 200.0, 1e-12

# m/s and rad/s: velocity of the exact law below which the direction of sliding is kept; way and time of a stop from
# there are rounding. The default slip velocity of a friction plug-in without an exact law, with 71% of the friction.
SLIP = 1e-9
# The least that acts, m/s and rad/s: iterations of stages leave 1e-13 of velocities; less than a hundred times that is
# noise.
LEAST_SLIP = 1e-11
# N^2 and (N m)^2: added to the squares of parts of a reaction. A complex step leaves -COMPLEX_STEP^2 of one that is
# zero.
LEAST_SQUARE = 4.0 * COMPLEX_STEP**2
