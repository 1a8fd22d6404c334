"""The verbs as functions, for notebooks and scripts: `import hdmm_opt as h; h.design(h.load_study("emla-p2"))`."""

from .designing import compare as compare
from .designing import design as design
from .designing import sweep as sweep
from .designing import tradeoff as tradeoff
from .proving import check as check
from .proving import falsify as falsify
from .proving import report as report
from .proving import simulate as simulate
from .studies import load_study as load_study
