"""Closed-loop simulation: compose, compile, run, measure."""

from .engine import Batch as Batch
from .engine import Engine as Engine
from .loop import ClosedLoop as ClosedLoop
from .loop import Run as Run
from .loop import Trace as Trace
from .metrics import Metrics as Metrics
from .metrics import Yardstick as Yardstick
from .scenario import Fault as Fault
from .scenario import Scenario as Scenario
from .scenario import scenarios as scenarios
from .system import Record as Record
from .system import System as System
from .system import Task as Task
