"""Four robots: what each chooses, and the tables of their drives."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from lab.experiments.study.robots import robots
from lab.experiments.study.robots.robots import Demonstrated, fit_counted, shortest_way, task_with
from lab.experiments.study.robots.settings import TASKS, YAML, RobotsStudy, robots_settings
from lab.experiments.study.robots.tables import forecasts, paired, summary_of
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Action
from serd_core.grid.navigation import AGAINST_FLOW, MODEL_NAMES, WITH_FLOW
from serd_core.priors.divergence import DirichletPrior
from serd_core.semi_markov.models import require_timed
from serd_sim.scenario.grid import start_states_of


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return RobotsStudy(robots_settings(), tmp_path_factory.mktemp("robots"))


def test_both_places_have_the_measured_density(study):
    """1.14 people/m^2."""
    for place in ("ring", "long_ring"):
        scenario = study.scenarios[place]
        area = np.prod(np.ptp(scenario.walkable_area_m, axis=0))
        area -= sum(np.prod(np.ptp(each.outline_m, axis=0)) for each in scenario.obstacles)
        assert scenario.pedestrians.count / area == pytest.approx(1.14, abs=0.01)


def test_the_robot_without_a_model_takes_the_fewest_cells_and_draws_among_equal_ways(study):
    scenario = study.scenarios["ring"]
    policy = shortest_way(scenario)
    np.testing.assert_allclose(policy.sum(axis=1), 1.0)
    starts = np.unique(start_states_of(scenario, task_grid(scenario), TASKS[1]))
    assert np.all(policy[starts, Action.WEST] == 1.0)
    assert np.any((policy > 0.4) & (policy < 0.6))


def test_counted_dynamics_have_the_prior_that_they_are_given(study):
    scenario = study.scenarios["ring"]
    task = task_with(Demonstrated(scenario, None, 0.99), ("goal", "inverse_wall_distance"))
    model, grid = require_timed(task.problem.mdp.transitions), task.problem.grid
    state = int(np.argmax(task.problem.outcome_models.model_of[:, Action.NORTH] == WITH_FLOW))
    n, along = np.full(6, 1), grid.neighbours[state, Action.NORTH]
    decisions = TimedDecisions(
        np.arange(6),
        0.0 * n,
        state=state * n,
        action=Action.NORTH * n,
        next_state=along * n,
        dwell_s=1.1 * n,
        censored=n == 0,
    )
    fit = fit_counted(task, decisions, DirichletPrior(0.5, intended_ratio=9.0))
    table = model.outcomes.local_probabilities(fit.parameters.truth)
    against = np.array([0.5, 4.5, 0.5, 0.5, 0.5])
    np.testing.assert_allclose(table[AGAINST_FLOW], against / against.sum(), rtol=1e-6)
    plain = estimate_dynamics(task.problem, decisions, 0.5)
    assert fit.parameters.truth[model.means] == pytest.approx(plain[model.means])


def test_where_serd_itself_counts_the_robot_of_counts_is_the_same(study, monkeypatch):
    """Its fit has no prior on outcomes then."""
    fit = SimpleNamespace(assumed=SimpleNamespace(prior=PriorByEvidence()))
    learned = SimpleNamespace(fit=fit, model="counted by SERD")
    monkeypatch.setattr(robots, "learn", lambda *_: learned)
    shown = Demonstrated(study.scenarios["ring"], None, 0.99)
    for counted in (False, True):
        assert robots.model_of(shown, ("goal",), counted=counted) == "counted by SERD"


def test_tables_compare_robots_on_the_same_seeds(study):
    drives = pd.DataFrame(
        {"place": "ring", "repetition": 0, "task": task, "episode": episode, "robot": robot}
        | {"seconds": 10.0 * slow + episode, "arrived": True, "contacts": 0}
        for task in TASKS
        for episode in range(4)
        for robot, slow in (("serd", 1.0), ("irl", 1.5))
    )
    learned = pd.DataFrame([{"place": "ring", "repetition": 0, "robot": "serd"}])
    for task in TASKS:
        learned[[f"{task} 0.05", f"{task} 0.5", f"{task} 0.95"]] = [10.5, 11.0, 20.0]
    summary = summary_of(study, drives).set_index(["task", "robot"])
    assert summary.loc[("train", "irl"), "mean_s"] == pytest.approx(16.5)
    compared = paired(study, drives)
    np.testing.assert_allclose(compared["mean_difference"], -5.0)
    np.testing.assert_allclose(compared["ratio"], 16.5 / 11.5)
    held = forecasts(drives, learned)
    assert held["within"].tolist() == [0.75, 0.75]


def test_the_demo_drives_eight_paired_seeds_in_one_place():
    settings = robots_settings(config=YAML.with_stem("robots_study_demo"))
    assert {name for name, _ in settings.parts} == {"ring"}
    assert len(settings.parts) * settings.places["ring"].drives == 8
    assert len(MODEL_NAMES) == 4


def task_grid(scenario):
    return task_with(Demonstrated(scenario, None, 0.99), ("goal",)).problem.grid
