"""Many episodes over many processes, resumable, one row of a CSV file per episode.

Rows are written as they come; a run that is started again skips the episodes whose rows are there.
An episode's result depends on its task only, not on the process or the order.
"""

import csv
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Any

from sim.drivers import make_driver
from sim.episode import run_episode
from sim.episode_metrics import MetricsObserver
from sim.errors import SimError
from sim.planners import make_planner
from sim.scenario import Scenario, load_scenario
from sim.world import HallwayWorld

Row = dict[str, Any]


@dataclass(frozen=True)
class EpisodeTask:
    """What defines one episode. n_people: the scenario's own number when None.

    driver: a name of `sim.drivers`.
    """

    scenario: str
    seed: int
    episode: int = 0
    n_people: int | None = None
    start_area: str = "train"
    planner: str = "dwa"
    driver: str = "expert_with_flow"

    @property
    def key(self) -> tuple[str, ...]:
        """The task as the strings that stand in its row."""
        return tuple(_text(getattr(self, each.name)) for each in fields(self))


TASK_COLUMNS = tuple(each.name for each in fields(EpisodeTask))


def run_task(task: EpisodeTask) -> Row:
    """Run one episode; its row."""
    scenario = _scenario(task.scenario, task.n_people)
    observer = MetricsObserver(scenario)
    with HallwayWorld(scenario, seed=task.seed) as world:
        record = run_episode(
            world,
            make_planner(task.planner, scenario),
            make_driver(task.driver, scenario, task.seed),
            episode=task.episode,
            start_area=task.start_area,
            observer=observer.see,
        )
    return {
        **{name: getattr(task, name) for name in TASK_COLUMNS},
        "outcome": record.outcome,
        "time_of_arrival_s": record.time_of_arrival_s,
        "duration_s": record.duration_s,
        "distance_m": record.distance_m,
        "n_decisions": len(record.decisions),
        "minimum_person_distance_m": record.minimum_person_distance_m,
        **asdict(record.contacts),
        **asdict(observer.metrics),
    }


def run_batch(
    tasks: Iterable[EpisodeTask],
    path: str | Path,
    *,
    n_processes: int | None = None,
    executor: Executor | None = None,
    on_progress: Callable[[int, int], None] | None = None,
) -> list[Row]:
    """Rows of all tasks, from the file where they are there already, else run and appended to it.

    on_progress: called with (done, all) after every episode. n_processes: all cores when None; 1
    runs in this process. executor: runs the episodes instead; anything with the interface of
    concurrent.futures, such as joblib's loky executor or that of a Dask client.
    """
    wanted = list(tasks)
    table = _Table(Path(path))
    missing = [task for task in dict.fromkeys(wanted) if task.key not in table.rows]
    done, total = len(wanted) - len(missing), len(wanted)
    for row in _results(missing, n_processes, executor):
        table.append(row)
        done += 1
        if on_progress is not None:
            on_progress(done, total)
    return [table.rows[task.key] for task in wanted]


def _results(
    tasks: list[EpisodeTask], n_processes: int | None, executor: Executor | None
) -> Iterator[Row]:
    if executor is not None:
        yield from _as_completed(executor, tasks)
        return
    workers = min(n_processes or os.cpu_count() or 1, len(tasks))
    if workers <= 1:
        yield from map(run_task, tasks)
        return
    # Spawned, not forked: a fork would share PyBullet's connections with the parent.
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_end_with_parent) as pool:
        yield from _as_completed(pool, tasks)


def _as_completed(executor: Executor, tasks: list[EpisodeTask]) -> Iterator[Row]:
    futures = [executor.submit(run_task, task) for task in tasks]
    try:
        for future in as_completed(futures):
            yield future.result()
    finally:
        # After an error or Ctrl-C the episodes not yet begun are not run.
        for future in futures:
            future.cancel()


def _end_with_parent() -> None:
    """End this worker when the process that started it is gone, however that ended."""
    Thread(target=_wait_for_parent, daemon=True).start()


def _wait_for_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class _Table:
    """A CSV file of rows by task; a last line cut short by a crash is dropped."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.rows: dict[tuple[str, ...], Row] = {}
        self._columns: list[str] | None = None
        if path.exists():
            self._read()

    def append(self, row: Row) -> None:
        is_new = self._columns is None
        if self._columns is None:
            self._columns = list(row)
        text = {name: _text(value) for name, value in row.items()}
        with self._path.open("a", newline="") as file:
            writer = csv.DictWriter(file, self._columns, lineterminator="\n")
            if is_new:
                writer.writeheader()
            writer.writerow(text)
        self.rows[tuple(text[name] for name in TASK_COLUMNS)] = _typed(text)

    def _read(self) -> None:
        whole = self._path.read_text().splitlines(keepends=True)
        kept = [line for line in whole if line.endswith("\n")]
        if len(kept) < len(whole):
            self._path.write_text("".join(kept))
        reader = csv.DictReader(kept)
        if reader.fieldnames is None:
            return
        self._columns = list(reader.fieldnames)
        missing = [name for name in TASK_COLUMNS if name not in self._columns]
        if missing:
            raise SimError(
                f"{self._path} must be a table of episodes, but has no column {missing[0]!r}"
                "; choose another file"
            )
        for text in reader:
            self.rows[tuple(text[name] for name in TASK_COLUMNS)] = _typed(text)


def _typed(text: dict[str, str]) -> Row:
    """Numbers as numbers, an empty field as None."""
    return {name: _value(value) for name, value in text.items()}


def _value(text: str) -> Any:
    if text == "":
        return None
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text


def _text(value: object) -> str:
    return "" if value is None else str(value)


@lru_cache(maxsize=32)
def _scenario(name: str, n_people: int | None) -> Scenario:
    scenario = load_scenario(name)
    return scenario if n_people is None else scenario.with_pedestrian_count(n_people)
