import numpy as np

from serd_core.arrival.chain import ArrivalByState, policy_chain
from support.small_problems import room


def test_the_chain_of_a_policy_is_the_sum_over_its_actions():
    rng, problem = np.random.default_rng(0), room(3, 2, 5)
    policy, table = rng.dirichlet(np.ones(5), 6), rng.dirichlet(np.ones(5), 4)
    policy[5] = np.eye(5)[0]
    transitions = problem.mdp.transitions
    dense = transitions.matrix(transitions.entries(table)).toarray().reshape(6, 5, 6)
    chain = policy_chain(problem.mdp, policy, table).toarray()
    np.testing.assert_allclose(chain, np.einsum("sa,sat->st", policy, dense))


def test_the_mean_is_that_of_the_law_cut_off_at_the_horizon_as_are_probabilities():
    cdf = np.array([[0.0, 1.0], [0.25, 1.0], [0.75, 1.0]])
    found = ArrivalByState(cdf, np.array([0.9, 1.0]))
    np.testing.assert_allclose(found.mean_steps, [0.25 * 1 + 0.5 * 2 + 0.25 * 2, 0.0])
    assert [found.within(n).tolist() for n in (-1, 1, 99)] == cdf[[0, 1, 2]].tolist()
    both = ArrivalByState.average([found, ArrivalByState(np.ones((3, 2)), np.ones(2))])
    np.testing.assert_allclose(both.cdf, (cdf + 1.0) / 2.0)
    np.testing.assert_allclose(both.arrival_probability, [0.95, 1.0])
