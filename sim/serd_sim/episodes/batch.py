"""Many episodes over many processes, resumable, one row per episode in a CSV or Parquet file.

Rows are written as episodes end; a run that is started again skips the episodes that have a row.
An episode's result depends on its task only, not on the process or the order. Scenario and model
files may change between runs: each row holds their digest, which must be the same.
"""

import hashlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, fields, replace
from math import isnan, nan
from pathlib import Path
from statistics import fmean
from typing import Any, TypeVar

from serd_bag.files import read_text
from serd_core.arrival.law import clopper_pearson
from serd_files.table import Column, Key, Row, RowTable, cell_text, columns_of
from serd_sim.drivers.catalogue import MODEL_SUFFIXES, make_driver
from serd_sim.episodes.episode import run_episode
from serd_sim.episodes.execution import Execution
from serd_sim.episodes.metrics import EpisodeMetrics, MetricsObserver
from serd_sim.errors import SimError
from serd_sim.perception.scanning_planner import planner_in_world, require_people_source
from serd_sim.planning.local_planner import make_planner
from serd_sim.robot.robot import ContactCounts
from serd_sim.safety.world_guard import no_guard
from serd_sim.scenario.grid import grid_of, start_states_of
from serd_sim.scenario.scenario import Scenario, load_scenario, scenario_content
from serd_sim.world.world import HallwayWorld

Progress = Callable[[int, int], None]

AnyTask = TypeVar("AnyTask", bound="EpisodeTask")
#: Column of the digest of all files that an episode depends on.
INPUTS = "inputs"


@dataclass(frozen=True)
class EpisodeTask:
    """What defines one episode. n_people: the scenario's own number when None.

    driver: a name of `serd_sim.drivers.catalogue` or the file of a learned model. people_from: one
    of `PEOPLE_SOURCES`. guarded: 0 for a robot without the guard.
    """

    scenario: str
    seed: int
    episode: int = 0
    n_people: int | None = None
    start_area: str = "train"
    driver: str = "expert_with_flow"
    people_from: str = "given"
    guarded: int = 1

    @property
    def key(self) -> Key:
        """The task as the texts of its cells."""
        return tuple(cell_text(getattr(self, each.name)) for each in fields(self))


TASK_COLUMNS = tuple(each.name for each in fields(EpisodeTask))
COLUMNS = (
    *columns_of(EpisodeTask),
    Column(INPUTS, str),
    Column("outcome", str),
    Column("time_of_arrival_s", float, nullable=True),
    Column("duration_s", float),
    Column("distance_m", float),
    Column("n_decisions", int),
    Column("minimum_person_distance_m", float),
    *columns_of(ContactCounts),
    Column("planner_status", str),
    Column("n_recoveries", int),
    *columns_of(EpisodeMetrics),
)
_OF_RECORD = (
    "outcome", "time_of_arrival_s", "duration_s", "distance_m", "minimum_person_distance_m"
)  # fmt: skip


def run_task(task: EpisodeTask) -> Row:
    """Run one episode; its row."""
    scenario = scenario_of(task.scenario, task.n_people)
    observer = MetricsObserver(scenario)
    with HallwayWorld(scenario, seed=task.seed) as world:
        planner = planner_in_world(world, task.people_from)
        record = run_episode(
            world,
            planner,
            make_driver(task.driver, scenario, task.seed),
            episode=task.episode,
            start_area=task.start_area,
            observer=observer.see,
            guard=None if task.guarded else no_guard,
        )
    return {
        **{name: getattr(task, name) for name in TASK_COLUMNS},
        INPUTS: inputs_digest(task.scenario, task.driver),
        **{name: getattr(record, name) for name in _OF_RECORD},
        "n_decisions": len(record.decisions),
        **asdict(record.contacts),
        "planner_status": planner.status.name,
        "n_recoveries": planner.n_recoveries,
        **asdict(observer.metrics),
    }


