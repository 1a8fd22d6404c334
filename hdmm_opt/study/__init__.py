"""Study files: what to design, for which machine, under which assumptions."""

from .read import bundled as bundled
from .read import load as load
from .read import parse as parse
from .read import validated as validated
from .study import Study as Study
