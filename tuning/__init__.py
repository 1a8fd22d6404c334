"""Tuning: convex gain selection, JAYA, TLBO, random search, gradients, Pareto sets, executors."""

from .budget import Budget as Budget
from .comparison import Outcome as Outcome
from .executor import Executor as Executor
from .executor import executor as executor
from .gradient import Derivatives as Derivatives
from .gradient import descend as descend
from .pareto import front as front
from .pareto import pareto_jaya as pareto_jaya
from .population import Population as Population
from .population import start as start
from .search import METHODS as METHODS
from .search import Best as Best
from .search import best_of as best_of
from .search import search as search
from .selection import Selection as Selection
from .selection import select as select
