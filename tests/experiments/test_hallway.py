from dataclasses import replace

import numpy as np
import pytest

from experiments.hallway import LEARNERS, HallwayConfig, one_repetition
from experiments.hallway_data import HallwayData, together
from serd_core.errors import SerdError
from serd_core.policies.solved_policy import soft_policy
from serd_core.simulation import sample_decisions
from sim.scenario import load_scenario
from sim.scenario_grid import navigation_problem_of, start_states_of

TRUTH = np.array(
    [
        [0.08, 0.86, 0.02, 0.02, 0.02],
        [0.4, 0.4, 0.08, 0.04, 0.08],
        [0.15, 0.75, 0.04, 0.02, 0.04],
        [0.8, 0.1, 0.04, 0.02, 0.04],
    ]
)


@pytest.fixture(scope="module")
def sampled():
    """The built-in hallway with decisions sampled from a known expert instead of simulated."""
    scenario = load_scenario("hallway")
    problem = navigation_problem_of(scenario, 0.95)
    policy = soft_policy(problem, np.array([8.0, 1.5, -0.3]), TRUTH).probabilities

    def decisions(area, n_episodes, seed):
        starts = np.zeros(problem.grid.n_states)
        states = start_states_of(scenario, problem.grid, area)
        starts[states] = 1 / len(states)
        return sample_decisions(
            problem.mdp,
            policy,
            TRUTH,
            starts,
            n_episodes=n_episodes,
            n_steps=150,
            rng=np.random.default_rng(seed),
        )

    training = decisions("train", 8, 0)
    data = HallwayData(
        training, decisions("train", 20, 1), decisions("transfer", 20, 2), training, TRUTH
    )
    return problem, data


def test_every_learner_is_measured_on_every_size(sampled):
    problem, data = sampled
    config = HallwayConfig(sizes=(4, 8), prior_weights=(0.1, 1.0))
    rows = one_repetition(config, problem, data, 0)
    assert [(row["size"], row["learner"]) for row in rows] == [
        (size, learner) for size in (4, 8) for learner in LEARNERS
    ]
    serd = [row for row in rows if row["learner"] == "MDCE SERD"]
    assert all(np.isfinite(row["log_likelihood"]) for row in serd)
    assert serd[1]["log_likelihood"] > np.log(0.2)
    assert 0 <= serd[1]["dynamics_divergence"] < 0.5


def test_tables_are_put_together_in_order(sampled):
    _, data = sampled
    both = together((data.test, data.transfer))
    assert len(both) == len(data.test) + len(data.transfer)
    np.testing.assert_array_equal(both.state[: len(data.test)], data.test.state)


def test_sizes_beyond_the_recordings_are_refused():
    with pytest.raises(SerdError, match="sizes must be from 2 to n_training"):
        replace(HallwayConfig(), sizes=(2, 50))
