"""Limits of the laws; shares of the largest terms unless a unit is named."""

# A constraint error above this share of the sum of the absolute terms of its row is a wrong result. Terms that are
# themselves rounding count as NEGLIGIBLE of the largest coordinates of their kind in the scene.
ROW_SHARE = 1e-9
# Roundings of positions and of moments about the origin that are allowed: they are differences of large numbers.
ROUNDINGS = 1e5
# Energy less work, momenta, and two methods or forms: this multiple of the tolerance, relative to the motion's size;
# beyond it a run at a TIGHTER tolerance, or of SHORTER fixed steps, must come closer by FALL at least.
MULTIPLE, TIGHTER, SHORTER, FALL = 1e3, 1e-3, 8.0, 0.1
# Below this change relative to the size nothing is judged by convergence: it is rounding, amplified. Of dense output at
# the ends of steps, and of output times beside steps, likewise.
ROUNDED = 1e-10
# Where a motion amplifies rounding: tilt of the gravity, rad, that shows by how much; the share of what it does that
# rounding may do, at so many times. A tilt is some hundred roundings, which all steps have.
TILTED, AMPLIFIED, SEEN = 1e-13, 10.0, 20
# Of the ends of two runs past singular configurations, which amplify rounding; the other branch is off by far more.
NEAR_SINGULAR_ENDS = 1e-4
# Next to a singular configuration, where a chart has a condition of ILL_CONDITIONED or more, rounding is amplified by
# so much.
NEAR_SINGULAR, ILL_CONDITIONED = 1e3, 1e8
# Velocities change by a rounding of positions over the square of the smallest singular value of unit rows; so many
# roundings. Values below NEGLIGIBLE are those of redundant rows.
ROUNDED_ROWS = 10.0
# Outputs of a run that are judged, and bodies whose balance is: the first, the last, and some between.
OUTPUTS, BODIES = 25, 12
# Gaps below zero, of the largest coordinate (m) or in rad; momenta that no impulse explains, of the largest: rounding
# where units of lengths and angles differ by 1e6. Impacts of a run that are judged.
PENETRATED, IMPACTED, IMPACTS = 1e-11, 1e-8, 12
# Friction that is not against the slip, times the slip, of the largest reaction and velocity: slow slips have the
# direction of one shortly before.
RUBBED = 1e-5
