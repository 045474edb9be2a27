import numpy as np
import pandas as pd

from lab.experiments.latent.hidden_actions import HiddenActionsConfig, terrain_problem
from lab.experiments.latent.mixed_experts import MEASURES, demonstrations, summary_of
from lab.experiments.study.recordings.drives import drive_in
from serd_app.demonstrations.decision_table import concatenate_renumbered
from serd_core.grid.navigation import FEATURE_NAMES
from serd_core.mixtures.expert_types import choose_expert_types
from serd_core.selection.evaluation import adjusted_rand_index
from sim.drivers.catalogue import make_driver
from sim.scenario.grid import navigation_problem_of
from sim.scenario.scenario import load_scenario


def test_two_scripted_experts_of_the_hallway_are_two_types():
    hallway = load_scenario("hallway").with_pedestrian_count(6)
    hallway = hallway.with_values("robot", drive="kinematic")
    problem, tables = navigation_problem_of(hallway, 0.99), []
    for seed, name in enumerate(("expert_with_flow", "expert_against_flow")):
        driver, starts = make_driver(name, hallway, seed), [(each, "train") for each in range(4)]
        drives = drive_in(hallway, problem, "dwa", driver, seed=seed, starts=starts)
        tables.append(drives.decisions)
    found = choose_expert_types(problem, concatenate_renumbered(tables)).chosen
    truth = np.repeat([0, 1], [len(each.episodes) for each in tables])
    assert adjusted_rand_index(found.type_of_unit, truth) == 1.0
    norm = found.reward_weights[:, FEATURE_NAMES.index("social_norm")]
    assert norm[found.type_of_unit[0]] > 0 > norm[found.type_of_unit[-1]]


def test_each_expert_has_the_moves_and_episodes_that_were_asked_for():
    problem = terrain_problem(HiddenActionsConfig(side=4), np.random.default_rng(0))
    found, experts = demonstrations(problem, np.array([0, 1, 2]), 20, 15, np.random.default_rng(1))
    np.testing.assert_array_equal(np.bincount(experts), [20, 20, 20])
    assert [len(np.unique(found.episode[experts == each])) for each in range(3)] == [2, 2, 2]
    assert len(found.episodes) == 6


def test_the_summary_averages_the_worlds_that_were_fitted():
    rows = [
        {"types": 2, "moves": 15, "message": "", **dict.fromkeys(MEASURES, value)}
        for value in (0.0, 1.0, 1.0, 1.0)
    ]
    rows.append({"types": 2, "moves": 15, "message": "no fit"})
    summary = summary_of(pd.DataFrame(rows))
    assert list(summary["measure"]) == list(MEASURES)
    assert set(summary["n"]) == {4}
    assert set(summary["failed"]) == {1}
    np.testing.assert_allclose(summary["mean"], 0.75)
    assert np.all((summary["lower"] < 0.75) & (summary["upper"] > 0.75))