def run_batch(
    tasks: Iterable[AnyTask],
    path: str | Path,
    *,
    run: Callable[[AnyTask], Row] = run_task,
    columns: Sequence[Column] = COLUMNS,
    key_columns: Sequence[str] = TASK_COLUMNS,
    execution: Execution | None = None,
    on_progress: Progress | None = None,
) -> list[Row]:
    """Rows of all tasks, from the file where they are there already, else run and added to it.

    A task that is listed twice is one task. run: from a task to its row of `columns`, with INPUTS;
    key_columns: the fields of the task. execution: where episodes run, all cores of this
    machine when None. on_progress: called with (done, all) at the start and after every episode.
    """
    wanted = list(dict.fromkeys(tasks))
    require_runnable(wanted)
    table = RowTable(path, columns, key_columns)
    _require_same_inputs(wanted, table)
    missing = [task for task in wanted if task.key not in table.rows]
    done, total = len(wanted) - len(missing), len(wanted)
    if on_progress is not None:
        on_progress(done, total)
    with closing((execution or Execution()).results(run, missing)) as results:
        for row in results:
            table.append(row)
            done += 1
            if on_progress is not None:
                on_progress(done, total)
    return [table.rows[task.key] for task in wanted]


def scenario_of(name: str, n_people: int | None) -> Scenario:
    """The scenario, with another number of people when one is given."""
    scenario = load_scenario(name)
    return scenario if n_people is None else scenario.with_pedestrian_count(n_people)


def inputs_digest(scenario: str, driver: str) -> str:
    """Digest of the contents of the scenario and, if one drives, of the model."""
    text = scenario_content(load_scenario(scenario))
    if driver.endswith(MODEL_SUFFIXES):
        text += read_text(driver)
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()[:12]}"


def require_runnable(tasks: Iterable[EpisodeTask]) -> None:
    """Raise early for bad names, files and areas, which would end a batch in its middle."""
    for condition in {replace(task, seed=0, episode=0) for task in tasks}:
        scenario = scenario_of(condition.scenario, condition.n_people)
        start_states_of(scenario, grid_of(scenario), condition.start_area)
        make_planner(scenario)
        require_people_source(condition.people_from)
        make_driver(condition.driver, scenario, 0)


def _require_same_inputs(tasks: Sequence[EpisodeTask], table: RowTable) -> None:
    known = [task for task in tasks if task.key in table.rows]
    digests = {pair: inputs_digest(*pair) for pair in {(t.scenario, t.driver) for t in known}}
    for task in known:
        if table.rows[task.key].get(INPUTS) != digests[task.scenario, task.driver]:
            raise SimError(
                f"{table.path} holds episodes of another version of {task.scenario} or "
                f"{task.driver}; choose another file or delete it"
            )


_CONDITION = ("scenario", "n_people", "start_area", "driver", "people_from", "guarded")


@dataclass(frozen=True)
class ConditionSummary:
    """One line of the table.

    n_people: None for the scenario's own number. arrival_low, arrival_high: exact 95 % interval.
    Contacts are per episode; metrics: means over the episodes. NaN where no episode arrived.
    """

    scenario: str
    n_people: int | None
    start_area: str
    driver: str
    people_from: str
    guarded: int
    n_episodes: int
    n_arrived: int
    arrival_low: float
    arrival_high: float
    mean_time_of_arrival_s: float
    mean_distance_m: float
    minimum_person_distance_m: float
    robot_on_person: float
    person_on_robot: float
    robot_on_wall: float
    metrics: EpisodeMetrics


def summarise(rows: Sequence[Row]) -> list[ConditionSummary]:
    """One summary per condition, in the order they first appear."""
    conditions: dict[tuple[object, ...], list[Row]] = {}
    for row in rows:
        conditions.setdefault(tuple(row[name] for name in _CONDITION), []).append(row)
    return [_summary(group) for group in conditions.values()]


def _summary(group: list[Row]) -> ConditionSummary:
    arrived = [float(row["time_of_arrival_s"]) for row in group if row["outcome"] == "arrived"]
    first = group[0]
    low, high = (float(end) for end in clopper_pearson(len(arrived), len(group)))
    return ConditionSummary(
        **{name: first[name] for name in _CONDITION},
        **_means(group, ContactCounts),
        metrics=EpisodeMetrics(**_means(group, EpisodeMetrics)),
        n_episodes=len(group),
        n_arrived=len(arrived),
        arrival_low=low,
        arrival_high=high,
        mean_time_of_arrival_s=fmean(arrived) if arrived else float("nan"),
        mean_distance_m=fmean(float(row["distance_m"]) for row in group),
        minimum_person_distance_m=min(float(row["minimum_person_distance_m"]) for row in group),
    )


def _means(group: list[Row], record: type) -> dict[str, Any]:
    """The mean of each field of a record over the rows that know it; NaN where none does."""
    means = {}
    for name in (each.name for each in fields(record)):
        known = [value for row in group if not isnan(value := float(row[name]))]
        means[name] = fmean(known) if known else nan
    return means
