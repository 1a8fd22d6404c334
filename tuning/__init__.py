"""Tuning: JAYA, TLBO, random search, gradients, Pareto sets, executors."""

from .budget import Budget as Budget
from .comparison import Outcome as Outcome
from .executors.choose import executor as executor
from .executors.executor import Executor as Executor
from .methods.gradient import Derivatives as Derivatives
from .methods.gradient import descend as descend
from .methods.pareto import front as front
from .methods.pareto import pareto_jaya as pareto_jaya
from .population import Population as Population
from .population import start as start
from .search import METHODS as METHODS
from .search import Best as Best
from .search import best_of as best_of
from .search import search as search
