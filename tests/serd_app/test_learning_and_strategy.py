"""From decisions to a model file to a strategy, without ROS."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import FlowField, save_flow
from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.learning.checkpoint import LearnerMemory
from serd_app.learning.methods import FitProgress
from serd_app.learning.outcome import fit_of_file, learned_traps
from serd_app.learning.recipe import learn, task_in
from serd_core.arrival.arriving_policy import trap_states
from serd_core.ascent.ascent import Step
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.policies.solved_policy import optimal_policy, soft_policy
from serd_files.model_file import load_model
from serd_files.yaml_config import save_yaml_model
from serd_ros.nodes.learner import LearnerConfig
from serd_sim.drivers.strategy import load_strategy, start_distribution
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario

HALLWAY = load_scenario("hallway")
SHIPPED = Path(__file__).parents[2] / "bags" / "data" / "hallway" / "training"
TRUTH = np.array(
    [
        [0.05, 0.85, 0.04, 0.02, 0.04],
        [0.5, 0.3, 0.08, 0.04, 0.08],
        [0.2, 0.6, 0.08, 0.04, 0.08],
        [0.8, 0.05, 0.05, 0.05, 0.05],
    ]
)
CONFIG = LearnerConfig(bag="sampled", method="mdce_serd")


@pytest.fixture(scope="module")
def outcome():
    task = task_in(HALLWAY, CONFIG.discount)
    problem, models = task.problem, task.problem.mdp.transitions
    truth = models.parameters_from(TRUTH, 1.0, 5.0)
    expert = soft_policy(problem, np.array([5.0, 1.0, 0.2]), models.local_probabilities(truth))
    decisions = sample_timed_decisions(
        problem.mdp,
        expert.probabilities,
        truth,
        start_distribution(HALLWAY, "train"),
        n_episodes=20,
        n_steps=40,
        rng=np.random.default_rng(4),
    )
    reports = []
    return learn(task, decisions, CONFIG, reports.append), reports


def test_every_fit_reports_its_steps_and_the_weight_best_on_validation_is_used(outcome):
    found, reports = outcome
    weights = (*sorted(CONFIG.prior_weights), found.prior_weight)
    assert {(each.number, each.prior_weight) for each in reports} == set(enumerate(weights, 1))
    assert {each.total for each in reports} == {len(weights)}
    assert found.prior_weight == max(found.validation, key=lambda pair: pair[1])[0]
    assert reports[-1].weights.tolist() == found.fit.reward_weights.tolist()
    assert found.fit.converged
    header, *lines = found.trace_table().splitlines()
    assert header == "step,objective"
    assert [float(line.split(",")[1]) for line in lines] == list(found.fit.objective_trace)


def test_a_model_file_gives_the_fit_back_and_a_policy_that_leads_to_the_goal(outcome, tmp_path):
    path, fit = tmp_path / "model.yaml", outcome[0].fit
    save_yaml_model(path, outcome[0].model)
    strategy = load_strategy(str(path), HALLWAY, "optimal")
    back = fit_of_file(load_model(path), strategy.problem, fit.objective_trace)
    assert np.array_equal(back.reward_weights, fit.reward_weights)
    assert np.array_equal(back.outcome_probabilities, fit.outcome_probabilities)
    assert (back.objective, back.converged) == (fit.objective, fit.converged)
    model = strategy.problem.mdp.transitions
    local = model.outcomes.local_probabilities(back.parameters.truth)
    assert local == pytest.approx(fit.outcome_probabilities, abs=1e-12)
    means = [each.mean_s for each in outcome[0].model.outcome_models[:3]]
    assert np.exp(back.parameters.truth[model.means]) == pytest.approx(means)
    law, grid = strategy.law_from(start_distribution(HALLWAY, "train")), strategy.problem.grid
    assert (np.diff(law.cdf) >= 0).all()
    assert law.cdf[-1] > 0.9
    way_m = strategy.intended_path_m(grid.state_at(0.5, 0.5))
    assert np.abs(np.diff(way_m, axis=0)).sum(axis=1) == pytest.approx(grid.cell_size_m)
    assert grid.state_at(*way_m[-1]) in set(strategy.problem.goal_states.tolist())


def test_a_task_takes_the_flow_of_a_table_in_place_of_the_scenario_s(tmp_path):
    grid, own = grid_of(HALLWAY), task_in(HALLWAY, CONFIG.discount)
    turned, zeros = np.roll(own.problem.flow, 1), np.zeros((grid.n_states, 2), dtype=int)
    save_flow(tmp_path / "flow.csv", grid, FlowField(turned, zeros, *zeros.T))
    found = task_in(HALLWAY, CONFIG.discount, str(tmp_path / "flow.csv"))
    assert (found.own_flow, own.own_flow) == (True, False)
    assert found.problem.flow.tolist() == turned.tolist()


def first_episodes(number):
    times_s = HALLWAY.patience_s, HALLWAY.wait_s
    table, _ = demonstrations_of_bag(SHIPPED, grid_of(HALLWAY), *times_s)
    return table.select_episodes(table.episodes[:number])


def test_one_episode_gives_weights_that_are_finite_and_from_which_later_fits_come_back():
    task = task_in(HALLWAY, CONFIG.discount)
    one = learn(task, first_episodes(1), CONFIG)
    assert one.fit.converged
    assert np.abs(one.fit.reward_weights).max() < 100.0
    warm = learn(task, first_episodes(5), CONFIG, warm_weights=one.fit.reward_weights)
    cold = learn(task, first_episodes(5), CONFIG)
    assert warm.fit.converged
    assert warm.fit.reward_weights == pytest.approx(cold.fit.reward_weights, rel=0.01)


def test_the_memory_begins_with_the_last_fit_that_converged_and_no_candidate(outcome, tmp_path):
    memory, fit = LearnerMemory(HALLWAY, tmp_path / "state"), outcome[0].fit
    assert memory.start_remark == ""
    memory.save_learned(fit)
    assert memory.warm_weights.tolist() == fit.reward_weights.tolist()
    step = Step(7, 0.0, 1.0, 9, np.array([1.0, 2.0, 3.0, 0.5]))
    memory.save_progress(FitProgress(1, 2, 0.1, step))
    assert memory.warm_weights.tolist() == fit.reward_weights.tolist()
    memory.save_progress(FitProgress(2, 2, 0.1, step))
    assert memory.warm_weights.tolist() == [1.0, 2.0, 3.0]
    memory.save_learned(replace(fit, converged=False))
    assert memory.warm_weights is None


def test_cells_from_which_a_learned_policy_never_arrives_are_counted(outcome):
    found, _ = outcome
    problem, starts = task_in(HALLWAY, CONFIG.discount).problem, np.array([0, 0, 3])
    decisions = Decisions(np.array([0, 0, 1]), np.arange(3.0), starts, starts, starts)
    models, weights = problem.mdp.transitions, np.array([0.1, 0.0, -5.0])
    truth = models.parameters_from(found.fit.outcome_probabilities, 1.0, 5.0)
    counted = learned_traps(problem, decisions, weights, truth[None])
    greedy = optimal_policy(problem, weights, models.local_probabilities(truth))
    looping = trap_states(problem.grid.neighbours, greedy.greedy, problem.goal_states)
    assert counted.n_looping_cells == looping.sum() > 100
    assert (counted.n_starts, counted.n_looping_starts) == (2, looping[[0, 3]].sum())
    share = f"{counted.n_looping_cells} of 176 cells ({counted.n_looping_cells / 176:.0%}), 2 of"
    assert share in counted.sentence()
    assert "the way of least expected time" in counted.sentence()
    assert found.values()["n_looping_cells"] == found.traps.n_looping_cells < 5
