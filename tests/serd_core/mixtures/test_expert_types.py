from math import factorial

import numpy as np
import pytest

from serd_core.bayes.laplace import laplace
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mixtures.evidence import share_of_order
from serd_core.mixtures.expectation_maximisation import EmSettings, expectation_maximisation
from serd_core.mixtures.expert_types import (
    TypeChoice,
    choose_expert_types,
    fit_expert_types,
)
from serd_core.mixtures.pace import has_enough_times, pace_of_types, times_in_cells
from serd_core.posterior.beliefs import BeliefAroundTruth, TiedBelief
from serd_core.selection.evaluation import adjusted_rand_index
from support.small_problems import gridworld_truth

FEW = EmSettings(n_starts=3)


@pytest.fixture(scope="module")
def known(make_mixed):
    """Two types of experts who give four episodes each."""
    return make_mixed([(3.0, 3.0), (-3.0, 3.0)], experts=6, episodes=4)


@pytest.fixture(scope="module")
def choice(known) -> TypeChoice:
    return choose_expert_types(known.problem, known.decisions, experts=known.experts, settings=FEW)


def true_types(case):
    """(E,) of the experts."""
    return case.types[:: len(case.types) // len(np.unique(case.experts))]


def test_two_of_two_types_are_recovered(known, choice):
    found = choice.chosen
    assert found.converged
    assert found.n_types == 2
    assert adjusted_rand_index(found.type_of_unit, true_types(known)) == 1.0
    by_light = found.reward_weights[np.argsort(-found.reward_weights[:, 0])]
    deviations = found.reward_deviations[np.argsort(-found.reward_weights[:, 0])]
    assert np.all(np.abs(by_light - known.weights) < 4 * deviations)
    assert np.all(np.diff(found.shares) <= 0)
    np.testing.assert_allclose(found.shares.sum(), 1.0)


def test_one_type_is_chosen_where_there_is_one(make_mixed):
    case = make_mixed([(3.0, 3.0)], experts=12)
    assert choose_expert_types(case.problem, case.decisions, settings=FEW).chosen.n_types == 1


def test_one_type_is_the_plain_fit_with_its_evidence(known):
    plain = fit_mdce_serd(known.problem, known.decisions)
    found = fit_expert_types(known.problem, known.decisions, 1)
    np.testing.assert_allclose(found.reward_weights[0], plain.reward_weights, rtol=1e-4)
    evidence = laplace(known.problem, known.decisions, plain).log_evidence
    assert found.log_evidence == pytest.approx(evidence, abs=1e-3)
    likelihood = plain.policy_log_likelihood + plain.dynamics_log_likelihood
    assert found.log_likelihood == pytest.approx(likelihood, abs=1e-2)


def test_no_step_of_em_lowers_the_log_posterior(choice):
    for each in choice.candidates:
        assert len(each.trace) > 1
        assert np.all(np.diff(each.trace) >= -1e-9 * np.abs(each.trace[0]))
        assert each.objective.evaluate(each.mode)[0] >= each.objective.evaluate(each.mode * 0.99)[0]


def test_em_rises_from_any_start(choice):
    objective = choice.candidates[1].objective
    rng = np.random.default_rng(2)
    for _ in range(3):
        start = rng.normal(size=objective.space.size)
        trace = expectation_maximisation(objective, start, 5).trace
        assert np.all(np.diff(trace) >= 0)
        assert trace[-1] > trace[0]


def test_the_laplace_evidence_of_far_types_counts_all_their_orders(choice):
    two = choice.candidates[1]
    assert share_of_order(two.objective.space, two.mode, two.root) > 0.99


def test_equal_types_count_one_order_of_them(choice):
    space = choice.candidates[1].objective.space
    parameters = choice.candidates[1].point.parameters
    equal = space.of((parameters[0],) * 2, np.log([0.5, 0.5]))
    share = share_of_order(space, equal, 0.1 * np.eye(space.size))
    assert share == pytest.approx(1 / factorial(2), abs=1e-9)


def test_a_type_without_enough_episodes_is_not_chosen(choice):
    best = choice.chosen
    strict = TypeChoice(choice.candidates, minimum_episodes=best.n_episodes.min() + 1.0)
    assert strict.chosen.n_types == 1
    assert best.n_episodes.sum() == pytest.approx(48.0)


def test_bic_and_icl_are_their_formulas(choice):
    found = choice.candidates[1]
    size = len(found.mode)
    assert found.bic == pytest.approx(found.log_likelihood - size / 2 * np.log(12))
    r = found.responsibilities
    entropy = -np.sum(r * np.log(np.maximum(r, 1e-300)))
    assert found.icl == pytest.approx(found.bic - entropy)
    assert entropy >= 0


def test_held_out_experts_are_more_likely_under_two_types_than_under_one(make_mixed, choice):
    other = make_mixed([(3.0, 3.0), (-3.0, 3.0)], experts=6, episodes=4, seed=9)
    one, two = (
        each.unit_log_likelihoods(other.decisions, other.experts) for each in choice.candidates[:2]
    )
    assert two[0].sum() > one[0].sum() + 10
    of_type = two[1][:, choice.chosen.type_of_unit[0]]
    assert np.sum((of_type > 0.5) == (true_types(other) == 0)) >= 11


def test_types_may_have_beliefs_of_their_own(known):
    found = fit_expert_types(
        known.problem,
        known.decisions,
        2,
        experts=known.experts,
        belief=BeliefAroundTruth(),
        settings=EmSettings(n_starts=1),
    )
    assert found.converged
    assert found.believed_outcome_probabilities.shape == (2, 9, 5)
    assert adjusted_rand_index(found.type_of_unit, true_types(known)) >= 0.9
    assert np.isfinite(found.log_evidence)


def test_types_that_differ_in_their_belief_alone_are_recovered(make_mixed):
    """Same rewards; one type knows the world, the other takes the terrains for each other."""
    truth = gridworld_truth()
    wrong = np.concatenate([truth[:1], truth[5:], truth[1:5]])
    case = make_mixed([(0.5, 4.0)] * 2, experts=6, episodes=8, beliefs=(truth, wrong))
    tied, near = (
        choose_expert_types(
            case.problem, case.decisions, experts=case.experts, belief=belief, settings=FEW
        ).chosen
        for belief in (TiedBelief(), BeliefAroundTruth())
    )
    assert near.converged
    assert near.n_types == 2
    assert near.log_evidence > tied.log_evidence + 10
    assert adjusted_rand_index(near.type_of_unit, true_types(case)) == 1.0
    drawn = near.draws(np.random.default_rng(0), 400)
    ahead = np.arange(1, 9), np.tile(np.arange(1, 5), 2)
    away = near.outcome_probabilities[ahead] - truth[ahead]
    assert np.all(np.abs(away) < 4 * drawn[0].outcome_probabilities.std(axis=0)[ahead])
    for expert, belief in ((0, truth), (6, wrong)):
        number = near.type_of_unit[expert]
        away = near.believed_outcome_probabilities[number][ahead] - belief[ahead]
        deviations = drawn[number].believed_outcome_probabilities.std(axis=0)[ahead]
        assert np.all(np.abs(away) < 4 * deviations)
        assert (
            np.corrcoef(near.believed_outcome_probabilities[number][ahead], belief[ahead])[0, 1]
            > 0.7
        )


def test_draws_have_shared_dynamics_and_rewards_around_the_mode(choice):
    first, second = choice.chosen.draws(np.random.default_rng(0), 400)
    np.testing.assert_array_equal(first.outcome_probabilities, second.outcome_probabilities)
    spread = choice.chosen.reward_deviations[0]
    assert np.all(np.abs(first.reward.mean(axis=0) - choice.chosen.reward_weights[0]) < spread)
    np.testing.assert_allclose(first.reward.std(axis=0), spread, rtol=0.3)


def test_the_type_of_a_slow_expert_has_a_long_pace(known, choice):
    slow = np.isin(known.decisions.episode, np.flatnonzero(known.types == 1))
    decisions = Decisions(
        **known.decisions.columns() | {"time_s": known.decisions.time_s * np.where(slow, 2.0, 1.0)}
    )
    of_slow = int(choice.chosen.type_of_unit[-1])
    ratios = []
    for each in (known.decisions, decisions):
        found = pace_of_types(choice.chosen, each, known.experts)
        ratios.append(found.factors[of_slow] / found.factors[1 - of_slow])
    # Twice as long; posterior means of few times shrink towards the usual pace.
    assert 1.5 < ratios[1] / ratios[0] < 2.05
    assert len(found.units) == 12


def test_times_in_cells_leave_out_the_first_and_last_cell_of_an_episode():
    state = np.array([3, 3, 4, 4, 4, 5, 7, 8, 9])
    following = np.array([3, 4, 4, 4, 5, 5, 8, 9, 9])
    episode = np.array([0, 0, 0, 0, 0, 0, 1, 1, 1])
    time_s = np.array([0.0, 1, 2, 3, 4, 5, 0, 1, 2])
    rows, dwell_s = times_in_cells(Decisions(episode, time_s, state, np.zeros(9, int), following))
    np.testing.assert_array_equal(rows, [4, 7])
    np.testing.assert_array_equal(dwell_s, [3.0, 1.0])


def test_the_adjusted_rand_index_is_that_of_a_case_by_hand():
    # Contingency [[2, 1], [0, 3]]: 4 pairs together; 6 by rows, 1 + 6 = 7 by columns, of 15.
    # Expected 6 * 7 / 15 = 2.8, highest 6.5: (4 - 2.8) / (6.5 - 2.8).
    first, second = [0, 0, 0, 1, 1, 1], [5, 5, 2, 2, 2, 2]
    assert adjusted_rand_index(first, second) == pytest.approx(1.2 / 3.7)
    assert adjusted_rand_index(first, [1, 1, 1, 0, 0, 0]) == 1.0
    assert adjusted_rand_index([0, 0, 0], [4, 4, 4]) == 1.0
    assert adjusted_rand_index([0, 0, 1, 1], [0, 1, 0, 1]) == pytest.approx(-0.5)


def test_bad_arguments_are_named(known):
    with pytest.raises(SerdError, match=r"from 1 to 7 \(48 experts or .*\), got 49"):
        fit_expert_types(known.problem, known.decisions, 49)
    with pytest.raises(SerdError, match=r"from 1 to 7 .*, got 8"):
        choose_expert_types(known.problem, known.decisions, most_types=8)
    wrong = np.arange(len(known.decisions))
    with pytest.raises(
        SerdError, match="experts must be one per episode, got 0 and 1 in episode 0"
    ):
        fit_expert_types(known.problem, known.decisions, 2, experts=wrong)
    with pytest.raises(SerdError, match="n_starts must be at least 1, got 0"):
        EmSettings(n_starts=0)
    with pytest.raises(SerdError, match="at least 2 labels, got 1"):
        adjusted_rand_index([0], [0])


def test_paces_are_measured_where_there_are_enough_times(known, choice):
    few = known.decisions.select(np.arange(3))
    assert has_enough_times(known.decisions)
    assert not has_enough_times(few)
    with pytest.raises(SerdError, match="must show at least 10 times in cells, got"):
        pace_of_types(choice.chosen, few)
