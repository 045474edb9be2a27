"""Notices about results that remain on disk: where they are, and which code made them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.running.provenance import other_commits
from serd_cli.output.terminal import progress_console


@contextmanager
def results_kept_in(place: Path | None) -> Iterator[None]:
    """At Ctrl-C, print where the finished results are; place: None for none."""
    try:
        yield
    except KeyboardInterrupt:
        if place is not None and place.exists():
            progress_console.print(
                f"results are in {place.resolve()}; rerun the command to resume",
                soft_wrap=True,
                markup=False,
            )
        raise


def remark_other_code(folder: Path) -> None:
    """Print a warning where a folder holds results of another version of the code."""
    if commits := other_commits(folder):
        progress_console.print(
            f"{folder} holds results of {', '.join(each[:7] for each in commits)}, which are kept;"
            " delete the folder to make all of them with the present code",
            style="yellow",
            soft_wrap=True,
            markup=False,
        )
