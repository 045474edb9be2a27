"""A scenario as a picture and as numbers."""

from pathlib import Path
from typing import Any

from report.figures.scenario_plan import draw_scenario_plan
from report.style import save_figure
from serd_cli.output.paths import require_suffix
from sim.scenario.grid import grid_of
from sim.scenario.scenario import Scenario


def save_plan(scenario: Scenario, path: Path) -> None:
    """Write the plan as PNG and make its folder; UsageError for another suffix."""
    require_suffix(path, ".png")
    save_figure(path, draw_scenario_plan(scenario))


def scenario_values(name: str, scenario: Scenario) -> dict[str, Any]:
    """The main properties as plain values."""
    x_min, y_min, x_max, y_max = scenario.bounds_m
    return {
        "scenario": name,
        "description": scenario.description,
        "size_m": [x_max - x_min, y_max - y_min],
        "cell_size_m": scenario.cell_size_m,
        "cells": grid_of(scenario).n_states,
        "people": scenario.pedestrians.count,
        "loops": [loop.name for loop in scenario.pedestrians.loops],
        "flow_convention": scenario.flow_convention,
        "start_areas": list(scenario.start_areas_m),
        "decision_period_s": scenario.decision_period_s,
        "episode_timeout_s": scenario.episode_timeout_s,
    }
