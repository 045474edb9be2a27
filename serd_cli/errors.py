"""The command line's errors; exit codes as in DESIGN: 1 a run failed, 2 bad usage or input."""

from serd_core.errors import SerdError

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130


class UsageError(SerdError):
    """What was typed cannot be done; the sentence says what can."""


class RunError(SerdError):
    """A process or a step failed; the sentence says which and why."""
