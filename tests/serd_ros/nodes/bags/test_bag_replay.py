"""bag_replay: the keys that change its rate."""

import pytest

from serd_app.teleop.terminal import ReplayKey
from serd_ros.graph.configs import FASTEST_RATE, SLOWEST_RATE
from support.nodes_in_process import node_in_process


@pytest.mark.parametrize(
    ("key", "last"), [(ReplayKey.FASTER, FASTEST_RATE), (ReplayKey.SLOWER, SLOWEST_RATE)]
)
def test_the_keys_change_the_rate_within_its_range(small_bag, key, last):
    with node_in_process("bag_replay", bag=str(small_bag()), paused=True) as running:
        running.node._apply([key] * 2000)
        assert running.node._rate == last
