"""bag_replay is steered by services and by its rate."""

import pytest
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from serd_ros.convert.stamp import stamp_s
from serd_ros.errors import NodeError
from support.nodes_in_process import node_in_process


def test_a_step_publishes_the_next_message_of_a_replay_that_is_paused(small_bag):
    with node_in_process("bag_replay", bag=str(small_bag()), wait_s=0.0, paused=True) as running:
        before = running.published.total()
        assert running.call("step", None).success
        assert running.published.total() == before + 1
        running.call("pause", SetBool.Request(data=False))
        refused = running.call("step", None)
        assert (refused.success, "must be paused" in refused.message) == (False, True)
        assert running.published.total() == before + 1


def test_a_pause_stops_bag_time_and_the_rate_changes_it_from_now_on_within_its_range(small_bag):
    with node_in_process("bag_replay", bag=str(small_bag()), wait_s=0.0) as running:

        def set_rate(value):
            return running.node.set_parameters_atomically([Parameter("rate", value=value)])

        def bag_time_s():
            running.call_timers()
            return stamp_s(running.sent["clock"].clock)

        first_s = bag_time_s()
        running.call("pause", SetBool.Request(data=True))
        n_sent = running.published["robot_pose"]
        running.wait(3.0)
        assert (bag_time_s(), running.published["robot_pose"]) == (first_s, n_sent)
        assert running.sent["diagnostics"].status[0].message == "paused"
        running.call("pause", SetBool.Request(data=False))
        running.wait(0.1)
        assert bag_time_s() == pytest.approx(first_s + 0.1)
        assert set_rate(4.0).successful
        running.wait(0.1)
        assert bag_time_s() == pytest.approx(first_s + 0.5)
        assert not set_rate(-1.0).successful
        assert not set_rate(1e7).successful


def test_an_empty_part_of_a_bag_is_rejected_before_playing(small_bag):
    given = {"bag": str(small_bag()), "start_s": 99999.0}
    with (
        pytest.raises(NodeError, match=r"must hold a message to play, got none from 99999 s on"),
        node_in_process("bag_replay", **given),
    ):
        pass
