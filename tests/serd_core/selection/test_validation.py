import numpy as np
import pytest

from serd_core.ascent.lbfgs import Lbfgs
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.priors.divergence import KldPrior
from serd_core.selection.evaluation import select_weight, split_episodes, validation_log_likelihood


def test_a_prior_weight_is_selected_on_the_validation_set(make_gridworld):
    case = make_gridworld(side=3, n_episodes=12, n_steps=8)
    training, validation = split_episodes(case.decisions, 0.3, np.random.default_rng(1))
    selection = select_weight(
        lambda weight: fit_mdce_serd(
            case.problem,
            training,
            initial_weights=np.zeros(2),
            prior=KldPrior(weight),
            ascent=Lbfgs(gradient_tolerance=1e-4),
        ),
        lambda fit: validation_log_likelihood(case.problem, validation, fit),
        [1.0, 1e-3, 30.0],
    )
    np.testing.assert_allclose(selection.weights, [1e-3, 1.0, 30.0])
    assert selection.scores[selection.best] == selection.scores.max()
    assert selection.weight == selection.weights[selection.best]
    assert selection.fit is selection.fits[selection.best]
    assert selection.converged.tolist() == [fit.converged for fit in selection.fits]


def test_splits_keep_episodes_whole(gridworld):
    training, validation = split_episodes(gridworld.decisions, 0.2, np.random.default_rng(0))
    assert len(validation.episodes) == 4
    assert not set(training.episodes) & set(validation.episodes)
    assert len(training) + len(validation) == len(gridworld.decisions)


def test_wrong_settings_are_refused_by_name(gridworld):
    rng = np.random.default_rng(0)
    with pytest.raises(SerdError, match="weights must hold at least one candidate"):
        select_weight(lambda _: None, lambda _: 0.0, [])
    with pytest.raises(SerdError, match="validation_share must be between 0 and 1, got 1"):
        split_episodes(gridworld.decisions, 1.0, rng)
    with pytest.raises(SerdError, match="at least two episodes to be split, got 1"):
        split_episodes(gridworld.decisions.select_episodes([0]), 0.5, rng)
    with pytest.raises(SerdError, match=r"score of weight 2.0 must be a number, got nan"):
        select_weight(lambda weight: weight, lambda fit: 1.0 if fit < 2 else np.nan, [2.0, 1.0])
