"""Numbers and addresses of an implicit method's stages, in its `ImplicitWorkspace`."""

from ..jit.kernels import Record


class StageNumbers(Record):
    """Settings of the stages' Newton iteration, and what it knows from one stage to the next."""

    rtol: float
    atol: float
    kappa: float  # error norm that the iteration of a stage may leave
    slips: int  # whether there is friction, and so velocities of stages are predicted
    g: float  # h a_ii of the factors in P; 0 where there are none
    chart: int  # counter of charts when P was made, for a form whose P serves one chart only
    every_chart: int  # 1 for one whose P serves every chart
    known: int  # whether there are stiffness and damping
    left: float  # error norm after a first correction as last measured, growing with every stage since
    first: float  # size of that correction
    slow: float  # contraction above which P is rebuilt, if no new one contracts below the usual limit; else 0
    t_before: float  # s, start of the last step; -inf for the first one
    eager: int  # stages that are still to be begun with a matrix of their own
    rates_of: int  # counter of charts when z of the stages was last set; 0 where z and multipliers are unknown
    time: float  # s, of the last stage, and of the one before; -inf where they are unknown
    time_before: float
    lag: float  # contraction of corrections by factors of N of an older configuration, as last measured
    fresh: int  # 1 if the derivatives of the forces' laws are to be taken by saddle_point.reduce


class StageIteration(Record):
    """Newton's iteration of one stage: its limits, and what its corrections have shown so far."""

    floor: float  # error norm of a correction that is rounding
    limit: float  # contraction above which the matrix is renewed
    before: float  # error norm of the correction before, by the same matrix; inf for none
    theta: float  # contraction: the last one measured, or assumed
    measured: int  # whether it has been measured
    first: float  # size of the first correction, and of what it left; inf where that is unknown
    second: float
    trusted: int  # whether this stage's first correction leaves what those before it have left
    renewed: int  # whether the matrix was renewed in this stage
    poor: int  # matrices that were renewed for poor contraction
    diverged: int  # iterations that diverged with a new matrix
    eager: int  # whether the stage begins with a matrix of its own


class StageKernels(Record):
    """Addresses of the kernels in formulations/linearisation.py or saddle_point.py, of `recall`, of the error norm.

    `residual`, `correct` and `distance` are those of stage_equations.py; 0 for a form without them.
    """

    linearise: int
    reduce: int
    factorise: int
    solve: int
    soften: int
    recall: int
    error_norm: int
    residual: int
    correct: int
    distance: int
    take_stage: int  # those of coupled_stages.py: take_stage to solve_stages
    balance_stage: int
    factorise_stages: int
    solve_stages: int
