"""Plants: one machine a file."""

from .parameter import SOURCES as SOURCES
from .parameter import Parameter as Parameter
from .plant import Limit as Limit
from .plant import Plant as Plant
from .pmsm_emla import EFFORTS as EFFORTS
from .pmsm_emla import defaults as defaults
from .pmsm_emla import effort as effort
from .pmsm_emla import pmsm_emla as pmsm_emla
