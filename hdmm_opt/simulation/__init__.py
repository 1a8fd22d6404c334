"""Closed-loop simulation: compose, compile, run, measure."""

from .batch import Run as Run
from .figures import Figures as Figures
from .loop import Loop as Loop
from .scenario import Fault as Fault
from .scenario import Scenario as Scenario
from .scenario import rated as rated
from .scenario import scenarios as scenarios
from .scenario import within_assumptions as within_assumptions
from .trace import Trace as Trace
