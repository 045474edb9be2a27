import numpy as np
import pytest

import serd_core as sc
from serd_core.demonstrations.decisions import state_action_counts
from serd_core.demonstrations.observations import observe
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from support.small_problems import sampled


def test_sampled_frequencies_approach_policy_and_dynamics(minimum_example):
    policy = np.array([[0.8, 0.2, 0.0], [0.0, 0.0, 1.0]])
    table = np.array([[1 / 3, 2 / 3], [0.9, 0.1]])
    decisions = sampled(minimum_example, policy, table, 20_000, 1, 0, [1.0, 0.0])
    counts = state_action_counts(decisions, 2, 3)
    assert counts[0, 0] / 20_000 == pytest.approx(0.8, abs=0.01)
    chose_a = decisions.action == 0
    assert decisions.next_state[chose_a].mean() == pytest.approx(2 / 3, abs=0.01)


def test_episodes_are_connected_and_end_where_nothing_leaves(gridworld, minimum_example):
    decisions = gridworld.decisions
    same = decisions.episode[1:] == decisions.episode[:-1]
    assert np.all(decisions.next_state[:-1][same] == decisions.state[1:][same])
    observe(gridworld.problem.mdp, decisions)
    policy = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    ended = sampled(minimum_example, policy, np.full((2, 2), 0.5), 50, 100)
    assert np.all(ended.state == 0)


def test_an_expert_that_stays_but_still_chooses_goes_on_deciding():
    """One state that both actions keep: nothing leaves it, but the choice there is informative."""
    mdp = Mdp(
        OutcomeModels(np.zeros((1, 2, 1), int), np.zeros((1, 2), int), np.ones((1, 2), bool), 1),
        0.9,
    )
    problem = sc.TabularProblem(mdp, np.ones((1, 2, 1)), ("constant",))
    decisions = sampled(problem, np.array([[0.25, 0.75]]), np.ones((1, 1)), 400, 10)
    assert len(decisions) == 4000
    assert decisions.action.mean() == pytest.approx(0.75, abs=0.03)


ENDED = sc.from_transitions(np.eye(2)[:, None], np.ones((2, 1)), discount=0.9).mdp
GIVEN = {"mdp": ENDED, "policy": np.ones((2, 1)), "start_distribution": [1.0, 0.0]}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        *[({"n_episodes": n}, "n_episodes must be a whole number of at") for n in (0, True, 3.0)],
        ({"n_steps": "5"}, "n_steps must be a whole number of at least 1, got '5'"),
        ({"mdp": None}, "mdp must be a Mdp object, got None; use for example problem.mdp"),
        ({"start_distribution": None}, "mdp must have a state that is not final .* got 2 final"),
    ],
)
def test_wrong_arguments_are_refused_by_name(change, sentence):
    given = GIVEN | {"n_episodes": 1, "n_steps": 1, "rng": np.random.default_rng(0)}
    assert len(sample_decisions(**given)) == 0
    with pytest.raises(SerdError, match=sentence):
        sample_decisions(**given | change)
