"""Errors that a caller can act on. Not finding a plan is an answer, never an error."""


class SashimonoError(Exception):
    """Base of every error that Sashimono raises on purpose.

    The message is one line: what is wrong, where, and the way out. The command
    line prints it to standard error and exits with status 2.
    """


class InputError(SashimonoError):
    """A file or folder that cannot be used as an assembly."""


class PlanFormatError(SashimonoError):
    """A plan file that does not follow the plan.json contract."""
