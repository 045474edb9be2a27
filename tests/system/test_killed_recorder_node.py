"""SIGKILL of the demo_recorder node while it records costs at most half a second of data.

On a busy machine a message may wait longer than that until the recorder runs at all. The time that
threads have waited for a processor is measured, and that much more may be lost.
"""

import signal
import threading
import time

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.time import Time

from serd_bag.command.rewrite import recover
from serd_bag.messages.plain import message_stamp_ns
from serd_bag.reader import BagReader
from serd_cli.processes.node_commands import node_command
from serd_ros.endpoints import qos
from support.waiting import PATIENCE_S, ProcessorWait

pytestmark = [pytest.mark.ros, pytest.mark.slow]
TOPICS = [f"/pose_{number}" for number in range(5)]
PERIOD_S = 0.04
MOST_LOST_S = 0.5


class Publishing:
    """Publishes every topic at 25 Hz from a separate thread; a stamp is the system's time.

    stamps_ns, sent_ns: stamps so far, and when all topics had been published with each.
    """

    def __init__(self, node):
        self._publishers = [node.create_publisher(PoseStamped, each, qos.STATE) for each in TOPICS]
        self.stamps_ns, self.sent_ns = [], []
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()

    def matched(self):
        return all(each.get_subscription_count() for each in self._publishers)

    def _run(self):
        while not self._ended.wait(PERIOD_S):
            message = PoseStamped()
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
            for publisher in self._publishers:
                publisher.publish(message)
            self.stamps_ns.append(Time.from_msg(message.header.stamp).nanoseconds)
            self.sent_ns.append(time.time_ns())


class Waits:
    """How long threads had waited for a processor, at several times."""

    def __init__(self):
        self._wait, self._samples = ProcessorWait(), []

    def sample(self):
        self._samples.append((time.time_ns(), self._wait.total_s))

    def since_s(self, time_ns):
        """From the last sample before that time to the last sample of all, s."""
        before_s = max((total for at, total in self._samples if at <= time_ns), default=0.0)
        return self._samples[-1][1] - before_s


def recorded_stamps_ns(bag):
    """Stamps that the bag holds of each topic, in its order."""
    reader = BagReader(bag, tolerant=True)
    found = {topic: [] for topic in TOPICS}
    for message in reader.messages():
        found[message.topic].append(message_stamp_ns(message.data))
    assert reader.damage  # the reader does not take the bag for complete
    return found


def lost_s(missing_sent_ns, killed_ns, waits):
    """Time from the first missing message to the kill, less the waits for a processor."""
    lost_ns = min((each for each in missing_sent_ns if each < killed_ns), default=killed_ns)
    return (killed_ns - lost_ns) * 1e-9 - waits.since_s(lost_ns)


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
    waits, n_rounds = Waits(), np.random.default_rng(seed).integers(25, 40)
    with Publishing(probe.node) as publishing:
        probe.spin_until(publishing.matched)
        n_sent = len(publishing.sent_ns)

        def sent():
            waits.sample()
            return len(publishing.sent_ns) >= n_sent + n_rounds

        probe.spin_until(sent)
        waits.sample()
        process.send_signal(signal.SIGKILL)
        killed_ns = time.time_ns()
        assert process.wait(PATIENCE_S) == -signal.SIGKILL
    recorded_ns = recorded_stamps_ns(tmp_path / "bag")
    for topic, stamps_ns in recorded_ns.items():
        assert stamps_ns, topic
        first = publishing.stamps_ns.index(stamps_ns[0])
        end = first + len(stamps_ns)
        assert stamps_ns == publishing.stamps_ns[first:end], topic
        assert lost_s(publishing.sent_ns[end:], killed_ns, waits) <= MOST_LOST_S, topic
    counts = recover(tmp_path / "bag", tmp_path / "recovered").counts
    assert counts == {topic: len(stamps_ns) for topic, stamps_ns in recorded_ns.items()}
