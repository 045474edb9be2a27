"""Predictions of a model that holds draws of its posterior."""

import numpy as np
import pytest

from serd_app.navigation.strategy import load_strategy, start_distribution
from serd_core.policies.solved_policy import soft_policy
from serd_files.model_file import ModelDraws, load_model
from serd_sim.scenario.scenario import load_scenario

HALLWAY = load_scenario("hallway")


@pytest.fixture
def tables(save_model_of):
    """Of two draws: one as the model, one in which everyone stays more often."""
    learned = load_model(save_model_of()).outcome_probabilities
    slow = 0.7 * learned + 0.3 * np.eye(5)[0]
    return np.array([learned, slow])


@pytest.fixture
def draws(tables):
    return ModelDraws(
        reward_weights=((5.0, 1.0, 0.0), (3.0, 0.5, -0.5)),
        learned=tuple(tuple(map(tuple, table)) for table in tables.tolist()),
    )


@pytest.mark.parametrize("kind", ["optimal", "soft"])
def test_arrival_is_averaged_over_the_draws_and_its_curve_by_each_is_known(
    kind, draws, tables, save_model_of
):
    found = load_strategy(str(save_model_of(draws=draws)), HALLWAY, kind)
    starts = start_distribution(HALLWAY, "train")
    arrival = found.predicted_arrival(starts, 60)
    one, other = arrival.cdf_draws
    assert np.allclose(arrival.cdf, (one + other) / 2)
    assert np.all(other <= one)
    assert np.max(one - other) > 0.2
    by_state = found.arrival
    n = min(60, by_state.n_periods)
    assert by_state.cdf[: n + 1] @ starts == pytest.approx(arrival.cdf[: n + 1], abs=1e-9)
    law = found.law_s(arrival)
    assert law.cdf == pytest.approx(law.cdf_draws.mean(axis=0))
    alone = load_strategy(str(save_model_of(name="alone.yaml")), HALLWAY, "optimal")
    if kind == "optimal":
        assert alone.predicted_arrival(starts, 60).cdf == pytest.approx(one)
        assert np.array_equal(found.policy.probabilities, alone.policy.probabilities)
    assert np.array_equal(found.outcome_draws, tables)


def test_the_soft_policy_is_the_average_over_the_draws(draws, tables, save_model_of):
    found = load_strategy(str(save_model_of(draws=draws)), HALLWAY, "soft")
    each = [
        soft_policy(found.problem, np.array(weights), table).probabilities
        for weights, table in zip(draws.reward_weights, tables, strict=True)
    ]
    assert found.policy.probabilities == pytest.approx((each[0] + each[1]) / 2)
    assert np.max(np.abs(each[0] - each[1])) > 0.05
