"""Taylor steps of several cases at once: a case a lane of SIMD registers.

Imports taylor and below. The kernels of one case are compiled once more, for arrays of lanes (jit/lanes.py). A lane
that meets anything unusual is given up, and its case is run alone.

Begin with stepper.py, a step of all lanes. context.py has the memory and the state of each lane, kinds.py the loops of
constraints and forces, sums.py what is summed otherwise; step_length.py, step_end.py and landing.py have masks in place
of branches.
"""
