"""Tuning: convex gain selection, JAYA, feasibility-first comparison, executors."""

from .comparison import Outcome as Outcome
from .executor import Executor as Executor
from .jaya import SearchState as SearchState
from .jaya import start as start
from .jaya import step as step
from .selection import Selection as Selection
from .selection import select as select
