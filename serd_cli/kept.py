"""What an interrupted command says: where its work is, and that the same command goes on."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from serd_cli.terminal import progress_console


@contextmanager
def kept_in(place: Path | None) -> Iterator[None]:
    """Say at Ctrl-C that the folder or table keeps what is done; nothing without it."""
    try:
        yield
    except KeyboardInterrupt:
        if place is not None and place.exists():
            progress_console.print(
                f"kept in {place.resolve()}; the same command goes on", soft_wrap=True, markup=False
            )
        raise
