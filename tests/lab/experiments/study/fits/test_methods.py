"""The learners of the study, on the recorded demonstrations that come with the project."""

from itertools import pairwise

import numpy as np
import pytest

from lab.experiments.study.fits.fitting import candidate_rows, trials
from lab.experiments.study.fits.methods import METHODS, PREDICTORS, irl_with_true_dynamics
from serd_app.learning.methods import fit_tied
from serd_core.policies.solved_policy import soft_policy
from serd_core.selection.evaluation import policy_log_likelihood, validation_log_likelihood

#: A robot that is held up more than in any demonstration.
REFERENCE = np.array([[0.4, 0.57], [0.7, 0.27], [0.6, 0.37], [0.96, 0.01]])
REFERENCE = np.hstack([REFERENCE, np.full((4, 3), 0.01)])


@pytest.fixture(scope="module")
def found(study, shipped_sets):
    return list(trials(study, shipped_sets.training, (2, 8, 20), REFERENCE, repetition=0))


def test_subsets_are_nested_and_split_without_overlap(found):
    for smaller, larger in pairwise(found):
        assert set(smaller.decisions.episodes) < set(larger.decisions.episodes)
    for each, size in zip(found, (2, 8, 20), strict=True):
        both = np.concatenate([each.training.episodes, each.validation.episodes])
        assert sorted(both) == sorted(each.decisions.episodes)
        assert (len(both), len(each.validation.episodes)) == (size, max(1, round(0.15 * size)))


def test_lambda_is_the_best_on_validation_and_all_is_learned_again_from_the_subset(
    problem, found, shipped_sets
):
    trial = found[1]
    scores = {
        weight: validation_log_likelihood(
            problem, trial.validation, fit_tied(trial, trial.training, weight)
        )
        for weight in trial.settings.prior_weights
    }
    learned = METHODS["MDCE SERD"](trial)
    assert learned.prior_weight == max(scores, key=scores.get)
    rows = list(candidate_rows(trial, shipped_sets))
    assert [row["prior_weight"] for row in rows] == list(scores)
    expected = list(scores.values())
    assert [row["validation_log_likelihood"] for row in rows] == pytest.approx(expected)
    again = fit_tied(trial, trial.decisions, learned.prior_weight)
    np.testing.assert_allclose(learned.reward_weights, again.reward_weights)


def test_every_method_explains_what_it_has_seen_better_than_chance(problem, found):
    trial = found[1]
    for name, method in (METHODS | PREDICTORS).items():
        learned = method(trial)
        np.testing.assert_allclose(learned.policy.sum(axis=1), 1.0)
        np.testing.assert_allclose(learned.truth.sum(axis=1), 1.0)
        planned_for_nothing = soft_policy(problem, np.zeros(3), learned.truth).probabilities
        chance = policy_log_likelihood(problem, trial.decisions, planned_for_nothing)
        explained = policy_log_likelihood(problem, trial.decisions, learned.policy)
        assert explained > chance + 1.0, name
    np.testing.assert_allclose(irl_with_true_dynamics(trial).truth, REFERENCE, atol=1e-6)
