"""Exit statuses."""

#: Proved or done; not proved or a requirement missed; misuse or unreadable input; interrupted.
PROVED, NOT_PROVED, MISUSE, INTERRUPTED = 0, 1, 2, 130
