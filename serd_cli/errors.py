"""The command line's errors; exit codes: 0 done, 1 a run failed, 2 bad usage or input."""

from serd_core.errors import SerdError

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130


class UsageError(SerdError):
    """What was typed cannot be done; the sentence says what can."""


class RunError(SerdError):
    """A process or a step failed; the sentence says which and why.

    exit_code: FAILED, or BAD_INPUT where a process said that its input was bad.
    """

    def __init__(self, sentence: str, exit_code: int = FAILED) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code
