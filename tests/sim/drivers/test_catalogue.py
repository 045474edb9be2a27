"""Those who decide: the scripted expert and the policy."""

import numpy as np
import pytest

from serd_core.grid.grid import Action
from serd_core.policies.solved_policy import optimal_policy
from serd_files.errors import USER_ERRORS
from serd_files.grid_file import flow_picture
from serd_files.model_file import load_model
from serd_sim.drivers.expert import ScriptedExpert
from serd_sim.drivers.expert_route import RouteCosts, costs_to_go, move_costs
from serd_sim.drivers.policy_driver import PolicyDriver, model_driver
from serd_sim.scenario.grid import flow_of, goal_states_of, grid_of, navigation_problem_of
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)


def test_without_flow_or_likes_the_cost_to_go_is_the_manhattan_distance():
    costs = RouteCosts(lane_dislike=0.0, turning=0.0)
    still = np.full(GRID.n_states, -1)
    move = move_costs(GRID, still, costs, np.random.default_rng(1))
    goal = goal_states_of(HALLWAY, GRID)
    to_go = costs_to_go(GRID, move, goal, 0.0)
    assert to_go[GRID.state_at(0.5, 0.5), Action.WAIT] == pytest.approx(11 + 16)


def test_the_expert_first_crosses_to_the_right_then_chooses_a_lane_and_goes_up():
    expert = ScriptedExpert(HALLWAY, seed=1)
    moves_low, moves_high = [], []
    for episode in range(30):
        expert.begin(episode)
        moves_low.append(expert.decide(observation_at(0.5, 1.5)))
        expert.begin(episode)
        moves_high.append(expert.decide(observation_at(4.5, 9.5)))
    assert np.mean([move == Action.EAST for move in moves_low]) > 0.8
    assert np.mean([move == Action.NORTH for move in moves_high]) > 0.4
    assert np.mean([move == Action.SOUTH for move in moves_high]) < 0.1


def test_the_expert_sometimes_waits_for_somebody_in_the_next_cell_but_never_for_long():
    expert = ScriptedExpert(HALLWAY, seed=2)
    people = [[x + 0.5, y + 0.5] for x in range(6) for y in range(8, 12)]
    observation = observation_at(4.5, 9.5, people=people)
    waits = [expert.decide(observation) == Action.WAIT for _ in range(300)]
    assert 0.1 < np.mean(waits) < 0.4
    assert "111" not in "".join(str(int(wait)) for wait in waits)


def test_a_greedy_policy_takes_the_likeliest_action():
    probabilities = np.tile([0.1, 0.2, 0.4, 0.2, 0.1], (GRID.n_states, 1))
    driver = PolicyDriver(GRID, probabilities)
    assert driver.decide(observation_at(2.5, 2.5)) == Action.EAST
    assert driver.decide(observation_at(-5.0, 2.5)) == Action.WAIT


def test_a_stochastic_policy_draws_with_its_probabilities_and_repeats_per_episode():
    probabilities = np.tile([0.0, 0.7, 0.3, 0.0, 0.0], (GRID.n_states, 1))
    driver = PolicyDriver(GRID, probabilities, seed=3, greedy=False)
    draws = []
    for _ in range(2):
        driver.begin(5)
        draws.append([driver.decide(observation_at(2.5, 2.5)) for _ in range(400)])
    assert draws[0] == draws[1]
    assert np.mean(np.array(draws[0]) == Action.NORTH) == pytest.approx(0.7, abs=0.07)


def test_probabilities_that_do_not_sum_to_one_are_refused():
    with pytest.raises(USER_ERRORS, match="sum to 1 in every state"):
        PolicyDriver(GRID, np.ones((GRID.n_states, 5)))


def test_a_model_that_was_learned_under_another_flow_drives_by_that_flow(save_model_of):
    hallway = load_scenario("hallway")
    grid = grid_of(hallway)
    flow = flow_of(hallway, grid)
    turned = (flow + 1) % 4 + 1
    usual = model_driver(str(save_model_of()), hallway, seed=0)
    path = str(save_model_of(name="turned.yaml", flow=flow_picture(grid, turned)))
    model, driver = load_model(path), model_driver(path, hallway, seed=0)
    problem = navigation_problem_of(hallway, model.discount, model.feature_names, turned)
    best = optimal_policy(problem, model.weights, model.outcome_probabilities).probabilities
    seen = [observation_at(*center) for center in grid.centers_m]
    assert [driver.decide(each) for each in seen] == best.argmax(axis=1).tolist()
    assert [driver.decide(each) for each in seen] != [usual.decide(each) for each in seen]
