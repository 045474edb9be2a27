"""bag_replay plays what a bag holds."""

import pytest

from serd_ros.errors import NodeError
from support.nodes_in_process import node_in_process


def test_an_empty_part_of_a_bag_is_rejected_before_playing(small_bag):
    given = {"bag": str(small_bag()), "start_s": 99999.0}
    with (
        pytest.raises(NodeError, match=r"must hold a message to play, got none from 99999 s on"),
        node_in_process("bag_replay", **given),
    ):
        pass
