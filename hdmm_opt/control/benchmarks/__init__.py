"""Rivals of the law, one a file: what they command is the acceleration of each joint, on the same inner loops."""

from .rise import Rise as Rise
from .time_delay import TimeDelay as TimeDelay

#: Rivals by name.
RIVALS = {"rise": Rise, "tde-nftsm": TimeDelay}
