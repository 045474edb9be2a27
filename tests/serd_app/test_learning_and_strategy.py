"""From decisions to a model file to a strategy, without ROS."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.demonstrations import Demonstrations, demonstrations_of_bag
from serd_app.demonstrations.grid.flow_field import FlowField, save_flow
from serd_app.errors import AppError
from serd_app.learning.checkpoint import LearnerMemory
from serd_app.learning.fit_data import FitProgress
from serd_app.learning.outcome import fit_of_file, outcome_files, save_outcome
from serd_app.learning.recipe import learn, task_in
from serd_app.navigation.strategy import load_strategy, start_distribution
from serd_app.places.kept_scenario import scenario_beside
from serd_core.ascent.ascent import Step
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.policies.solved_policy import soft_policy
from serd_ros.graph.configs import LearnerConfig
from sim.scenario.grid import grid_of, navigation_problem_of
from sim.scenario.scenario import load_scenario
from storage.errors import FileError
from storage.model_file import load_model
from storage.yaml_config import save_yaml_model

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
    problem = navigation_problem_of(HALLWAY, CONFIG.discount)
    expert = soft_policy(problem, np.array([5.0, 1.0, 0.2]), TRUTH)
    decisions = sample_decisions(
        problem.mdp,
        expert.probabilities,
        TRUTH,
        start_distribution(HALLWAY, "train"),
        n_episodes=20,
        n_steps=40,
        rng=np.random.default_rng(4),
    )
    reports = []
    task = task_in(HALLWAY, CONFIG.discount)
    return learn(task, Demonstrations(decisions), CONFIG, reports.append), reports


def test_every_fit_reports_its_steps_and_the_weight_best_on_validation_is_used(outcome):
    found, reports = outcome
    weights = (*sorted(CONFIG.prior_weights), found.prior_weight)
    reported = {(each.number, each.prior_weight) for each in reports}
    assert reported == set(enumerate(weights, start=1))
    assert {each.total for each in reports} == {len(weights)}
    assert found.prior_weight == max(found.validation, key=lambda pair: pair[1])[0]
    assert reports[-1].weights.tolist() == found.fit.reward_weights.tolist()
    assert found.fit.converged


def test_the_trace_lists_every_step_with_its_objective(outcome):
    lines = outcome[0].trace_table().splitlines()
    assert lines[0] == "step,objective"
    assert [float(line.split(",")[1]) for line in lines[1:]] == list(outcome[0].fit.objective_trace)


def test_a_model_file_gives_the_fit_and_the_policy_back(outcome, tmp_path):
    path, fit = tmp_path / "model.yaml", outcome[0].fit
    save_yaml_model(path, outcome[0].model)
    strategy = load_strategy(str(path), HALLWAY, "optimal")
    back = fit_of_file(load_model(path), strategy.problem, fit.objective_trace)
    assert np.array_equal(back.reward_weights, fit.reward_weights)
    assert np.array_equal(back.outcome_probabilities, fit.outcome_probabilities)
    assert (back.objective, back.converged) == (fit.objective, fit.converged)
    local = strategy.problem.outcome_models.local_probabilities(back.parameters.truth)
    assert local == pytest.approx(fit.outcome_probabilities, abs=1e-12)
    arrival = strategy.predicted_arrival(start_distribution(HALLWAY, "train"), 200)
    assert (np.diff(arrival.cdf) >= 0).all()
    assert arrival.cdf[-1] > 0.9


def test_the_intended_path_leads_through_neighbours_to_the_goal(outcome, tmp_path):
    path = tmp_path / "model.yaml"
    save_yaml_model(path, outcome[0].model)
    strategy = load_strategy(str(path), HALLWAY, "optimal")
    grid = strategy.problem.grid
    way_m = strategy.intended_path_m(grid.state_at(0.5, 0.5))
    assert np.abs(np.diff(way_m, axis=0)).sum(axis=1) == pytest.approx(grid.cell_size_m)
    assert grid.state_at(*way_m[-1]) in set(strategy.problem.goal_states.tolist())


def test_a_model_of_another_grid_is_refused_with_the_difference(outcome, tmp_path):
    path = tmp_path / "model.yaml"
    save_yaml_model(path, outcome[0].model)
    with pytest.raises(FileError, match="was made for another grid of the scenario 'hallway'"):
        load_strategy(str(path), load_scenario("corridor"), "optimal")


def test_a_task_takes_the_flow_of_a_table_in_place_of_the_scenario_s(tmp_path):
    grid, own = grid_of(HALLWAY), task_in(HALLWAY, CONFIG.discount)
    turned = np.roll(own.problem.flow, 1)
    zeros = np.zeros((grid.n_states, 2))
    count = np.zeros(grid.n_states, dtype=int)
    save_flow(tmp_path / "flow.csv", grid, FlowField(turned, zeros, zeros[:, 0], count))
    found = task_in(HALLWAY, CONFIG.discount, str(tmp_path / "flow.csv"))
    assert (found.own_flow, own.own_flow) == (True, False)
    assert found.problem.flow.tolist() == turned.tolist()


def first_episodes(number):
    everything = demonstrations_of_bag(SHIPPED, grid_of(HALLWAY), HALLWAY.decision_period_s)[0]
    table = everything.decisions
    return Demonstrations(table.select_episodes(table.episodes[:number]))


def test_one_episode_gives_weights_that_are_finite_and_from_which_later_fits_come_back():
    task = task_in(HALLWAY, CONFIG.discount)
    one = learn(task, first_episodes(1), CONFIG)
    assert one.fit.converged
    assert np.abs(one.fit.reward_weights).max() < 100.0
    warm = learn(task, first_episodes(5), CONFIG, warm_weights=one.fit.reward_weights)
    cold = learn(task, first_episodes(5), CONFIG)
    assert warm.fit.converged
    assert warm.fit.reward_weights == pytest.approx(cold.fit.reward_weights, rel=0.01)


def test_a_fit_that_found_no_end_is_no_start_for_the_next(outcome, tmp_path):
    memory = LearnerMemory(HALLWAY, tmp_path / "state")
    memory.save_learned(outcome[0].fit)
    assert memory.warm_weights.tolist() == outcome[0].fit.reward_weights.tolist()
    memory.save_learned(replace(outcome[0].fit, converged=False))
    assert memory.warm_weights is None


def test_weights_of_other_features_are_no_start_and_the_memory_states_the_reason(tmp_path):
    folder = tmp_path / "state"
    memory = LearnerMemory(HALLWAY, folder)
    assert memory.start_remark == ""
    kept = memory.folder.new().model_copy(update={"reward_weights": {"speed": 1.0}})
    memory.folder.save_decisions(first_episodes(1).decisions)
    memory.folder.save(kept)
    again = LearnerMemory(HALLWAY, folder)
    assert again.warm_weights is None
    assert again.start_remark.startswith(f"{folder}: reward_weights of its checkpoint must be")
    assert again.start_remark.endswith("got speed; the next fit begins without them")


def test_a_candidate_fit_leaves_the_weights_of_the_checkpoint_as_they_are(outcome, tmp_path):
    memory = LearnerMemory(HALLWAY, tmp_path / "state")
    memory.save_learned(outcome[0].fit)
    before = memory.warm_weights.tolist()
    step = Step(7, 0.0, 1.0, 9, np.array([1.0, 2.0, 3.0, 0.5]))
    memory.save_progress(FitProgress(1, 2, 0.1, step))
    assert memory.warm_weights.tolist() == before
    memory.save_progress(FitProgress(2, 2, 0.1, step))
    assert memory.warm_weights.tolist() == [1.0, 2.0, 3.0]


def test_a_scenario_that_is_not_built_in_is_kept_beside_the_model(outcome, tmp_path):
    own = HALLWAY.model_copy(update={"name": "my hallway"})
    path = tmp_path / "model.yaml"
    kept = replace(outcome[0], scenario_yaml=task_in(own, CONFIG.discount).scenario_yaml)
    save_outcome(path, kept, grid_of(HALLWAY))
    assert load_scenario(scenario_beside(path, "my hallway")) == own
    save_outcome(path, outcome[0], grid_of(HALLWAY))
    assert scenario_beside(path, "hallway") == "hallway"


def test_a_model_is_not_saved_beside_an_edited_scenario_that_is_another(outcome, tmp_path):
    path = tmp_path / "model.yaml"
    (tmp_path / "model.scenario.yaml").write_text("name: my own\n")
    with pytest.raises(AppError, match="edited or written by hand"):
        save_outcome(path, outcome[0], grid_of(HALLWAY))
    assert [each.name for each in tmp_path.iterdir()] == ["model.scenario.yaml"]


def test_files_beside_two_models_in_one_folder_are_apart():
    first, second = (set(outcome_files(Path(name)).values()) for name in ("a.yaml", "b.yaml"))
    assert not first & second
