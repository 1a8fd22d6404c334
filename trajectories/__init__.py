"""Trajectories: splines, quintic moves, direct collocation, and limits that hold for all t."""

from .collocation import OBJECTIVES as OBJECTIVES
from .collocation import Motion as Motion
from .collocation import Task as Task
from .collocation import solve as solve
from .limits import LimitViolatedError as LimitViolatedError
from .limits import MotionLimits as MotionLimits
from .limits import effort_peaks as effort_peaks
from .limits import violations as violations
from .quintic import quintic as quintic
from .quintic import shortest_duration as shortest_duration
from .reference import Reference as Reference
from .spline import Spline as Spline
from .spline import constant as constant
