"""Those who decide: the scripted expert and the policy."""

from dataclasses import replace

import numpy as np
import pytest

from serd_bag.errors import FileError
from serd_core.grid.grid import Action
from serd_core.policies.solved_policy import optimal_policy
from serd_files.errors import USER_ERRORS
from serd_files.grid_file import flow_picture
from serd_files.model_file import load_model
from serd_sim.drivers.catalogue import (
    STYLES,
    RouteCosts,
    ScriptedExpert,
    VariedExpert,
    costs_to_go,
    move_costs,
)
from serd_sim.drivers.policy_driver import PolicyDriver, model_driver
from serd_sim.drivers.strategy import learned_dynamics, problem_of_model
from serd_sim.scenario.grid import flow_of, goal_states_of, grid_of
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)


def decide(driver, observation):
    """What a driver decides in the cell of an observation."""
    return driver.decide(observation, GRID.state_at(observation.x_m, observation.y_m))


def test_without_flow_or_likes_the_cost_to_go_is_the_manhattan_distance():
    costs = RouteCosts(lane_dislike=0.0, turning=0.0)
    still = np.full(GRID.n_states, -1)
    move = move_costs(GRID, still, costs, np.random.default_rng(1))
    goal = goal_states_of(HALLWAY, GRID)
    to_go = costs_to_go(GRID, move, goal, 0.0)
    assert to_go[GRID.state_at(0.5, 0.5), Action.WAIT] == pytest.approx(11 + 16)


def test_the_expert_first_crosses_to_the_right_then_chooses_a_lane_and_goes_up():
    expert, moves = ScriptedExpert(HALLWAY, seed=1), {}
    for episode in range(30):
        for place in ((0.5, 1.5), (4.5, 9.5)):
            expert.begin(episode)
            moves.setdefault(place, []).append(decide(expert, observation_at(*place)))
    low, high = (np.array(each) for each in moves.values())
    assert np.mean(low == Action.EAST) > 0.8
    assert np.mean(high == Action.NORTH) > 0.4
    assert np.mean(high == Action.SOUTH) < 0.1


def test_the_expert_sometimes_waits_for_somebody_in_the_next_cell_but_never_for_long():
    expert = ScriptedExpert(HALLWAY, seed=2)
    people = [[x + 0.5, y + 0.5] for x in range(6) for y in range(8, 12)]
    observation = observation_at(4.5, 9.5, people=people)
    waits = [decide(expert, observation) == Action.WAIT for _ in range(300)]
    assert 0.1 < np.mean(waits) < 0.4
    assert "111" not in "".join(str(int(wait)) for wait in waits)


def test_the_varied_expert_takes_every_style_in_turn_of_chance_and_repeats_itself():
    expert = VariedExpert(HALLWAY, seed=2)
    chosen = [expert.begin(episode) or expert.style for episode in range(40)]
    assert set(chosen) == set(STYLES)
    expert.begin(7)
    assert expert.style == chosen[7]


HERE, THERE = GRID.state_at(2.5, 2.5), GRID.state_at(3.5, 2.5)
SEEN = observation_at(2.5, 2.5)


def driver_by(*probabilities, **settings):
    """A driver with the same probabilities (wait, north, east, south, west) in every cell."""
    return PolicyDriver(GRID, np.tile(probabilities, (GRID.n_states, 1)), **settings)


def decided(driver, n, *, blocked):
    """n decisions in a cell where the robot was blocked, or each after another cell."""
    actions = []
    for _ in range(n):
        actions.append(driver.decide(SEEN, HERE))
        if not blocked:
            driver.decide(SEEN, THERE)
    return actions


@pytest.mark.parametrize("blocked", [False, True])
def test_a_stochastic_policy_draws_with_its_probabilities_and_repeats_per_episode(blocked):
    driver = driver_by(0.0, 0.7, 0.3, 0.0, 0.0, seed=3, greedy=False)
    draws = []
    for _ in range(2):
        driver.begin(5)
        draws.append(decided(driver, 400, blocked=blocked))
    assert draws[0] == draws[1]
    assert np.mean(np.array(draws[0]) == Action.NORTH) == pytest.approx(0.7, abs=0.07)


