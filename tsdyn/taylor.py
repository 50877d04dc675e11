"""The driver of the Taylor integrator: series, step length, landing; one kernel for every scene."""

import math
from typing import NamedTuple

import numpy as np

from ._four import four, put, splat, times
from ._kernel import entry, kernel
from .assembly import applied_forces, remember, set_time
from .body_loops import OMEGA_ROW
from .chart import AT_START, BY_SERIES
