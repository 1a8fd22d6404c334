"""Control laws: one law a file."""

from .rac import MODELLING as MODELLING
from .rac import RAC as RAC
from .rac import gain_columns as gain_columns
