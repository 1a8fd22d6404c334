"""What every certificate says, and why there may be none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """Numbers that certify a closed loop, before the exact check.

    Attributes:
        decay: Rate at which what lies outside the ultimate set shrinks, 1/s.
        half_widths: Assumed box. Shape (n,).
        input_bound: Assumed bounds on the input errors or held inputs. Shape (m,).
        ultimate: Certified bounds from the end of the transient on, the first on the tracking error. Shape (n,).
        effort: Bounds on the commanded inputs. Shape (m,).
        states: Bounds on |x_i|. Shape (n,).
    """

    decay: float
    half_widths: Array
    input_bound: Array
    ultimate: Array
    effort: Array
    states: Array


@dataclass(frozen=True, kw_only=True)
class Failure:
    """Why no certificate was found.

    Attributes:
        reason: One line.
        row: Index of the subsystem at which the conditions break, where one can be named.
        margin: How much more decay that row would need, 1/s; negative, -inf where nothing could be bounded.
        together: Whether every member of a machine is proved by itself, and only all together are not.
    """

    reason: str
    row: int | None = None
    margin: float = -np.inf
    together: bool = False
