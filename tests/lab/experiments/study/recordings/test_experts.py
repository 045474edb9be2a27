import numpy as np
import pytest

from lab.experiments.study.recordings.experts import BELIEFS
from serd_core.grid.navigation import ACROSS_FLOW, AGAINST_FLOW, WAITING, WITH_FLOW

TRUTH = np.array(
    [
        [0.03, 0.94, 0.01, 0.01, 0.01],
        [0.43, 0.53, 0.015, 0.01, 0.015],
        [0.2, 0.78, 0.007, 0.006, 0.007],
        [0.93, 0.02, 0.02, 0.015, 0.015],
    ]
)


def test_beliefs_are_probabilities_and_err_about_the_crowd_alone():
    for make in BELIEFS.values():
        assert (make(TRUTH) >= 0).all()
        np.testing.assert_allclose(make(TRUTH).sum(axis=1), 1.0)
    for name in ("ignores_crowd", "fears_crowd"):
        belief = BELIEFS[name](TRUTH)
        np.testing.assert_array_equal(belief[[WITH_FLOW, WAITING]], TRUTH[[WITH_FLOW, WAITING]])
        assert not np.allclose(belief[AGAINST_FLOW], TRUTH[AGAINST_FLOW])
    assert BELIEFS["fears_crowd"](TRUTH)[ACROSS_FLOW, 0] == pytest.approx(0.65)
