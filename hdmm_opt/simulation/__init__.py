"""Closed-loop simulation: compose, run, measure."""

from .loop import ClosedLoop as ClosedLoop
from .loop import Trace as Trace
from .metrics import Metrics as Metrics
from .metrics import measure as measure
from .scenario import Scenario as Scenario
from .scenario import scenarios as scenarios
