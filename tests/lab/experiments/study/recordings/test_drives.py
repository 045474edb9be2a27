import numpy as np

from lab.experiments.study.recordings.reference import ExploringDriver
from serd_core.grid.grid import Action
from support.observations import observation_at


def test_an_explorer_takes_every_action_and_none_that_a_wall_blocks(problem):
    driver, rng = ExploringDriver(problem.grid, seed=1), np.random.default_rng(0)
    taken = []
    for state in rng.integers(problem.grid.n_states, size=600):
        action = driver.decide(observation_at(*problem.grid.centers_m[state]), state)
        taken.append(action)
        assert action == Action.WAIT or problem.grid.neighbours[state, action] != state
    assert set(taken) == set(Action)
