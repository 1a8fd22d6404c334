"""What goes wrong, by who can mend it."""


class InvalidInputError(Exception):
    """Bad input: one line with the rule, what came, and what would do. Exit status 2."""


class DefectError(Exception):
    """A simulation left its certified envelope: the toolkit is wrong, and must say so and stop. Exit status 1."""