def test_of_equally_likely_actions_one_is_drawn_by_the_seed():
    def draws(seed):
        driver = driver_by(0.1, 0.4, 0.4 - 1e-12, 0.1 + 1e-12, 0.0, seed=seed)
        return [driver.begin(episode) or driver.decide(SEEN, HERE) for episode in range(200)]

    assert set(draws(1)) == {Action.NORTH, Action.EAST}
    assert np.mean(np.array(draws(1)) == Action.NORTH) == pytest.approx(0.5, abs=0.11)
    assert draws(1) == draws(1) != draws(2)


@pytest.mark.parametrize(
    ("probabilities", "first", "then"),
    [
        ((0.0, 0.5, 0.5, 0.0, 0.0), Action.NORTH, [Action.EAST, Action.NORTH] * 3),
        ((0.0, 0.5, 0.0, 0.5, 0.0), Action.NORTH, [Action.NORTH] * 6),
        ((0.3, 0.3, 0.3, 0.1, 0.0), Action.EAST, [Action.NORTH, Action.EAST] * 3),
    ],
)
def test_of_equally_likely_directions_a_robot_turns_to_the_side_and_never_back(
    probabilities, first, then
):
    driver = driver_by(*probabilities)
    episode = 0
    while driver.decide(SEEN, HERE) != first:
        episode += 1
        driver.begin(episode)
    assert [driver.decide(SEEN, state) for state in [THERE, HERE] * 3] == then


def test_a_robot_that_turns_slowly_is_not_blocked_until_it_has_turned():
    driver, north = driver_by(0.0, 0.6, 0.4, 0.0, 0.0), np.pi / 2

    def seen(yaw_rad, rate_radps):
        return replace(SEEN, pose=(2.5, 2.5, yaw_rad), yaw_rate_radps=rate_radps)

    # Half a turn at 0.25 rad/s takes three decisions of 4 s; then it does not move.
    ways = [seen(north - np.pi + turned, 0.25) for turned in (0.0, 1.0, 2.0, 3.0)]
    assert {driver.decide(each, HERE) for each in ways} == {Action.NORTH}
    assert driver.decide(seen(north, 0.0), HERE) == Action.EAST
    # One that turns away, or has stopped turning, is blocked.
    for rate_radps, turned in ((-0.25, -1.0), (0.0, 1.0)):
        driver.begin(0)
        assert driver.decide(seen(0.0, 0.25), HERE) == Action.NORTH
        assert driver.decide(seen(turned, rate_radps), HERE) == Action.EAST


def test_a_blocked_robot_tries_what_the_policy_likes_next_and_then_all_again():
    order = decided(driver_by(0.05, 0.5, 0.3, 0.1, 0.05), 10, blocked=True)
    assert order[:3] == order[5:8] == [Action.NORTH, Action.EAST, Action.SOUTH]
    assert set(order[3:5]) == {Action.WAIT, Action.WEST}
    order = decided(driver_by(0.4, 0.6, 0.0, 0.0, 0.0), 10, blocked=True)
    assert order[:2] == [Action.NORTH, Action.WAIT]
    assert order.count(Action.WAIT) == 2, "it does not wait for ever"


def test_a_blocked_robot_of_a_policy_with_one_action_takes_any_other_way_but_no_wall():
    corner = GRID.state_at(0.5, 0.5)
    driver = driver_by(0.0, 1.0, 0.0, 0.0, 0.0)
    assert [driver.decide(SEEN, corner) for _ in range(4)] == [Action.NORTH, Action.EAST] * 2
    seen = {
        tuple(decided(driver_by(0, 1, 0, 0, 0, seed=seed), 4, blocked=True)) for seed in range(9)
    }
    assert len(seen) > 1
    assert all(set(order) == set(Action) - {Action.WAIT} for order in seen)


