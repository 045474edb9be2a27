"""The command line's errors; exit codes: 0 done, 1 a run failed, 2 bad usage or input."""

from serd_core.errors import SerdError

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130


class UsageError(SerdError):
    """The command line is invalid; the message names the fix."""


class RunError(SerdError):
    """A process or a step failed; the message names it and the reason.

    exit_code: FAILED, or BAD_INPUT where a process reported bad input.
    """

    def __init__(self, sentence: str, exit_code: int = FAILED) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code

    def __str__(self) -> str:
        """The message with the line ends of a process's output."""
        return ValueError.__str__(self)
