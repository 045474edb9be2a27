from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.arrival.chain import ArrivalByState, policy_chain, probability_of_ever_arriving
from serd_core.dynamics.transition_model import Transitions
from support.small_problems import room


def test_the_chain_of_a_policy_is_the_sum_over_its_actions():
    rng, problem = np.random.default_rng(0), room(3, 2, 5)
    policy, table = rng.dirichlet(np.ones(5), 6), rng.dirichlet(np.ones(5), 4)
    policy[5] = np.eye(5)[0]
    transitions = problem.mdp.transitions
    dense = Transitions(transitions, table).matrix.toarray().reshape(6, 5, 6)
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


def ever_arriving(chain, goals):
    goal = np.isin(np.arange(len(chain)), goals)
    return probability_of_ever_arriving(scipy.sparse.csr_array(np.asarray(chain, float)), goal)


def with_stays(ways_out):
    """A chain from its off-diagonal entries, staying as rounded as a policy's would be."""
    chain = np.array(ways_out, dtype=np.float64)
    np.fill_diagonal(chain, 0.0)
    np.fill_diagonal(chain, 1.0 - chain.sum(axis=1))
    return chain


def exact(chain, goals):
    """h of a chain that always ends in a goal or in the last state, by Gauss in fractions."""
    n = len(chain)
    inner = [s for s in range(n - 1) if s not in goals]
    rows = []
    for s in inner:
        out = {z: Fraction(float(chain[s, z])) for z in range(n) if z != s}
        row = [sum(out.values()) if z == s else -out[z] for z in inner]
        rows.append([*row, sum((out[goal] for goal in goals), Fraction(0))])
    for k, pivot in enumerate(rows):
        rows[k] = [entry / pivot[k] for entry in pivot]
        for i, other in enumerate(rows):
            if i != k:
                rows[i] = [a - other[k] * b for a, b in zip(other, rows[k], strict=True)]
    return [float(row[-1]) for row in rows], inner


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**6), n_states=st.integers(3, 9), rarest=st.integers(0, 40))
def test_random_chains_agree_with_exact_fractions_in_every_digit(seed, n_states, rarest):
    rng = np.random.default_rng(seed)
    chain = with_stays(10.0 ** rng.uniform(-rarest - 1, -1, size=(n_states, n_states)))
    chain[-1] = np.eye(n_states)[-1]
    wanted, inner = exact(chain, [0])
    np.testing.assert_allclose(ever_arriving(chain, [0])[inner], wanted, rtol=1e-12)


def test_chances_below_the_smallest_number_still_share_by_their_odds():
    """A line with a goal at one end and a trap at the other, each behind two steps of 1e-200."""
    rare = 1e-200
    line = np.zeros((7, 7))
    line[[1, 2, 3, 4, 5], [2, 3, 4, 3, 4]] = [1, 1, 0.5, 1, 1]
    line[3, 2] = 0.5
    line[[1, 2, 4, 5], [0, 1, 5, 6]] = [rare, rare, rare, 3 * rare]
    for goal, wanted in ((0, 0.25), (6, 0.75)):
        share = ever_arriving(with_stays(line), [goal])
        np.testing.assert_allclose(share[2:5], wanted, rtol=1e-12)


RARE = [[1 - 1e-17, 1e-17, 0], [0.5, 0.5 - 1e-17, 1e-17], [0, 0, 1]]
AWAY_FROM_GOAL = [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 0], [0, 0.5, 0.5, 0]]


@pytest.mark.parametrize(
    ("chain", "goals", "expected"),
    [
        (RARE, [2], [1, 1, 1]),
        (AWAY_FROM_GOAL, [1], [1, 1, 0, 0.5]),
        ([[0.5, 0.5], [1, 0]], [], [0, 0]),
    ],
)
def test_what_is_certain_is_exact_and_a_goal_absorbs(chain, goals, expected):
    np.testing.assert_array_equal(ever_arriving(chain, goals), expected)
