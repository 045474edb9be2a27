"""`python -m lab bench`: the table of the field and its page."""

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import typer

from lab import RESULTS
from lab.bench.environment import PeerError
from lab.bench.figure import bench_figure
from lab.bench.measure import METHODS, Batch
from lab.bench.page import page, table_of
from lab.bench.tasks import TASKS
from lab.experiments.running.experiment import write_files
from lab.experiments.running.provenance import recorded
from lab.kept import keep
from serd_bag.files import atomic_write_text, require_folder
from serd_bag.nearest import choice_rule
from serd_cli.errors import UsageError
from serd_cli.output.terminal import counting_bar, progress_console, results_kept_in
from serd_core.errors import SerdError

PAGE = Path("docs/bench.md")
QUICK_SEEDS, N_SEEDS = 2, 50
Names = Annotated[list[str] | None, typer.Option(help="only these, may be repeated")]


def bench(
    task: Names = None,
    method: Names = None,
    data: Annotated[Path, typer.Option(help="folder of rust1987, routes, ...")] = Path("data"),
    seeds: Annotated[int, typer.Option(min=1, help="worlds or splits of each size")] = N_SEEDS,
    jobs: Annotated[int, typer.Option(min=1, help="processes at a time")] = 2,
    quick: Annotated[bool, typer.Option("--quick", help="two seeds, page in the output")] = False,
    output: Annotated[Path, typer.Option(help="folder of results")] = RESULTS / "bench",
) -> None:
    """Measure what is missing of ten tasks and all methods, then write the table and its page.

    python -m lab bench --task borders --task hazard --method serd

    An interrupted run goes on where it stopped. The page, docs/bench.md (with --quick bench.md in
    the output), has everything that has been measured so far. lab/bench/recorded.py lists what the
    folder of data holds; tasks without files and libraries that cannot be installed are left out.
    """
    tasks, methods = _chosen(task, TASKS, "a task"), _chosen(method, METHODS, "a method")
    require_folder(output)
    n_seeds = QUICK_SEEDS if quick else seeds
    work, results = output / "cases", data.resolve()
    words = f"python -m lab bench --seeds {n_seeds} --data {data.name}"
    with recorded(output, words, {"tasks": tasks, "methods": methods, "seeds": n_seeds}):
        absent = _measured(
            [Batch(t, METHODS[m], n_seeds, results, work) for t in tasks for m in methods],
            jobs,
            output,
        )
    rows = {
        t: {m: found for m in METHODS if (found := Batch(t, METHODS[m], 0, data, work).rows())}
        for t in TASKS
    }
    table = table_of(rows)
    if table.empty:
        raise SerdError("a task must have files and a method that states it, got none; add some")
    write_files(output, {"bench.csv": table, "bench.png": bench_figure(table)})
    target, folder = (output / "bench.md", "") if quick else (PAGE, "results/")
    atomic_write_text(target, page(rows, absent, folder))
    print(f"table: {output / 'bench.csv'}\npage: {target}")
    if not quick and output == RESULTS / "bench":
        keep()


def _chosen(names: list[str] | None, known: Iterable[str], what: str) -> list[str]:
    for name in names or ():
        if name not in known:
            raise UsageError(choice_rule(what, name, known))
    return list(names or known)


def _measured(batches: Sequence[Batch], jobs: int, output: Path) -> dict[str, str]:
    """Run the batches; why tasks and methods are left out, by name."""
    absent: dict[str, str] = {}
    total = sum(len(batch.missing()) for batch in batches)
    with results_kept_in(output), counting_bar("bench") as bar, ThreadPoolExecutor(jobs) as pool:
        shown = bar.add_task("", total=total)

        def attempt(batch: Batch) -> None:
            if batch.task in absent or batch.method.name in absent:
                return
            try:
                batch.run(lambda: bar.advance(shown))
            except SerdError as error:
                _note(absent, batch.task, str(error))
            except PeerError as error:
                _note(absent, batch.method.name, str(error))

        try:
            for _ in pool.map(attempt, batches):
                pass
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return absent


def _note(absent: dict[str, str], name: str, reason: str) -> None:
    if name not in absent:
        absent[name] = reason
        progress_console.print(f"{name} is left out: {reason}", soft_wrap=True)
