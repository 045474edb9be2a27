"""Data that figures use besides their own tables: the scenario and the problem."""

from dataclasses import dataclass

from experiments.study.settings import StudySettings
from experiments.study.world import problem_of, scenario_of
from report.figures.map_axes import HallwayLayout, layout_of
from serd_core.grid.navigation import NavigationProblem
from sim.scenario.scenario import Scenario


@dataclass(frozen=True, eq=False)
class FigureContext:
    """The scenario with its people, the decision problem on it, and its map."""

    scenario: Scenario
    problem: NavigationProblem
    layout: HallwayLayout


def context_of(settings: StudySettings) -> FigureContext:
    """Context of a study with these settings."""
    scenario = scenario_of(settings)
    return FigureContext(scenario, problem_of(settings), layout_of(scenario))
