"""serd batch --scenario hallway --policy expert --policy model.yaml --seeds 20 --output runs.csv

Writes a row per episode. Rerun an interrupted command to resume it; with more seeds or policies
it adds theirs to the table.
"""

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from itertools import product, starmap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.table import Table

from serd_cli.errors import UsageError
from serd_cli.options import EXECUTION, AsJson, Jobs, opt
from serd_cli.output.terminal import console, finite_values, print_json, run_episodes, table_of
from serd_sim.drivers.catalogue import driver_names
from serd_sim.episodes.execution import Execution
from serd_sim.scenario.names import scenario_suite, suite_names

if TYPE_CHECKING:
    from serd_sim.episodes.batch import ConditionSummary

#: All episodes of a table are listed in memory before the first is run.
MOST_SEEDS = 100_000

Texts = list[str] | None
Scenarios = Annotated[
    list[str], opt(f"built-in scenario, YAML file, or suite: {', '.join(suite_names())}; repeat")
]
Policies = Annotated[Texts, opt(f"{', '.join(driver_names())} or a learned model's file; repeat")]
People = Annotated[list[int] | None, opt("number of people, else the scenario's own; repeat")]
StartAreas = Annotated[Texts, opt("where the robot starts, default train; repeat")]
Sources = Annotated[Texts, opt("given: people as they are; scan: from the lidar alone; repeat")]
Guard = Annotated[bool, opt("whether commands pass the guard, as they do on a robot")]


def batch(
    output: Annotated[Path, opt("table of episodes, ending in .csv")],
    scenario: Scenarios,
    policy: Policies = None,
    people: People = None,
    start_area: StartAreas = None,
    people_from: Sources = None,
    guard: Guard = True,
    seeds: Annotated[int, opt("episodes of each, seeds first-seed and up")] = 20,
    first_seed: Annotated[int, opt("seed of the first episode")] = 1,
    jobs: Jobs = EXECUTION.n_jobs,
    as_json: AsJson = False,
) -> None:
    """Parse the options, run the episodes and print their summary."""
    from serd_sim.episodes.batch import EpisodeTask, run_batch, summarise

    choices = (
        [name for each in scenario for name in scenario_suite(each) or [each]],
        _seeds(first_seed, seeds),
        [0],
        [*people] if people else [None],
        start_area or [EpisodeTask.start_area],
        policy or ["expert"],
        people_from or [EpisodeTask.people_from],
        [int(guard)],
    )
    tasks = starmap(EpisodeTask, product(*choices))
    run = partial(run_batch, tasks, output, execution=Execution(jobs))
    summaries = summarise(run_episodes(output, lambda show: run(on_progress=show)))
    if as_json:
        print_json({"conditions": summary_values(summaries), "table": str(output.resolve())})
    else:
        print_episodes(summaries, output)


def _seeds(first: int, count: int) -> range:
    if count < 1 or first < 0:
        raise UsageError(
            f"--seeds must be at least 1 and --first-seed at least 0, got {count} and {first}"
        )
    if count > MOST_SEEDS:
        raise UsageError(f"--seeds must be at most {MOST_SEEDS}, got {count}; run them in parts")
    return range(first, first + count)


def print_episodes(summaries: "Sequence[ConditionSummary]", output: Path) -> None:
    """The table, and where the rows are."""
    console.print(summary_table(summaries))
    print(f"episodes: {output.resolve()}")


def summary_values(summaries: "Sequence[ConditionSummary]") -> list[dict[str, Any]]:
    """The same by name, None for numbers that are not finite."""
    return [finite_values(asdict(each)) for each in summaries]


def summary_table(summaries: "Sequence[ConditionSummary]") -> Table:
    """One row per condition; contacts are those of all its episodes."""
    table = table_of("Episodes", "condition", ("arrived", "95 % interval", "time", "way"))
    table.add_column("robot into people, people into robot, walls", justify="right", max_width=20)
    for each in summaries:
        contacts = (each.robot_on_person, each.person_on_robot, each.robot_on_wall)
        table.add_row(
            _condition(each),
            f"{each.n_arrived} of {each.n_episodes}",
            f"{100 * each.arrival_low:.0f}-{100 * each.arrival_high:.0f} %",
            f"{each.mean_time_of_arrival_s:.1f} s" if each.n_arrived else "",
            f"{each.mean_distance_m:.1f} m",
            ", ".join(f"{round(per * each.n_episodes)}" for per in contacts),
        )
    return table


def _condition(summary: "ConditionSummary") -> str:
    people = "" if summary.n_people is None else f", {summary.n_people} people"
    seen = ", from scans" if summary.people_from == "scan" else ""
    seen += "" if summary.guarded else ", without guard"
    return f"{summary.scenario}{people}, from {summary.start_area}: {summary.driver}{seen}"
