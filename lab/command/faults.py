"""`python -m lab faults`: episodes in which inputs fail, with and without the guard."""

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from lab.experiments.running.tables import print_results
from lab.faults.campaign import COLUMNS, TASK_COLUMNS, WATCHED_S, run_fault, tasks_of
from lab.faults.faults import FAULTS, fault_named
from lab.faults.field import (
    FIELD_FAULTS,
    STACKS,
    field_summary,
    field_table,
    run_field,
    run_guard,
)
from lab.faults.figure import FaultWays, draw_fault_ways
from lab.faults.robots import ROBOTS, robot_named
from serd_app.report.style import save_figure
from serd_cli.commands.batch import MOST_SEEDS
from serd_cli.errors import UsageError
from serd_cli.options import EXECUTION, AsJson, Jobs
from serd_cli.output.terminal import console, finite_values, print_json, run_episodes
from serd_cli.processes.stack_run import stack_environment
from serd_cli.processes.workspace import ros_environment
from serd_files.table import Row
from serd_sim.drivers.catalogue import driver_names
from serd_sim.episodes.batch import EpisodeTask, run_batch
from serd_sim.episodes.execution import Execution

_PRINTED = ["fault", "guarded", "n_episodes", "n_stood", "mean_zero_s", "mean_stood_s"]
_PRINTED += ["largest_stood_s", "mean_stood_m", "largest_stood_m", "largest_later_m"]
_PRINTED += ["robot_on_person", "person_on_robot", "robot_on_wall"]


def faults(
    output: Annotated[Path, typer.Option(help="table of episodes, ending in .csv")],
    fault: Annotated[
        list[str] | None, typer.Option(help=f"{', '.join(FAULTS)}; default: all; repeat")
    ] = None,
    scenario: Annotated[str, typer.Option(help="built-in scenario or YAML file")] = "hallway",
    people: Annotated[int, typer.Option(help="number of people")] = 60,
    policy: Annotated[
        str, typer.Option(help=f"{', '.join(driver_names())} or a learned model's file")
    ] = EpisodeTask.driver,
    seeds: Annotated[
        int, typer.Option(min=1, max=MOST_SEEDS, help="episodes of each, seeds first-seed and up")
    ] = 20,
    first_seed: Annotated[int, typer.Option(min=0, help="seed of the first episode")] = 1,
    robot: Annotated[
        list[str] | None,
        typer.Option(help=f"live, with this robot: {', '.join(ROBOTS)}, or all; repeat"),
    ] = None,
    stack: Annotated[
        list[str] | None, typer.Option(help=f"of --robot: {', '.join(STACKS)}; default: all")
    ] = None,
    goals: Annotated[int, typer.Option(min=0, help="goals of each --robot on each stack")] = 20,
    guard: Annotated[
        str, typer.Option(help="RAW:OUT, in full: topics of a guard of yours that runs already")
    ] = "",
    jobs: Jobs = EXECUTION.n_jobs,
    as_json: AsJson = False,
) -> None:
    """Measure how soon the robot stands when an input fails at full speed.

    python -m lab faults --seeds 20 --output faults.csv
    python -m lab faults --robot all --output field.csv
    python -m lab faults --robot fast --guard /fast/cmd_vel_raw:/fast/cmd_vel --output mine.csv

    Writes a row per episode, with what the robot touched, and a picture beside the table. Rerun an
    interrupted command to resume it. With --robot stand-ins for robots of other makers drive live
    on the stacks of a robot, or before your guard (read docs/safety.md): a row per goal and fault.
    """
    if robot:
        field(output, robot, stack or STACKS, fault or FIELD_FAULTS, goals, guard, as_json=as_json)
        return
    if stack or guard:
        raise UsageError("--stack and --guard belong to --robot; name a robot, or all")
    condition = EpisodeTask(scenario, 0, n_people=people, driver=policy)
    tasks = tasks_of(fault or FAULTS, condition, range(first_seed, first_seed + seeds))
    execution = Execution(jobs)
    rows = run_episodes(
        output,
        lambda seen: run_batch(
            tasks,
            output,
            run=run_fault,
            columns=COLUMNS,
            key_columns=TASK_COLUMNS,
            execution=execution,
            on_progress=seen,
        ),
    )
    summaries = summarise_faults(rows)
    picture = output.with_suffix(".png")
    ways = _ways(rows)
    if ways:
        save_figure(picture, draw_fault_ways(ways, WATCHED_S))
    prices = {name: arrival_price(rows, name) for name in ("none", "none_scan")}
    if as_json:
        values = [finite_values(each) for each in summaries.to_dict("records")]
        print_json(
            {"faults": values, "price": finite_values(prices), "table": str(output.resolve())}
        )
        return
    print_results(summaries[_PRINTED], "Faults; contacts are those of all episodes")
    for each in summaries.itertuples():
        price = prices.get(each.fault, math.nan)
        if each.guarded and not math.isnan(price):
            console.print(
                f"{FAULTS[each.fault].about}: the guard changes the time of arrival by"
                f" {100 * price:+.2f} % and stops for an input"
                f" {each.n_input_stops / each.hours:.1f} times per hour"
            )
    console.print(f"episodes: {output.resolve()}", soft_wrap=True)
    if ways:
        console.print(f"picture: {picture.resolve()}", soft_wrap=True)


