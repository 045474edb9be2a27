import numpy as np
import pandas as pd
import pytest

from lab.bench.worlds import confounded_world
from lab.experiments.standard_errors import ERRORS, experts, summary_of


def test_errors_are_compared_with_the_spread_of_estimates_and_intervals_with_their_mean():
    """Normal estimates whose standard deviations are 2 and 0.5, and errors of 1, 1/2 and 2 such."""
    rng, true = np.random.default_rng(0), np.array([2.0, 0.5])
    rows = [
        {"world": "w", "expert": "e", "demonstrations": 3, "kind": "weight", "number": number}
        | {"estimate": 7.0 + true[number] * rng.standard_normal()}
        | {name: share * true[number] for name, share in zip(ERRORS, (1.0, 0.5, 2.0), strict=True)}
        for _ in range(4000)
        for number in range(2)
    ]
    (found,) = summary_of(pd.DataFrame(rows)).to_dict("records")
    assert (found["numbers"], found["data sets"]) == (2, 4000)
    for name, share, held in zip(ERRORS, (1.0, 0.5, 2.0), (0.9, 0.589, 0.999), strict=True):
        assert found[f"{name} / sd"] == pytest.approx(share, rel=0.03)
        assert found[f"{name}: held"] == pytest.approx(held, abs=0.015)


def test_experts_other_than_the_first_are_not_soft_experts_of_the_world():
    world = confounded_world(np.random.default_rng(0))
    assumed, *others = experts(world).values()
    np.testing.assert_allclose(assumed, world.policy(world.problem))
    for policy in others:
        np.testing.assert_allclose(policy.sum(axis=1), 1.0)
        assert np.abs(policy - assumed).max() > 0.05
