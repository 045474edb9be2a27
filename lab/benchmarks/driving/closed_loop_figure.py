"""The closed-loop benchmark as one figure: a column per scenario, a row per measure."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from serd_app.report import style
from serd_app.report.style import new_figure
from serd_sim.episodes.batch_summary import ConditionSummary

_Measure = Callable[[ConditionSummary], float]
_MEASURES: dict[str, _Measure] = {
    "arrived, %\n(95 % interval)": lambda each: 100 * each.arrival_rate,
    "time of arrival, s": lambda each: each.mean_time_of_arrival_s,
    "% of time nearer\nthan 1.2 m": lambda each: 100 * each.metrics.personal_share,
    "% of time nearer\nthan 0.45 m": lambda each: 100 * each.metrics.intimate_share,
    "people who walked\ninto the robot,\nper episode": lambda each: each.person_on_robot,
    "people the robot\ndrove into,\nper episode": lambda each: each.robot_on_person,
}


@dataclass(frozen=True)
class _Look:
    """How one series is drawn. shift: beside the middle of its condition."""

    label: str
    colour: str
    marker: str
    filled: bool
    shift: float


#: By planner and where it knows people from.
_LOOKS = {
    ("dwa", "given"): _Look("DWA", style.BLUE, "o", True, -0.27),
    ("dwa", "scan"): _Look("DWA, people from scans alone", style.BLUE, "o", False, -0.09),
    ("mppi", "given"): _Look("MPPI", style.RED, "s", True, 0.09),
    ("mppi", "scan"): _Look("MPPI, people from scans alone", style.RED, "s", False, 0.27),
}


def closed_loop_figure(summaries: Sequence[ConditionSummary]) -> Figure:
    """Both planners, each with both sources of people, over the conditions of each scenario."""
    scenarios = list(dict.fromkeys(each.scenario for each in summaries))
    with style.report_style():
        figure = new_figure(2.5 * len(scenarios) + 0.7, 9.4)
        panels = figure.subplots(
            len(_MEASURES), len(scenarios), sharex=True, sharey="row", squeeze=False
        )
        for column, scenario in enumerate(scenarios):
            here = [each for each in summaries if each.scenario == scenario]
            _draw_scenario(panels[:, column], here)
            panels[0, column].set_title(scenario.replace("_", " "))
        _label(panels)
        handles, labels = panels[1, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _draw_scenario(panels: Sequence[Axes], here: list[ConditionSummary]) -> None:
    conditions = list(dict.fromkeys((each.n_people, each.driver) for each in here))
    for (planner, people_from), look in _LOOKS.items():
        mine = {
            (each.n_people, each.driver): each
            for each in here
            if (each.planner, each.people_from) == (planner, people_from)
        }
        place = np.arange(len(conditions)) + look.shift
        _draw_series(panels, place, [mine[each] for each in conditions], look)
    for axes in panels:
        axes.grid(axis="y")
    panels[0].set_xlim(-0.5, len(conditions) - 0.5)
    panels[-1].set_xticks(range(len(conditions)), [_words(*each) for each in conditions])


def _draw_series(
    panels: Sequence[Axes], place: np.ndarray, series: list[ConditionSummary], look: _Look
) -> None:
    """One planner with one source of people: a dot in every panel, an interval in the first."""
    face = look.colour if look.filled else "white"
    mark = {"color": look.colour, "markerfacecolor": face, "markersize": 4.5}
    for axes, measure in zip(panels, _MEASURES.values(), strict=True):
        values = [measure(each) for each in series]
        axes.plot(place, values, look.marker, label=look.label, clip_on=False, **mark)
    for each, x in zip(series, place, strict=True):
        interval = (100 * each.arrival_low, 100 * each.arrival_high)
        panels[0].plot((x, x), interval, color=look.colour, linewidth=1.2, zorder=1)


def _words(n_people: int | None, driver: str) -> str:
    return f"{n_people}\n{'with' if driver.endswith('with_flow') else 'against'}"


def _label(panels: np.ndarray) -> None:
    for axes, name in zip(panels[:, 0], _MEASURES, strict=True):
        axes.set_ylabel(name)
    for axes in panels[1:].ravel():
        axes.set_ylim(bottom=0)
    for axes in panels[-1]:
        axes.set_xlabel("people, with or against the flow")
