"""hdmm-opt: optimization-centred design of controllers for heavy-duty mobile machines.

The verbs as functions: `load_study, design, check, simulate, falsify, compare, sweep, tradeoff, report`.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .library import check as check
    from .library import compare as compare
    from .library import design as design
    from .library import falsify as falsify
    from .library import load_study as load_study
    from .library import report as report
    from .library import simulate as simulate
    from .library import sweep as sweep
    from .library import tradeoff as tradeoff

#: What is imported with the first use, so that importing the package costs nothing.
VERBS = ("load_study", "design", "check", "simulate", "falsify", "compare", "sweep", "tradeoff", "report")


def __getattr__(name: str) -> Any:
    if name not in VERBS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(".library", __name__), name)


def __dir__() -> list[str]:
    return [*globals(), *VERBS]
