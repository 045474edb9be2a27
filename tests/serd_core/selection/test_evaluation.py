import numpy as np
import pytest

import serd_core as sc
from serd_core.selection.evaluation import select_weight, split_episodes

UNIFORM, NEVER = np.full((25, 5), 0.2), np.tile([1.0, 0, 0, 0, 0], (25, 1))


def test_log_likelihood_is_the_mean_over_decisions(gridworld):
    case = gridworld.problem, gridworld.decisions
    assert sc.policy_log_likelihood(*case, UNIFORM) == pytest.approx(np.log(0.2))
    assert sc.policy_log_likelihood(*case, NEVER) == -np.inf


@pytest.mark.parametrize(
    ("fit", "temperature", "options"),
    [
        (sc.fit_mdce_serd, None, {}),
        (sc.fit_pm_serd, None, {"initial_temperature": 2.0}),
        (sc.fit_mdce_irl_by_entropy, None, {"slack": 0.01}),
        (sc.fit_policy_matching, 2.0, {"inverse_temperature": 0.5}),
    ],
)
def test_the_policy_of_a_fit_follows_its_policy_model_and_carries_its_certificate(
    gridworld, fit, temperature, options
):
    problem, decisions = gridworld.problem, gridworld.decisions
    quick = {"initial_weights": np.ones(2), "ascent": sc.Lbfgs(max_steps=3)}
    found = fit(problem, decisions, **quick, **options)
    learned = found.reward_weights, found.outcome_probabilities
    if fit in (sc.fit_pm_serd, sc.fit_policy_matching):
        expected = sc.boltzmann_policy(problem, *learned, temperature or found.temperature)
    else:
        expected = sc.soft_policy(problem, *learned)
    np.testing.assert_allclose(sc.fitted_policy(problem, found), expected.probabilities)
    assert sc.validation_log_likelihood(problem, decisions, found) == pytest.approx(
        sc.policy_log_likelihood(problem, decisions, expected.probabilities)
    )
    assert 0 <= found.residual < 1e-6
    assert found.residual / (1 - problem.mdp.discount) <= found.error_bound < 1e-5


def test_a_prior_weight_is_selected_on_the_validation_set(make_gridworld):
    case = make_gridworld(side=3, n_episodes=12, n_steps=8)
    training, validation = split_episodes(case.decisions, 0.3, np.random.default_rng(1))
    assert len(validation.episodes) == 4
    assert not set(training.episodes) & set(validation.episodes)
    assert len(training) + len(validation) == len(case.decisions)
    quick = {"initial_weights": np.zeros(2), "ascent": sc.Lbfgs(gradient_tolerance=1e-4)}
    selection = select_weight(
        lambda w: sc.fit_mdce_serd(case.problem, training, prior=sc.KldPrior(w), **quick),
        lambda fit: sc.validation_log_likelihood(case.problem, validation, fit),
        [1.0, 1e-3, 30.0],
    )
    best = np.argmax(selection.scores)
    assert selection.weight == [1e-3, 1.0, 30.0][best]
    larger_of_equals = select_weight(lambda weight: weight, lambda _: 0.0, [2.0, 1.0])
    assert larger_of_equals.weight == 2.0


def test_scores_that_are_no_numbers_and_splits_of_one_episode_are_refused(gridworld):
    with pytest.raises(sc.SerdError, match=r"score of weight 2.0 must be a number, got nan"):
        select_weight(float, lambda fit: 1.0 if fit < 2 else np.nan, [2.0, 1.0])
    single = gridworld.decisions.select_episodes([0])
    with pytest.raises(sc.SerdError, match="at least two episodes to be split, got 1"):
        split_episodes(single, 0.5, np.random.default_rng(0))
