"""What a command writes must not be what it reads."""

from collections.abc import Iterable
from pathlib import Path

from serd_cli.errors import UsageError


def require_apart(output: Path, written: Iterable[Path], read: Iterable[str | Path]) -> None:
    """UsageError where a file that --output makes the command write is one that it reads."""
    inputs = {Path(each).resolve() for each in read}
    for path in written:
        if path.resolve() in inputs:
            raise UsageError(
                f"--output must not overwrite what is read, {output} would overwrite {path};"
                " name another file"
            )
