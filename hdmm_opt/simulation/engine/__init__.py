"""The engine: loops of symbols as machine code for lanes of runs, or interpreted."""

from .engine import Batch as Batch
from .engine import Engine as Engine
from .system import Record as Record
from .system import System as System
from .system import Task as Task
