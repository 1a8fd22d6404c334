"""Stability: bounds, gain conditions and certificates of strict-feedback loops, and their stand-alone checker."""

from .certificates.certificate import Certificate as Certificate
from .certificates.certificate import Failure as Failure
from .certificates.composition import Composition as Composition
from .certificates.composition import certify as certify
from .certificates.impulse import Impulse as Impulse
from .certificates.impulse import certify_impulse as certify_impulse
from .enclosures.arrays import enclose_many as enclose_many
from .enclosures.arrays import tangents_many as tangents_many
from .enclosures.expression import Expression as Expression
from .enclosures.expression import enclose as enclose
from .enclosures.interval import Interval as Interval
from .enclosures.translation import algebraic as algebraic
from .enclosures.translation import from_casadi as from_casadi
from .loops.box import Box as Box
from .loops.box import DeviationRows as DeviationRows
from .loops.deviation import deviation_rows as deviation_rows
from .loops.deviation import first_box as first_box
from .loops.model import Bounds as Bounds
from .loops.model import Gains as Gains
from .loops.model import LoopModel as LoopModel
from .loops.model import Row as Row
from .loops.observer import Observer as Observer
from .loops.rows import ErrorRows as ErrorRows
from .loops.rows import error_rows as error_rows
