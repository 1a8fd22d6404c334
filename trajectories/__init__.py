"""Trajectories: splines, quintic moves, direct collocation, and limits that hold for all t."""

from .bezier import Pieces as Pieces
from .bezier import pieces as pieces
from .collocation import Motion as Motion
from .collocation import solve as solve
from .guess import Guess as Guess
from .limits import LimitViolatedError as LimitViolatedError
from .limits import MotionLimits as MotionLimits
from .limits import violations as violations
from .quantity import Peaks as Peaks
from .quantity import Quantities as Quantities
from .quantity import peaks as peaks
from .quintic import quintic as quintic
from .quintic import shortest_duration as shortest_duration
from .reference import Reference as Reference
from .spline import Spline as Spline
from .spline import constant as constant
from .task import Cost as Cost
from .task import Task as Task
from .task import Waypoint as Waypoint
