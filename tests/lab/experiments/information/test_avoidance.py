import numpy as np
import pandas as pd
import pytest

from lab.experiments.information.avoidance import (
    CASES,
    AvoidanceConfig,
    demonstrate,
    hallway,
    learn_one_set,
    measured_dynamics,
    summary_of,
)
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.navigation import AGAINST_FLOW, WITH_FLOW

CONFIG = AvoidanceConfig(n_repetitions=1, sizes=(1, 3))


@pytest.fixture(scope="module")
def rows():
    return pd.DataFrame(learn_one_set(CONFIG, 0))


def test_every_case_and_size_has_a_row_that_converged(rows):
    assert [tuple(key) for key in rows[["case", "size"]].to_numpy()] == [
        (case, size) for case in CASES for size in (1, 3)
    ]
    assert rows["converged"].all()
    ends = rows[["lower", "median", "upper"]].to_numpy()
    assert np.all((ends > 0) & (ends < 1) & (np.diff(ends, prepend=0.0) > 0))


def test_the_truth_is_what_the_hallway_study_measured(rows):
    truth = measured_dynamics()
    assert np.all(rows["truth"] == truth[AGAINST_FLOW, 1])
    np.testing.assert_allclose(truth.sum(axis=1), 1.0)
    assert truth[AGAINST_FLOW, 1] < truth[WITH_FLOW, 1]


def test_demonstrations_follow_the_measured_dynamics():
    config = AvoidanceConfig(sizes=(200,))
    features = CASES["no norm"][0]
    decisions = demonstrate(config, features, np.random.default_rng(0))
    estimate = estimate_dynamics(hallway(config, features), decisions)
    np.testing.assert_allclose(estimate[WITH_FLOW], measured_dynamics()[WITH_FLOW], atol=0.02)


def test_coverage_counts_intervals_that_hold_the_truth():
    holds = {"case": "norm", "size": 1, "truth": 0.5, "converged": True, "lower": 0.4, "upper": 0.6}
    others = {"median": 0.5, "moves": 0.0, "from_transitions": 0.0, "from_choices": 0.2}
    others |= {"shared": 0.1, "counted_lower": 0.1, "counted_median": 0.3, "counted_upper": 0.4}
    rows = [holds | others, holds | others | {"lower": 0.55}, holds | others | {"converged": False}]
    (summary,) = summary_of(pd.DataFrame(rows)).to_dict("records")
    assert summary["coverage"] == 0.5
    assert summary["counted_coverage"] == 0.0
    assert (summary["n"], summary["failed"]) == (2, 1)
