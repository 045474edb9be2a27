"""`serd batch`: many episodes over many processes, one row each, and their summary."""

from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from serd_cli.errors import UsageError
from serd_cli.options import EXECUTION, Address, AsJson, Backend, Jobs
from serd_cli.output.terminal import console, finite_values, print_json, run_episodes, table_of
from serd_sim.drivers.catalogue import driver_names
from serd_sim.episodes.batch import EpisodeTask, run_batch
from serd_sim.episodes.batch_summary import ConditionSummary, summarise
from serd_sim.episodes.execution import Execution
from serd_sim.planning.catalogue import planner_names
from serd_sim.scenario.names import scenario_suite, suite_names

#: All episodes of a table are listed in memory before the first is run.
MOST_SEEDS = 100_000


def batch(
    output: Annotated[Path, typer.Option(help="table of episodes, ending in .csv")],
    scenario: Annotated[
        list[str],
        typer.Option(
            help=f"built-in scenario, YAML file, or suite: {', '.join(suite_names())}; repeat"
        ),
    ],
    policy: Annotated[
        list[str] | None,
        typer.Option(help=f"{', '.join(driver_names())} or a learned model's file; repeat"),
    ] = None,
    planner: Annotated[
        list[str] | None,
        typer.Option(help=f"{', '.join(planner_names())}; repeat"),
    ] = None,
    people: Annotated[
        list[int] | None, typer.Option(help="number of people, else the scenario's own; repeat")
    ] = None,
    start_area: Annotated[
        list[str] | None, typer.Option(help="where the robot starts, default train; repeat")
    ] = None,
    people_from: Annotated[
        list[str] | None,
        typer.Option(help="given: people as they are; scan: from the lidar alone; repeat"),
    ] = None,
    guard: Annotated[
        bool, typer.Option(help="whether commands pass the guard, as they do on a robot")
    ] = True,
    seeds: Annotated[int, typer.Option(help="episodes of each, seeds first-seed and up")] = 20,
    first_seed: Annotated[int, typer.Option(help="seed of the first episode")] = 1,
    jobs: Jobs = EXECUTION.n_jobs,
    backend: Backend = EXECUTION.backend,
    address: Address = EXECUTION.address,
    as_json: AsJson = False,
) -> None:
    """Run every combination of scenarios, policies, planners and seeds.

    serd batch --scenario hallway --policy expert --policy model.yaml --seeds 20 --output runs.csv

    Writes a row per episode. Rerun an interrupted command to resume it; with more seeds or policies
    it adds theirs to the table.
    """
    if seeds < 1 or first_seed < 0:
        given = f"{seeds} and {first_seed}"
        raise UsageError(f"--seeds must be at least 1 and --first-seed at least 0, got {given}")
    counts: list[int | None] = [*people] if people else [None]
    if seeds > MOST_SEEDS:
        raise UsageError(f"--seeds must be at most {MOST_SEEDS}, got {seeds}; run them in parts")
    tasks = [
        EpisodeTask(
            scenario=place,
            seed=seed,
            n_people=count,
            start_area=area,
            planner=local,
            driver=driver,
            people_from=source,
            guarded=int(guard),
        )
        for place, count, area, local, source, driver, seed in product(
            [name for each in scenario for name in scenario_suite(each) or [each]],
            counts,
            start_area or [EpisodeTask.start_area],
            planner or [EpisodeTask.planner],
            people_from or [EpisodeTask.people_from],
            policy or ["expert"],
            range(first_seed, first_seed + seeds),
        )
    ]
    execution = Execution(jobs, backend, address)
    rows = run_episodes(
        output, lambda seen: run_batch(tasks, output, execution=execution, on_progress=seen)
    )
    summaries = summarise(rows)
    if as_json:
        values = [finite_values(asdict(each)) for each in summaries]
        print_json({"conditions": values, "table": str(output.resolve())})
        return
    console.print(summary_table(summaries))
    console.print(metrics_table(summaries))
    print(f"episodes: {output.resolve()}")


def summary_table(summaries: list[ConditionSummary]) -> Table:
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


def metrics_table(summaries: list[ConditionSummary]) -> Table:
    """One row per condition: the way, nearness to people and smoothness."""
    names = ("SPL", "stands", "personal zone", "collision < 1 s", "people", "jerk", "turns")
    table = table_of("Means over the episodes", "condition", names)
    for each in summaries:
        metrics = each.metrics
        table.add_row(
            _condition(each),
            f"{each.spl:.2f}",
            f"{100 * metrics.standing_share:.0f} %",
            f"{100 * metrics.personal_share:.0f} %",
            f"{100 * metrics.collision_ahead_share:.1f} %",
            f"{metrics.people_disturbance_mps2:.2f} m/s²",
            f"{metrics.mean_abs_jerk_mps3:.1f} m/s³",
            f"{metrics.path_irregularity_radpm:.2f} rad/m",
        )
    return table


def _condition(summary: ConditionSummary) -> str:
    people = "" if summary.n_people is None else f", {summary.n_people} people"
    seen = ", from scans" if summary.people_from == "scan" else ""
    seen += "" if summary.guarded else ", without guard"
    return (
        f"{summary.scenario}{people}, from {summary.start_area}: "
        f"{summary.driver} by {summary.planner}{seen}"
    )
