"""The learners of the study, on the recorded demonstrations that come with the project."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from lab.experiments.study.fits.fitting import candidate_rows, trials
from lab.experiments.study.fits.methods import (
    METHODS,
    behavioural_cloning,
    by,
    irl_with_true_dynamics,
    learned_from_fit,
)
from serd_app.learning import methods
from serd_app.learning.methods import fit_tied
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.policies.solved_policy import optimal_policy, soft_policy
from serd_core.selection.evaluation import policy_log_likelihood, validation_log_likelihood

mdce_serd, serd_coupled, serd_free, irl_by_likelihood, relative_entropy_irl = map(
    by,
    (
        methods.mdce_serd,
        methods.mdce_serd_coupled,
        methods.mdce_serd_free,
        methods.mdce_irl,
        methods.relative_entropy_irl,
    ),
)

#: A robot that is held up more than in any demonstration.
REFERENCE = np.array(
    [
        [0.40, 0.57, 0.01, 0.01, 0.01],
        [0.70, 0.27, 0.01, 0.01, 0.01],
        [0.60, 0.37, 0.01, 0.01, 0.01],
        [0.96, 0.01, 0.01, 0.01, 0.01],
    ]
)


@pytest.fixture(scope="module")
def trial(study, shipped_sets):
    (found,) = trials(study, shipped_sets.training, (8,), REFERENCE, repetition=0)
    return found


def test_actions_are_predicted_by_the_belief_and_the_robot_plans_by_the_truth(problem, trial):
    weights, truth = np.array([4.0, 1.0, -0.2]), estimate_dynamics(problem, trial.decisions)
    found = methods.mdce_serd_free(trial).fit
    fit = replace(
        found,
        parameters=replace(found.parameters, reward=weights),
        outcome_probabilities=truth,
        believed_outcome_probabilities=REFERENCE,
    )
    learned = learned_from_fit(problem, fit, prior_weight=3.0)
    believed = soft_policy(problem, weights, REFERENCE).probabilities
    np.testing.assert_allclose(learned.policy, believed)
    np.testing.assert_array_equal(learned.greedy, optimal_policy(problem, weights, truth).greedy)
    assert np.abs(learned.policy - soft_policy(problem, weights, truth).probabilities).max() > 0.1
    assert learned.prior_weight == 3.0


def test_irl_keeps_the_dynamics_it_is_given(problem, trial):
    estimate = estimate_dynamics(problem, trial.decisions)
    np.testing.assert_allclose(irl_by_likelihood(trial).truth, estimate, atol=1e-6)
    np.testing.assert_allclose(irl_with_true_dynamics(trial).truth, REFERENCE, atol=1e-6)


def test_a_free_belief_leaves_the_truth_to_the_observed_moves(problem, trial):
    learned = serd_free(trial)
    np.testing.assert_allclose(
        learned.truth, estimate_dynamics(problem, trial.decisions), atol=1e-3
    )
    by_truth = soft_policy(problem, learned.reward_weights, learned.truth).probabilities
    assert np.abs(learned.policy - by_truth).max() > 0.05


def test_a_coupled_belief_is_pulled_to_the_truth(problem, trial):
    tight = replace(trial, settings=with_weights(trial, (1e6,)))
    learned = serd_coupled(tight)
    by_truth = soft_policy(problem, learned.reward_weights, learned.truth).probabilities
    np.testing.assert_allclose(learned.policy, by_truth, atol=1e-3)


def test_lambda_is_the_best_on_validation_and_all_is_learned_again_from_the_subset(problem, trial):
    scores = {
        weight: validation_log_likelihood(
            problem, trial.validation, fit_tied(trial, trial.training, weight)
        )
        for weight in trial.settings.prior_weights
    }
    learned = mdce_serd(trial)
    assert learned.prior_weight == max(scores, key=scores.get)
    again = fit_tied(trial, trial.decisions, learned.prior_weight)
    np.testing.assert_allclose(learned.reward_weights, again.reward_weights)


def test_no_lambda_is_chosen_by_what_it_learned_from(monkeypatch, trial):
    seen = []

    def spy(trial, decisions, weight, on_step):
        seen.append(decisions)
        return fit_tied(trial, decisions, weight, on_step)

    monkeypatch.setattr(methods, "fit_tied", spy)
    mdce_serd(replace(trial, settings=with_weights(trial, (0.1, 10.0))))
    assert [len(each.episodes) for each in seen] == [len(trial.training.episodes)] * 2 + [8]
    assert seen[0] is trial.training
    assert seen[-1] is trial.decisions


def test_a_large_lambda_makes_serd_irl(trial):
    tied = replace(trial, settings=with_weights(trial, (1e6,)))
    irl, serd = irl_by_likelihood(trial), mdce_serd(tied)
    np.testing.assert_allclose(serd.truth, irl.truth, atol=1e-3)
    np.testing.assert_allclose(serd.policy, irl.policy, atol=1e-2)


def test_reirl_takes_the_choice_that_is_best_on_validation(problem, trial):
    useless = (1e3,)
    hopeless = relative_entropy_irl(replace(trial, settings=with_shares(trial, useless)))
    assert np.abs(hopeless.reward_weights).max() < 1e-6

    chosen = relative_entropy_irl(replace(trial, settings=with_shares(trial, (*useless, 0.03))))
    assert log_likelihood(problem, trial, chosen) > log_likelihood(problem, trial, hopeless)


def test_the_cloned_robot_does_what_was_done_most(trial):
    learned, subset = behavioural_cloning(trial), trial.decisions
    done = np.zeros((len(learned.greedy), 5), dtype=np.int64)
    np.add.at(done, (subset.state, subset.action), 1)
    second, first = np.sort(done, axis=1)[:, -2:].T
    clear = np.flatnonzero(first > second + 2)
    assert len(clear) > 3
    assert learned.greedy[clear].tolist() == done[clear].argmax(axis=1).tolist()


@pytest.mark.parametrize("name", list(METHODS))
def test_every_method_explains_what_it_has_seen_better_than_chance(problem, trial, name):
    learned = METHODS[name](trial)
    np.testing.assert_allclose(learned.policy.sum(axis=1), 1.0)
    np.testing.assert_allclose(learned.truth.sum(axis=1), 1.0)
    planned_for_nothing = soft_policy(problem, np.zeros(3), learned.truth).probabilities
    chance = policy_log_likelihood(problem, trial.decisions, planned_for_nothing)
    assert log_likelihood(problem, trial, learned) > chance + 1.0


def test_subsets_are_nested_and_split_without_overlap(study, shipped_sets):
    found = list(trials(study, shipped_sets.training, (2, 8, 20), REFERENCE, repetition=1))
    assert [len(each.decisions.episodes) for each in found] == [2, 8, 20]
    for smaller, larger in pairwise(found):
        assert set(smaller.decisions.episodes) < set(larger.decisions.episodes)
    for each in found:
        both = np.concatenate([each.training.episodes, each.validation.episodes])
        assert sorted(both) == sorted(each.decisions.episodes)
        assert len(each.validation.episodes) == max(1, round(0.15 * len(each.decisions.episodes)))


def test_candidates_are_learned_without_the_validation_episodes(problem, trial, shipped_sets):
    rows = list(candidate_rows(trial, shipped_sets))
    assert [row["prior_weight"] for row in rows] == list(trial.settings.prior_weights)
    fit = fit_tied(trial, trial.training, rows[0]["prior_weight"])
    expected = validation_log_likelihood(problem, trial.validation, fit)
    assert rows[0]["validation_log_likelihood"] == pytest.approx(expected)


def with_weights(trial, weights):
    return trial.settings.model_copy(update={"prior_weights": weights})


def with_shares(trial, shares):
    return trial.settings.model_copy(update={"reirl_threshold_shares": shares})


def log_likelihood(problem, trial, learned):
    return policy_log_likelihood(problem, trial.decisions, learned.policy)
