"""Exit statuses, and the name under which `--quiet` is kept."""

#: Proved or done; not proved or a requirement missed; misuse or unreadable input; interrupted.
PROVED, NOT_PROVED, MISUSE, INTERRUPTED = 0, 1, 2, 130
QUIET = "hdmm_opt.quiet"
