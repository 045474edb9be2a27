"""The planners in the scenarios of a suite, beside baselines of a library (docs/planners.md).

Without the guard, so that planners alone are compared; `dwa` also with it, as robots drive. Each
condition has the same seeds. Episodes are kept under .cache until the simulator's code changes.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from statistics import fmean

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.benchmarks.driving.baselines import (
    BASELINE_COLUMNS,
    BASELINE_KEY,
    BASELINES,
    BaselineTask,
    run_baseline,
)
from lab.benchmarks.driving.closed_loop import ROOT, code_digest, drive_all
from lab.benchmarks.report import Row, save
from serd_app.report import style
from serd_app.report.style import new_figure, save_figure
from serd_sim.episodes.batch import EpisodeTask
from serd_sim.episodes.batch_summary import ConditionSummary, summarise
from serd_sim.planning.catalogue import planner_names
from serd_sim.scenario.scenario import scenario_suite

SUITE = "social_v1"
N_SEEDS = 10
FIGURE = ROOT / "docs" / "pictures" / "planners.png"


@dataclass(frozen=True)
class Measure:
    """A column, of which less is better unless stated."""

    name: str
    label: str
    value: Callable[[ConditionSummary], float]
    more_is_better: bool = False


MEASURES = (
    Measure("arrived", "arrived, %", lambda each: 100 * each.arrival_rate, True),
    Measure("spl", "success weighted by\npath length", lambda each: each.spl, True),
    Measure("time_s", "time of arrival, s", lambda each: each.mean_time_of_arrival_s),
    Measure("standing", "stands, % of time", lambda each: 100 * each.metrics.standing_share),
    Measure(
        "collision_ahead",
        "collision within 1 s\nif both go on, % of time",
        lambda each: 100 * each.metrics.collision_ahead_share,
    ),
    Measure(
        "personal", "person nearer than\n1.2 m, % of time", lambda e: 100 * e.metrics.personal_share
    ),
    Measure("robot_on_person", "drove into people,\nper episode", lambda e: e.robot_on_person),
    Measure("person_on_robot", "people walked into it,\nper episode", lambda e: e.person_on_robot),
    Measure("robot_on_wall", "walls touched,\nper episode", lambda each: each.robot_on_wall),
    Measure(
        "disturbance",
        "change of people's speed\nnear the robot, m/s²",
        lambda each: each.metrics.people_disturbance_mps2,
    ),
    Measure("jerk", "jerk, m/s³", lambda each: each.metrics.mean_abs_jerk_mps3),
    Measure("turning", "turning, rad per metre", lambda each: each.metrics.path_irregularity_radpm),
)


def tasks() -> list[EpisodeTask]:
    """One task per episode, seed by seed."""
    return [
        EpisodeTask(
            scenario=scenario,
            seed=seed,
            planner=planner,
            driver="expert_with_flow",
            guarded=guarded,
        )
        for seed in range(1, N_SEEDS + 1)
        for scenario in scenario_suite(SUITE)
        for planner, guarded in (("dwa", 1), *((name, 0) for name in planner_names()))
    ]


def baseline_tasks() -> list[BaselineTask]:
    """The same episodes without the guard, driven by the baselines."""
    return [
        BaselineTask(
            scenario=scenario,
            seed=seed,
            driver="expert_with_flow",
            guarded=0,
            baseline=baseline,
        )
        for seed in range(1, N_SEEDS + 1)
        for scenario in scenario_suite(SUITE)
        for baseline in BASELINES
    ]


def run() -> None:
    """Drive all episodes that are missing, then write table and figure."""
    folder, digest = ROOT / ".cache" / "benchmarks", code_digest()
    rows = drive_all("planners", tasks(), folder / f"planners_{digest}.csv")
    of_baselines = drive_all(
        "baselines",
        baseline_tasks(),
        folder / f"baselines_{digest}.csv",
        run=run_baseline,
        columns=BASELINE_COLUMNS,
        key_columns=BASELINE_KEY,
    )
    rows += [row | {"planner": row["baseline"]} for row in of_baselines]
    summaries = summarise(rows)
    save_figure(FIGURE, planners_figure(summaries))
    about = f"Planners in {SUITE}: means over scenarios, {N_SEEDS} episodes in each"
    groups = _grouped(summaries, attrgetter("scenario"))
    per_scenario = {name: _rows(group) for name, group in groups.items()}
    save("planners", about, _rows(summaries), {"scenarios": per_scenario})


def label_of(summary: ConditionSummary) -> str:
    """Name of the planner, with the guard where it is on."""
    return summary.planner + (" with guard" if summary.guarded else "")


def planners_figure(summaries: Sequence[ConditionSummary]) -> Figure:
    """A panel per measure: a small dot per scenario, a bar at the mean."""
    groups = _grouped(summaries, label_of)
    with style.report_style():
        figure = new_figure(10.5, 8.2)
        panels = figure.subplots(3, 4, sharey=True)
        for axes, measure in zip(panels.flat, MEASURES, strict=True):
            _draw(axes, measure, groups)
        panels[0, 0].set_yticks(range(len(groups)), [name.replace("_", " ") for name in groups])
        panels[0, 0].set_ylim(len(groups) - 0.4, -0.6)
    return figure


def _draw(axes: Axes, measure: Measure, groups: dict[str, list[ConditionSummary]]) -> None:
    for place, (name, group) in enumerate(groups.items()):
        found = _values(measure, group)
        colour = style.BLUE if name.startswith(planner_names()) else style.RED
        axes.plot(found, [place] * len(found), "o", color=colour, alpha=0.35, markersize=4)
        axes.plot([fmean(found)], [place], "|", color=colour, markersize=15, markeredgewidth=3)
    arrow = "more is better" if measure.more_is_better else "less is better"
    axes.set_xlabel(f"{measure.label}\n({arrow})")
    axes.grid(axis="x")


def _rows(summaries: Sequence[ConditionSummary]) -> list[Row]:
    return [
        {"planner": name} | {each.name: round(fmean(_values(each, group)), 3) for each in MEASURES}
        for name, group in _grouped(summaries, label_of).items()
    ]


def _values(measure: Measure, group: Sequence[ConditionSummary]) -> list[float]:
    """Of each scenario; those without an arrival have no time of arrival."""
    return [value for each in group if not math.isnan(value := measure.value(each))]


def _grouped(
    summaries: Sequence[ConditionSummary], key: Callable[[ConditionSummary], str]
) -> dict[str, list[ConditionSummary]]:
    groups: dict[str, list[ConditionSummary]] = {}
    for each in summaries:
        groups.setdefault(key(each), []).append(each)
    return groups
