"""SIGKILL of the demo_recorder node while it records costs at most half a second of data.

On a machine with more to do than it has processors a message may wait longer than that for the
recorder to be let run at all. Linux tells how long each thread waited; that much more may be lost.
"""

import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.time import Time

from bags.reader import BagReader
from bags.rewrite import recover
from serd_cli.node_commands import node_command
from serd_ros.endpoints import qos

pytestmark = [pytest.mark.ros, pytest.mark.slow]
TOPICS = [f"/pose_{number}" for number in range(5)]
PERIOD_S = 0.04
MOST_LOST_S = 0.5


class Publishing:
    """Every topic at 25 Hz from a thread of its own; a stamp is the system's time.

    sent_ns: stamps so far, each published on every topic.
    """

    def __init__(self, node):
        self._publishers = [node.create_publisher(PoseStamped, each, qos.STATE) for each in TOPICS]
        self.sent_ns = []
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()

    def heard(self):
        return all(each.get_subscription_count() for each in self._publishers)

    def _run(self):
        while not self._ended.wait(PERIOD_S):
            message = PoseStamped()
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
            for publisher in self._publishers:
                publisher.publish(message)
            self.sent_ns.append(Time.from_msg(message.header.stamp).nanoseconds)


def waited_ns(process):
    """Time the threads of a process have waited for a processor so far, ns."""
    tasks = Path(f"/proc/{process.pid}/task").glob("*/schedstat")
    return sum(int(task.read_text().split()[1]) for task in tasks)


def waits_for(process, duration_s):
    """(time, waited so far), both in ns, over the given time."""
    until_s, found = time.monotonic() + duration_s, []
    while time.monotonic() < until_s:
        found.append((time.time_ns(), waited_ns(process)))
        time.sleep(0.02)
    return found


def stamps_left_ns(bag):
    """What is left of each topic, in the order of the bag."""
    reader = BagReader(bag, tolerant=True)
    found = {topic: [] for topic in TOPICS}
    for message in reader.messages():
        found[message.topic].append(message.log_time_ns)
    assert reader.damage  # it is not taken for whole
    return found


def lost_s(unkept_ns, waits):
    """How long before the kill the first message was sent that is not kept, but for waiting."""
    killed_ns, waited_in_all_ns = waits[-1]
    lost_ns = min((each for each in unkept_ns if each < killed_ns), default=killed_ns)
    waited_before_ns = max((waited for at, waited in waits if at <= lost_ns), default=0)
    return (killed_ns - lost_ns - (waited_in_all_ns - waited_before_ns)) * 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_a_killed_recorder_has_lost_the_last_half_second_of_a_topic_at_most(
    nodes, probe, ros_env, tmp_path, seed
):
    given = {
        "output": str(tmp_path / "bag"),
        "topics": [f"{topic}:geometry_msgs/msg/PoseStamped" for topic in TOPICS],
        "minimum_free_mb": 0.0,
    }
    process = nodes.start(node_command("demo_recorder", given, {}, ros_env), "recorder")
    with Publishing(probe.node) as publishing:
        probe.spin_until(publishing.heard)
        waits = waits_for(process, np.random.default_rng(seed).uniform(1.0, 1.6))
        waits.append((time.time_ns(), waited_ns(process)))
        process.send_signal(signal.SIGKILL)
        assert process.wait(5) == -signal.SIGKILL
    left_ns = stamps_left_ns(tmp_path / "bag")
    for topic, kept_ns in left_ns.items():
        assert kept_ns, topic
        first = publishing.sent_ns.index(kept_ns[0])
        assert kept_ns == publishing.sent_ns[first : first + len(kept_ns)], topic
        assert lost_s(publishing.sent_ns[first + len(kept_ns) :], waits) <= MOST_LOST_S, topic
    counts = recover(tmp_path / "bag", tmp_path / "recovered").counts
    assert counts == {topic: len(kept_ns) for topic, kept_ns in left_ns.items()}
