"""Ctrl-C while a program is still being imported ends it without a word: nothing has begun.

Python would raise in the midst of an import, and print all that led to it.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: Exit code of a program that Ctrl-C ended, as shells have it.
INTERRUPTED = 130


@contextmanager
def starting() -> Iterator[None]:
    """Within it SIGINT ends the process at once; for the main thread."""
    before = signal.signal(signal.SIGINT, _end_at_once)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _end_at_once(_: int, __: FrameType | None) -> None:
    os._exit(INTERRUPTED)
