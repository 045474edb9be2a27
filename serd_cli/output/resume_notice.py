"""Notices about results that remain on disk where a run is interrupted."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from serd_cli.output.terminal import counting_bar, progress_console
from serd_files.row_table import Row
from serd_sim.episodes.batch import Progress


@contextmanager
def results_kept_in(place: Path | None) -> Iterator[None]:
    """At Ctrl-C, print where the finished results are; place: None for none."""
    try:
        yield
    except KeyboardInterrupt:
        if place is not None and place.exists():
            progress_console.print(
                f"results are in {place.resolve()}; rerun the command to resume", soft_wrap=True
            )
        raise


def run_episodes(output: Path, run: Callable[[Progress], list[Row]]) -> list[Row]:
    """The rows of `run`, with a bar of its episodes; their table `output` remains at Ctrl-C."""
    with results_kept_in(output), counting_bar("episodes") as bar:
        line = bar.add_task("", total=None, visible=False)
        return run(lambda done, total: bar.update(line, completed=done, total=total, visible=True))
