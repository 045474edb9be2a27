"""Mutated messages and bytes that are none, sent over DDS to a node that spins."""

import random
from contextlib import suppress

import pytest
import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.experimental import EventsExecutor
from rclpy.task import Future

from serd_ros.endpoints import qos
from support.message_mutations import mutated, mutated_cdr
from support.nodes_in_process import node_in_process
from support.valid_messages import valid_message
from support.waiting import wait_until

N_MESSAGES = 20


@pytest.mark.ros
@pytest.mark.slow
def test_bytes_that_are_no_message_end_no_node():
    rng = random.Random(3)
    with node_in_process("local_planner", lockstep=False, required_nodes=[""]) as running:
        sender = rclpy.create_node("sender")
        executor = EventsExecutor()
        executor.add_node(running.node)
        types = {each.topic_name: each.msg_type for each in running.node.subscriptions}
        latched = ("/e_stop_engaged", "/model")
        profiles = {topic: qos.LATCHED if topic in latched else qos.STATE for topic in types}
        publishers = {
            topic: sender.create_publisher(kind, topic, profiles[topic])
            for topic, kind in types.items()
        }

        def turn():
            executor.spin_until_future_complete(Future(), timeout_sec=0.02)

        def send_sound():
            for topic in types.keys() - {"/e_stop", "/episode"}:
                publishers[topic].publish(valid_message(topic.strip("/"), 200.0, types[topic]))
            turn()

        wait_until(lambda: all(each.get_subscription_count() for each in publishers.values()))
        for topic, publisher in publishers.items():
            valid = valid_message(topic.strip("/"), 100.0, types[topic])
            for number in range(N_MESSAGES):
                change = mutated_cdr if number % 2 else mutated
                with suppress(RCLError):  # the sender's own limits on sizes
                    publisher.publish(change(valid, rng))
                turn()
        running.published.clear()
        wait_until(lambda: running.published["cmd_vel_raw"] > 0, turn=send_sound)
        assert running.node.callbacks.n_rejected > 0
        running.assert_alive()
        executor.remove_node(running.node)
        executor.shutdown()
        sender.destroy_node()