def field(
    output: Path,
    robots: Sequence[str],
    stacks: Sequence[str],
    faults: Sequence[str],
    n_goals: int,
    guard: str,
    *,
    as_json: bool,
) -> None:
    """Run goals and faults of robots live; writes and prints what came of them."""
    names = list(ROBOTS) if "all" in robots else [*map(_known_robot, robots)]
    for each in faults:
        if fault_named(each) and each not in FIELD_FAULTS:
            raise UsageError(f"--fault must be one of {', '.join(FIELD_FAULTS)}, got {each}")
    if unknown := {*stacks} - {*STACKS}:
        raise UsageError(f"--stack must be one of {', '.join(STACKS)}, got {', '.join(unknown)}")
    if guard and (guard.count(":") != 1 or not all(guard.split(":"))):
        raise UsageError(f"--guard must be written RAW:OUT, two topics in full, got {guard!r}")
    folder, table = output.with_suffix(""), field_table(output)
    for name in names:
        if guard:
            raw, out = guard.split(":")
            environment = ros_environment(os.environ)
            run_guard(name, (raw, out), folder / name, environment, table, faults)
            continue
        for stack in stacks:
            logs = folder / name / stack
            with stack_environment(logs) as environment:
                run_field(name, stack, logs, environment, table, n_goals=n_goals, faults=faults)
    summary = field_summary(table.rows.values())
    if as_json:
        rows = [finite_values(row) for row in summary.to_dict("records")]
        print_json({"robots": rows, "table": str(output.resolve())})
        return
    print_results(summary, "Nav2 is a stand-in with Nav2's tolerances")
    console.print(f"goals and faults: {output.resolve()}; logs: {folder.resolve()}", soft_wrap=True)


def _known_robot(name: str) -> str:
    robot_named(name)
    return name


def _ways(rows: list[Row]) -> list[FaultWays]:
    """The ways after each fault that begins at full speed."""
    frame = pd.DataFrame(rows)
    frame = frame[(frame["began"] == 1) & ~frame["fault"].map(lambda name: FAULTS[name].lasts)]
    found = []
    for name, group in frame.groupby("fault", sort=False):
        way_m = {side: each["way_m"].to_numpy() for side, each in group.groupby("guarded")}
        nothing = frame["way_m"].to_numpy()[:0]
        about = f"{FAULTS[str(name)].about} ({FAULTS[str(name)].people_from})"
        found.append(FaultWays(about, way_m.get(0, nothing), way_m.get(1, nothing)))
    return found


def summarise_faults(rows: Sequence[Row]) -> pd.DataFrame:
    """One row per fault and guard, in the order they first appear.

    n_episodes: those in which the fault began. Times (s) and distances (m) from there. n_stood: of
    these, where the robot stood. Means and maxima are over those, NaN for none. largest_later_m:
    way after standing. Contacts and input stops are sums, hours simulated time.
    """
    frame = pd.DataFrame(rows)
    groups = frame[frame["began"] == 1].groupby(["fault", "guarded"], sort=False)
    summary = groups.agg(
        n_episodes=("began", "size"),
        n_stood=("stood_s", "count"),
        mean_zero_s=("zero_s", "mean"),
        largest_zero_s=("zero_s", "max"),
        mean_stood_s=("stood_s", "mean"),
        largest_stood_s=("stood_s", "max"),
        mean_stood_m=("stood_m", "mean"),
        largest_stood_m=("stood_m", "max"),
        largest_later_m=("later_m", "max"),
        robot_on_person=("robot_on_person", "sum"),
        person_on_robot=("person_on_robot", "sum"),
        robot_on_wall=("robot_on_wall", "sum"),
        n_input_stops=("n_input_stops", "sum"),
        hours=("duration_s", "sum"),
    ).reset_index()
    return summary.assign(guarded=summary["guarded"] == 1, hours=summary["hours"] / 3600.0)


def arrival_price(rows: Sequence[Row], fault: str) -> float:
    """Relative increase of the mean time of arrival by the guard, where a seed arrives in both."""
    frame = pd.DataFrame(rows)
    times = (
        frame[frame["fault"] == fault]
        .pivot_table(index="seed", columns="guarded", values="time_of_arrival_s")
        .dropna()
    )
    if not {0, 1} <= {*times.columns}:
        return float("nan")
    return float(times[1].mean() / times[0].mean() - 1.0)
