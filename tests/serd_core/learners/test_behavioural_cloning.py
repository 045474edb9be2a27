import numpy as np
import pytest

from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.learners.behavioural_cloning import clone_behaviour


def three_times_a(action=(0, 0, 0)):
    return Decisions([0, 0, 0], [0, 1, 2], [0, 0, 0], list(action), [0, 0, 1])


def test_counts_are_smoothed_over_the_available_actions(minimum_example):
    policy = clone_behaviour(minimum_example, three_times_a(), pseudo_count=0.5)
    np.testing.assert_allclose(policy, [[3.5 / 4, 0.5 / 4, 0], [0, 0, 1]])


def test_without_smoothing_it_is_refused(minimum_example):
    with pytest.raises(SerdError, match="pseudo_count must be finite and above 0, got 0"):
        clone_behaviour(minimum_example, three_times_a(), pseudo_count=0)