def test_a_robot_that_is_two_cells_away_or_begins_again_takes_the_likeliest_action_again():
    driver = driver_by(0.0, 0.6, 0.4, 0.0, 0.0)
    assert decided(driver, 2, blocked=True) == [Action.NORTH, Action.EAST]
    driver.decide(SEEN, THERE)
    driver.decide(SEEN, GRID.state_at(4.5, 2.5))
    driver.decide(SEEN, THERE)
    assert decided(driver, 2, blocked=True) == [Action.NORTH, Action.EAST]
    driver.begin(1)
    assert driver.decide(SEEN, HERE) == Action.NORTH


@pytest.mark.parametrize("seed", range(3))
def test_two_cells_that_block_each_other_are_left_by_a_third_way(seed):
    """Both prefer north, where somebody stands, and then the way to the other one."""
    probabilities = np.tile([0.0, 1.0, 0.0, 0.0, 0.0], (GRID.n_states, 1))
    probabilities[HERE] = [0.0, 0.5, 0.3, 0.1, 0.1]
    probabilities[THERE] = [0.0, 0.5, 0.1, 0.1, 0.3]
    driver = PolicyDriver(GRID, probabilities, seed=seed)
    way = [HERE]
    while len(way) < 20 and way[-1] in (HERE, THERE):
        action = driver.decide(SEEN, way[-1])
        way.append(way[-1] if action == Action.NORTH else int(GRID.neighbours[way[-1], action]))
    assert way[:5] == [HERE, HERE, THERE, THERE, HERE]
    assert len(way) == 6


def test_probabilities_that_do_not_sum_to_one_are_refused():
    with pytest.raises(USER_ERRORS, match="sum to 1 in every state"):
        PolicyDriver(GRID, np.ones((GRID.n_states, 5)))


def test_a_model_that_was_learned_under_another_flow_drives_by_that_flow(save_model_of):
    turned = (flow_of(HALLWAY, GRID) + 1) % 4 + 1
    usual = model_driver(str(save_model_of()), HALLWAY, seed=0)
    path = str(save_model_of(name="turned.yaml", flow=flow_picture(GRID, turned)))
    model, driver = load_model(path), model_driver(path, HALLWAY, seed=0)
    problem, _ = problem_of_model(path, model, HALLWAY, GRID)
    np.testing.assert_array_equal(problem.flow, turned)
    dynamics = learned_dynamics(path, model, problem)
    table = problem.mdp.transitions.local_probabilities(dynamics)
    best = optimal_policy(problem, model.weights, table).probabilities
    chosen, other = (
        [best[state, each.decide(SEEN, state)] for state in range(GRID.n_states)]
        for each in (driver, usual)
    )
    np.testing.assert_allclose(chosen, best.max(axis=1))
    assert 0 in other


FLOW = flow_of(HALLWAY, GRID)
NO_FLOW = np.full_like(FLOW, -1)
WITHOUT_NORM = ("goal", "inverse_wall_distance")


def planned(path, scenario=HALLWAY, **options):
    return problem_of_model(str(path), load_model(path), scenario, GRID, **options)


def test_the_weight_of_the_social_norm_counts_among_people_only(save_model_of):
    path = save_model_of()
    problem, model = planned(path)
    assert model == load_model(path)
    assert problem.feature_names == model.feature_names
    problem, model = planned(path, HALLWAY.with_pedestrian_count(0))
    assert problem.feature_names == model.feature_names == WITHOUT_NORM


@pytest.mark.parametrize("transferred", [False, True])
def test_the_norm_of_a_model_learned_without_flow_is_that_of_waiting_and_counts_nowhere(
    save_model_of, transferred
):
    path = save_model_of(flow=flow_picture(GRID, NO_FLOW))
    problem, model = planned(path, transferred=transferred)
    assert model.feature_names == problem.feature_names == WITHOUT_NORM
    assert (problem.flow == (FLOW if transferred else NO_FLOW)).all()


def test_a_model_of_the_norm_alone_is_refused_where_there_is_none(save_model_of):
    path = save_model_of(reward_weights={"social_norm": 1.0})
    with pytest.raises(FileError, match=rf"{path.name}: features must name at least one .*again"):
        planned(path, HALLWAY.with_pedestrian_count(0))
