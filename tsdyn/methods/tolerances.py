"""Thresholds of methods: order conditions, and Newton's iteration of an implicit stage (diagonally_implicit.py).

Sizes of corrections are error norms: 1 is the step's tolerance. Contraction is the ratio of two such sizes in a row.
"""

# Corrections of a stage at most: as many as KAPPA takes at a contraction of 0.7, and some after a new matrix. With
# fixed steps, which can't be shortened, as many as rounding takes at a contraction of 0.4.
ITERATIONS, FIXED_ITERATIONS = 20, 40

# Error norm that a stage's iteration may leave. Hairer and Wanner, Solving ODEs II, IV.8, take 0.01 to 0.1 for Radau;
# a run adds up the residuals of as many stages as it has, and a thousandth of a step's error stays below its estimate.
# In the tangent form three thousandths leave the errors of stiff chains, linkages and of the governor as they are; a
# hundredth shows in the number of steps at the loosest tolerances.
KAPPA, KAPPA_SPARSE = 1e-3, 3e-3

# The least that it may leave. m/s, of a velocity where there is friction: at rest friction balances the loads at some
# velocity below the slip velocity, 1e-11 m/s at least, so the error changes the friction by a hundredth of it. And rtol
# and atol with a fixed step, where no tolerance sets the step: what is left of the stages of thousands of steps adds
# up, to 1e-10 of a driven pendulum at 1e-12, while a matrix serves across charts.
LEAST_LEFT = 1e-13

# Contraction above which the iteration matrix is rebuilt: up to it three corrections reach KAPPA
# (docs/design-decisions.md, one Jacobian for many steps; benchmarks/stiff.py counts matrices).
# The matrix of the tangent form costs as much as eight iterations: kept up to SLOW_SPARSE, a quarter as many matrices
# take a fifth more iterations in stiff chains and joints than with SLOW_DENSE.
SLOW_DENSE, SLOW_SPARSE = 0.1, 0.25

# Contraction assumed where none has been measured, and the least that a measurement is trusted with: with fixed steps
# what stages leave adds up over thousands of them.
GUESS, LEAST, LEAST_FIXED = 0.3, 1e-6, 0.02

# A new measurement lowers the known contraction by this factor at most: a stage may converge by chance. Growth of an
# old contraction from stage to stage, until it is measured again.
FORGET, AGEING = 0.1, 1.3

# Stages that a prediction interpolates: least distance in time, over the longer of the two steps; distance of two equal
# times, over the step or the sampling period, computed in two ways.
APART_AT_LEAST, SAME_TIME = 0.1, 1e-9

# Contraction above which an iteration counts as diverging.
DIVERGING = 0.9

# New matrices within one stage, of which the last has new stiffness and damping; diverging iterations, all with a new
# matrix, with which a stage is given up. Where friction breaks loose, corrections grow from slip velocities of 1e-9 m/s
# to the velocities of the motion, by the power of three each, before they contract.
MATRICES, APART, APART_SLIPPING = 3, 3, 8

# Contraction over that of a matrix with new stiffness and damping, above which the matrix is rebuilt in the tangent
# form: if bodies rotate far within a step, no matrix contracts below SLOW_SPARSE.
WORSE_CONTRACTION = 2.0

# Stages that begin with a matrix of their own after an older one has failed: five steps of SDIRK54. In the tangent form
# one stage, but one step where iterations diverged: matrices of overdamped springs that turn serve one stage only.
EAGER_STAGES, EAGER_SPARSE, EAGER_LOST = 30, 1, 6

# Relative change of g = h a_ii, or of h, up to which the factors of P are tried again. A damped stiff mode contracts by
# |1 - g / g_P|, so the first correction of a stage is nearly always good enough: chains take half the iterations that
# they take with 0.3, with 0.1 or 0.005 10 or 2 % more. With 0.3 the null-space form takes a sixth more steps, too: the
# error estimate is filtered by the same factors.
SAME_STEP = 0.02

# Correction, relative to 1 + size, that is rounding of v and vd: 18 units in the last place of f evaluated by a
# factorised matrix. Residuals within ROUNDING_AT_MOST of it that no longer contract are rounding, too.
RESIDUAL_FLOOR = 4e-15

# Distance of a stage's positions from their prediction, relative to 1 + size: a solution further away may be another
# one of the nonlinear equations.
FAR_STAGE = 0.1

# --- collocation methods: all stages at once (collocation_step.py) ---
# Corrections at most; contraction from which the next step has new matrices, and from which stages don't count as
# solved before matrices have had new derivatives.
COUPLED_ITERATIONS, SLOW_COUPLED, TRUSTED = 12, 0.1, 0.3

# The least contraction that is trusted where there is friction. Measured is that of what moves far; a joint that is
# about to break loose loses its stiffness, and contracts by 0.9 with an older matrix. 1e-3 to 0.1 serve alike, 0.3
# takes 5 % more iterations.
LEAST_SLIPPING = 0.1

# Corrections that no longer contract, relative to 1 + size: below it they are rounding of large forces.
STALLED_CORRECTION = 2e-12
