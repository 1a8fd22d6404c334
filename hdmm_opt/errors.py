"""What goes wrong, by who can mend it."""


class InvalidInputError(Exception):
    """Bad input: one line with the rule, what came, and what would do. Exit status 2."""
