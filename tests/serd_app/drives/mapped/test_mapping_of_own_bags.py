"""A mapping that describes our own recordings gives what reading them directly gives."""

import numpy as np
import pytest

from serd_app.drives.mapped.drive import mapped_drive_in
from serd_app.drives.mapped.mapping import BagMapping
from serd_app.drives.sessions import read_drives
from serd_bag.errors import BagError
from serd_bag.messages.decoded import messages_of
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from serd_core.grid.grid import Action

POSE = "geometry_msgs/msg/PoseStamped"
VECTOR = "geometry_msgs/msg/Vector3Stamped"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


@pytest.fixture
def own_bag(tmp_path, messages):
    """Two episodes in a namespace: one arrives, one is cut off; waypoints beside the intents."""
    with BagWriter(tmp_path / "own") as writer:
        for name, kind in (
            ("/robot/robot_pose", POSE),
            ("/robot/intent", VECTOR),
            ("/robot/waypoint", POSE),
            ("/robot/episode", DIAGNOSTICS),
        ):
            writer.add_topic(name, kind)
        for episode, start_s in enumerate((10.0, 30.0)):
            start = messages.mark(start_s, "start", episode)
            writer.write("/robot/episode", start, round(start_s * 1e9))
            for tick in range(100):
                time_s = start_s + 0.1 * tick
                time_ns = round(time_s * 1e9)
                writer.write("/robot/robot_pose", messages.pose(time_s, 0.0, 0.1 * tick), time_ns)
                if tick % 20 == 0:
                    writer.write("/robot/intent", messages.intent(time_s, 0.0, 1.0), time_ns)
                    goal = messages.pose(time_s, 0.0, 0.1 * tick + 1.0)
                    writer.write("/robot/waypoint", goal, time_ns)
            if episode == 0:
                end = messages.mark(19.9, "end", episode, "arrived")
                writer.write("/robot/episode", end, round(19.9e9))
    return tmp_path / "own"


def test_a_mapping_of_our_own_topics_changes_nothing(own_bag):
    direct = read_drives(own_bag)[0]
    mapped = mapped_drive_in(BagReader(own_bag), BagMapping(episode_topic="episode"), 2.0)
    assert [span.outcome for span in direct.episodes] == ["arrived", "cut_off"]
    assert mapped.episodes == direct.episodes
    for name in ("pose_time_s", "position_m", "intent_time_s", "intent_action"):
        assert np.array_equal(getattr(mapped, name), getattr(direct, name))


def test_waypoints_ahead_mean_what_the_intents_say(own_bag):
    mapping = BagMapping(
        action_from="waypoint", action_topic="waypoint", episode_topic="/robot/episode"
    )
    drive = mapped_drive_in(BagReader(own_bag), mapping, 2.0)
    assert set(drive.intent_action) == {Action.NORTH}
    assert np.array_equal(drive.intent_time_s, read_drives(own_bag)[0].intent_time_s)


def test_without_marks_every_stretch_without_a_gap_is_an_episode(own_bag):
    drive = mapped_drive_in(BagReader(own_bag), BagMapping(), 2.0)
    assert [(span.start_s, span.outcome) for span in drive.episodes] == [
        (10.0, "unmarked"),
        (30.0, "unmarked"),
    ]


def test_decoded_messages_come_by_their_short_names(own_bag):
    found = [(name, message.header.stamp.sec) for name, message in messages_of(own_bag, ["intent"])]
    assert found[:2] == [("intent", 10), ("intent", 12)]
    with pytest.raises(BagError, match="must hold scan, it holds episode, intent, robot_pose"):
        list(messages_of(own_bag, ["scan"]))
