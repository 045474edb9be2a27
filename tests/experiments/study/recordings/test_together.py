import numpy as np

from experiments.study.recordings.together import together


def test_tables_are_put_together_in_order_and_keep_their_episode_numbers(shipped_training):
    first = shipped_training.select_episodes([3, 4])
    second = shipped_training.select_episodes([0])
    both = together((first, second))
    assert len(both) == len(first) + len(second)
    np.testing.assert_array_equal(both.episode[: len(first)], first.episode)
    np.testing.assert_array_equal(both.state[len(first) :], second.state)
    assert both.source == first.source
