"""A study made concrete: members, assumptions, margins, verdicts."""

from .build import assemble as assemble
from .member import GainRange as GainRange
from .member import Member as Member
from .problem import GainSet as GainSet
from .problem import Problem as Problem
