from pathlib import Path

import numpy as np
import pytest

from lab.experiments.study.hallway.figures.scenario import shortest_way, typical_way
from lab.experiments.study.recordings.demonstrations import sets_from_bags
from lab.experiments.study.recordings.reference import ExploringDriver
from lab.experiments.study.study import Study
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Action
from serd_files.errors import USER_ERRORS
from support.observations import observation_at


def test_an_explorer_takes_every_action_and_none_that_a_wall_blocks(problem):
    driver, rng = ExploringDriver(problem.grid, seed=1), np.random.default_rng(0)
    taken = []
    for state in rng.integers(problem.grid.n_states, size=600):
        action = driver.decide(observation_at(*problem.grid.centers_m[state]))
        taken.append(action)
        assert action == Action.WAIT or problem.grid.neighbours[state, action] != state
    assert set(taken) == set(Action)


def test_the_shortest_way_goes_round_the_corner(scenario):
    way = shortest_way(scenario, np.array([5.0, 10.0]), np.array([10.0, 18.0]), 0.25)
    length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
    # The inner corner is at (6, 16): no way is shorter than by the corner itself.
    by_corner = np.hypot(1, 6) + np.hypot(4, 2)
    assert np.hypot(5, 8) < by_corner <= length < by_corner + 0.6
    assert len(way) > 2


def test_the_shortest_way_in_the_open_is_straight(scenario):
    way = shortest_way(scenario, np.array([1.0, 1.0]), np.array([5.0, 14.0]), 0.25)
    np.testing.assert_array_equal(way, [[1.0, 1.0], [5.0, 14.0]])


def test_the_typical_way_is_the_demonstration_most_like_the_others(problem):
    ways = {0: [0, 1, 2], 1: [0, 1, 2, 3], 2: [6, 7, 8]}
    rows = [(episode, state) for episode, way in ways.items() for state in way]
    episode, state = np.array(rows).T
    decisions = Decisions(episode, np.arange(len(rows)), state, np.ones_like(state), state)
    way = typical_way(problem.grid, decisions)
    assert problem.grid.states_at(way)[0] == 0
    assert len(way) in (4, 5)


class TestSetsFromBags:
    @pytest.fixture
    def with_bags(self, settings, bags_folder):
        bags = tuple(str(bags_folder / name) for name in ("training", "test", "transfer"))
        return settings.model_copy(
            update={"demonstrations": settings.demonstrations.model_copy(update={"bags": bags})}
        )

    def test_episodes_are_split_anew_and_none_is_in_two_sets(self, with_bags, problem):
        first, second = (sets_from_bags(Study(with_bags, Path()), r) for r in (0, 1))
        for sets in (first, second):
            assert len(sets.training.episodes) == 20
            assert len(sets.test.episodes) == len(sets.transfer.episodes) == 10
            assert not np.intersect1d(sets.training.episodes, sets.test.episodes).size
            assert (problem.grid.centers_m[sets.transfer.state[0]] > [4.0, 0.0]).all()
        assert first.training.episodes.tolist() != second.training.episodes.tolist()

    def test_a_bag_given_twice_is_refused(self, with_bags):
        bags = with_bags.demonstrations.bags
        twice = with_bags.demonstrations.model_copy(update={"bags": (*bags, bags[0])})
        with pytest.raises(USER_ERRORS, match="599 of an episode that was there before"):
            sets_from_bags(Study(with_bags.model_copy(update={"demonstrations": twice}), Path()), 0)

    def test_too_few_episodes_are_refused(self, with_bags):
        short = with_bags.demonstrations.model_copy(update={"training": 21})
        with pytest.raises(
            USER_ERRORS, match="must hold 31 episodes for training and test, got 30"
        ):
            sets_from_bags(Study(with_bags.model_copy(update={"demonstrations": short}), Path()), 0)
