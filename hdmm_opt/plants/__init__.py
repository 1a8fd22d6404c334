"""Plants: one actuator a file."""

from .parameter import EFFECTIVENESS as EFFECTIVENESS
from .parameter import SOURCES as SOURCES
from .parameter import Parameter as Parameter
from .parameter import effectiveness as effectiveness
from .parameter import healthy as healthy
from .plant import Efforts as Efforts
from .plant import Limit as Limit
from .plant import Plant as Plant
from .pmsm_emla import defaults as defaults
from .pmsm_emla import effort as effort
from .pmsm_emla import pmsm_emla as pmsm_emla
