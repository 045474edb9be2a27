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
)
from serd_app.learning import methods
from serd_app.learning.methods import fit_tied
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.policies.solved_policy import soft_policy
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


def test_lambda_is_the_best_on_validation_and_all_is_learned_again_from_the_subset(
    problem, trial, shipped_sets
):
    scores = {
        weight: validation_log_likelihood(
            problem, trial.validation, fit_tied(trial, trial.training, weight)
        )
        for weight in trial.settings.prior_weights
    }
    learned = mdce_serd(trial)
    assert learned.prior_weight == max(scores, key=scores.get)
    rows = list(candidate_rows(trial, shipped_sets))
    assert [row["prior_weight"] for row in rows] == list(scores)
    expected = list(scores.values())
    assert [row["validation_log_likelihood"] for row in rows] == pytest.approx(expected)
    again = fit_tied(trial, trial.decisions, learned.prior_weight)
    np.testing.assert_allclose(learned.reward_weights, again.reward_weights)


def test_a_large_lambda_makes_serd_irl(trial):
    tied = replace(trial, settings=with_weights(trial, (1e6,)))
    irl, serd = irl_by_likelihood(trial), mdce_serd(tied)
    np.testing.assert_allclose(serd.truth, irl.truth, atol=1e-3)
    np.testing.assert_allclose(serd.policy, irl.policy, atol=1e-2)


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
    for smaller, larger in pairwise(found):
        assert set(smaller.decisions.episodes) < set(larger.decisions.episodes)
    for each, size in zip(found, (2, 8, 20), strict=True):
        both = np.concatenate([each.training.episodes, each.validation.episodes])
        assert sorted(both) == sorted(each.decisions.episodes)
        assert (len(both), len(each.validation.episodes)) == (size, max(1, round(0.15 * size)))


def with_weights(trial, weights):
    return trial.settings.model_copy(update={"prior_weights": weights})


def log_likelihood(problem, trial, learned):
    return policy_log_likelihood(problem, trial.decisions, learned.policy)
