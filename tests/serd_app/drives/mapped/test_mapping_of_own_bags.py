"""A mapping that describes our own recordings gives what reading them directly gives."""

import numpy as np
import pytest

from serd_app.drives.mapped.drive import mapped_drive_in
from serd_app.drives.mapped.mapping import BagMapping
from serd_app.drives.sessions import read_drives
from serd_bag.errors import BagError
from serd_bag.messages.decoded import messages_of
from serd_bag.reader import BagReader
from serd_core.grid.grid import Action
from support.bag_messages import OWN_TOPICS, POSE, write_bag


@pytest.fixture
def own_bag(tmp_path, messages):
    """Two episodes in a namespace: one arrives, one is cut off; waypoints beside the intents."""
    rows = []
    for episode, start_s in enumerate((10.0, 30.0)):
        rows.append(("/robot/episode", start_s, messages.mark(start_s, "start", episode)))
        for tick in range(100):
            time_s, y_m = start_s + 0.1 * tick, 0.1 * tick
            rows.append(("/robot/robot_pose", time_s, messages.pose(time_s, 0.0, y_m)))
            if tick % 20 == 0:
                rows.append(("/robot/intent", time_s, messages.intent(time_s, 0.0, 1.0)))
                goal = messages.pose(time_s, 0.0, y_m + 1.0)
                rows.append(("/robot/waypoint", time_s, goal))
        if episode == 0:
            rows.append(("/robot/episode", 19.9, messages.mark(19.9, "end", episode, "arrived")))
    topics = {f"/robot{name}": kind for name, kind in OWN_TOPICS.items()}
    return write_bag(tmp_path / "own", topics | {"/robot/waypoint": POSE}, rows)


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


def test_decoded_messages_come_by_their_short_names(own_bag):
    found = [(name, message.header.stamp.sec) for name, message in messages_of(own_bag, ["intent"])]
    assert found[:2] == [("intent", 10), ("intent", 12)]
    with pytest.raises(BagError, match="must hold scan, it holds episode, intent, robot_pose"):
        list(messages_of(own_bag, ["scan"]))
