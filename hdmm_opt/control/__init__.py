"""Control laws: one law, observer or supervisor a file."""

from .law import GainSpec as GainSpec
from .law import Law as Law
from .law import ProvableLaw as ProvableLaw
from .modelling import MODELLING as MODELLING
from .rac import RAC as RAC
