"""The closed-loop benchmark as one figure: a column per scenario, a row per measure."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from report import style
from report.canvas import new_figure
from sim.batch_summary import ConditionSummary

_PLANNERS = {"dwa": (style.BLUE, "o", -0.12), "mppi": (style.RED, "s", 0.12)}
_Measure = Callable[[ConditionSummary], float]


def closed_loop_figure(summaries: Sequence[ConditionSummary]) -> Figure:
    """Dots of both planners over the four conditions of each scenario."""
    scenarios = list(dict.fromkeys(each.scenario for each in summaries))
    with style.report_style():
        figure = new_figure(2.5 * len(scenarios) + 0.7, 8.2)
        panels = figure.subplots(5, len(scenarios), sharex=True, sharey="row", squeeze=False)
        for column, scenario in enumerate(scenarios):
            here = [each for each in summaries if each.scenario == scenario]
            _draw_scenario(panels[:, column], here)
            panels[0, column].set_title(scenario.replace("_", " "))
        _label(panels)
        handles, labels = panels[1, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def _draw_scenario(panels: Sequence[Axes], here: list[ConditionSummary]) -> None:
    conditions = list(dict.fromkeys((each.n_people, each.driver) for each in here))
    measures: tuple[_Measure, ...] = (
        lambda each: 100 * each.arrival_rate,
        lambda each: each.mean_time_of_arrival_s,
        lambda each: 100 * each.personal_share,
        lambda each: 100 * each.intimate_share,
        lambda each: each.person_on_robot,
    )
    for planner, (colour, marker, shift) in _PLANNERS.items():
        mine = {(each.n_people, each.driver): each for each in here if each.planner == planner}
        place = np.arange(len(conditions)) + shift
        for axes, measure in zip(panels, measures, strict=True):
            values = [measure(mine[each]) for each in conditions]
            axes.plot(
                place,
                values,
                marker,
                color=colour,
                label=planner.upper(),
                markersize=5,
                clip_on=False,
            )
            axes.grid(axis="y")
        for each, x in zip(conditions, place, strict=True):
            summary = mine[each]
            interval = (100 * summary.arrival_low, 100 * summary.arrival_high)
            panels[0].plot((x, x), interval, color=colour, linewidth=1.5)
            struck = round(summary.robot_on_person * summary.n_episodes)
            if struck:
                panels[4].annotate(
                    f"{struck} by\nthe robot",
                    (x, summary.person_on_robot),
                    xytext=(0, 6),
                    textcoords="offset points",
                    ha="center",
                    color=colour,
                    fontsize=7,
                )
    panels[0].set_xlim(-0.5, len(conditions) - 0.5)
    panels[-1].set_xticks(range(len(conditions)), [_words(*each) for each in conditions])


def _words(n_people: int | None, driver: str) -> str:
    return f"{n_people}\n{'with' if driver.endswith('with_flow') else 'against'}"


def _label(panels: np.ndarray) -> None:
    names = (
        "arrived, %\n(95 % interval)",
        "time of arrival, s",
        "% of time nearer\nthan 1.2 m",
        "% of time nearer\nthan 0.45 m",
        "people who walked\ninto the robot,\nper episode",
    )
    for axes, name in zip(panels[:, 0], names, strict=True):
        axes.set_ylabel(name)
    for axes in panels[1:].ravel():
        axes.set_ylim(bottom=0)
    for axes in panels[-1]:
        axes.set_xlabel("people, with or against the flow")
