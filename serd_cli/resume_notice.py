"""What a command says of work that is kept: where it is, and which code it is by."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.running.provenance import other_commits
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


def remark_other_code(folder: Path) -> None:
    """Say where work is taken over that another version of the code may have done otherwise."""
    if commits := other_commits(folder):
        progress_console.print(
            f"{folder} holds work of {', '.join(each[:7] for each in commits)}, which is kept;"
            " delete the folder to make all of it with the present code",
            style="yellow",
            soft_wrap=True,
            markup=False,
        )
