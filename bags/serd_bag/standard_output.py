"""What a command prints: a full disk behind it is one sentence, a reader that ended is no error."""

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from serd_bag.errors import FileError, disk_errors

#: Of what is printed; opening a file fails with its name.
_OUTPUT_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
#: Of a path that no file can have.
_PATH_ERRORS = (errno.ENAMETOOLONG, errno.ELOOP)


@contextmanager
def written_output() -> Iterator[None]:
    """Write what is printed within, until its reader ends; FileError where that is not possible.

    A command that is done keeps its exit code where the reader of its output has ended; one that
    cannot write any more ends with 0, also where click would end it with 1.
    """
    if sys.stdout is None:
        raise FileError("the output must be open, got a closed one; redirect it to /dev/null")
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except BrokenPipeError as error:
        _drop()
        if isinstance(error.__context__, SystemExit):
            raise error.__context__ from None
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):
            _drop()
            raise SystemExit(0) from None
        raise
    except OSError as error:
        if error.errno in _PATH_ERRORS:
            with disk_errors("use", Path(os.fsdecode(error.filename))):
                raise
        if error.errno not in _OUTPUT_ERRORS:
            raise
        _drop()
        with disk_errors("write", Path("the output")):
            raise


def _drop() -> None:
    """Nothing that is buffered is written at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
