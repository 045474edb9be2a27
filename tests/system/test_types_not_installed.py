"""Types without a package, such as that of /tf, are recorded and played as bytes."""

import signal

import pytest

from serd_bag.formats.rosbag2.message_types import message_type
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from serd_cli.processes.workspace import node_command
from support.transforms_message import transforms_message
from support.waiting import PATIENCE_S, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.slow]
TF = "tf2_msgs/msg/TFMessage"
N_SENT = 50


def test_tf_is_played_from_one_bag_and_recorded_into_another(nodes, ros_env, tmp_path):
    sent = [
        transforms_message(("odom", "base_link", (0.1 * n, 0.0), (0.0, 1.0), 1.0 + 0.1 * n))
        for n in range(N_SENT)
    ]
    with BagWriter(tmp_path / "played") as writer:
        writer.add_topic("/tf", TF)
        for number, data in enumerate(sent):
            writer.write("/tf", data, 10**9 + number * 10**8)
    given = {"output": str(tmp_path / "bag"), "topics": ["tf"], "minimum_free_mb": 0.0}
    recorder = nodes.start(node_command("demo_recorder", given, {}, ros_env), "demo_recorder")
    wait_until((tmp_path / "bag" / "bag_0.mcap").exists)
    played = {"bag": str(tmp_path / "played"), "rate": 20.0}
    replay = nodes.start(node_command("bag_replay", played, {}, ros_env), "bag_replay")
    assert replay.wait(PATIENCE_S) == 0
    recorder.send_signal(signal.SIGTERM)
    assert recorder.wait(PATIENCE_S) == 0
    reader = BagReader(tmp_path / "bag")
    assert [each.data for each in reader.messages(["/tf"])] == sent
    assert reader.topics["/tf"].message_type == message_type(TF)
