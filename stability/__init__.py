"""Stability: bounds, gain conditions and certificates of strict-feedback loops, and their stand-alone checker."""

from .arrays import enclose_many as enclose_many
from .arrays import tangents_many as tangents_many
from .certificate import Certificate as Certificate
from .certificate import Failure as Failure
from .composition import Composition as Composition
from .composition import certify as certify
from .deviation import DeviationRows as DeviationRows
from .deviation import deviation_rows as deviation_rows
from .expression import Expression as Expression
from .expression import algebraic as algebraic
from .expression import enclose as enclose
from .expression import from_casadi as from_casadi
from .interval import Interval as Interval
from .model import Bounds as Bounds
from .model import Gains as Gains
from .model import LoopModel as LoopModel
from .model import Row as Row
from .rows import ErrorRows as ErrorRows
from .rows import error_rows as error_rows
from .sampled import Sampled as Sampled
from .sampled import certify_sampled as certify_sampled
