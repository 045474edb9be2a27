"""A chunk lost between two episodes: what is left of both never counts as one of them."""

import pytest

from serd_app.demonstrations.demonstrations import demonstrations_of_drives
from serd_app.demonstrations.discretise import AFTER_CUT_OFF, CUT_SHORT
from serd_app.drives.sessions import read_drives
from serd_bag.command.rewrite import recover
from serd_bag.writer import BagWriter
from serd_core.grid.grid import Grid
from support.bag_messages import OWN_TOPICS

GRID = Grid((0.0, 0.0), 1.0, [[True] * 12])


@pytest.fixture
def torn_bag(tmp_path, messages):
    """Three episodes of 10 s, one after the other; a chunk of 2 s about the first end is lost."""
    folder = tmp_path / "torn"
    with BagWriter(folder) as writer:
        for name, kind in OWN_TOPICS.items():
            writer.add_topic(name, kind)
        for tick in range(301):
            time_s = 100.0 + 0.1 * tick
            time_ns = round(time_s * 1e9)
            episode, since_s = tick // 100, 0.1 * (tick % 100)
            if tick in (90, 110):
                writer.flush()
            if tick % 100 == 0 and tick:
                end = messages.mark(time_s, "end", 3 + episode, f"outcome {3 + episode}")
                writer.write("/episode", end, time_ns)
            if tick % 100 == 0 and tick < 300:
                writer.write("/episode", messages.mark(time_s, "start", 4 + episode), time_ns)
            pose = messages.pose(time_s, 0.5 + 0.5 * since_s, 0.5)
            writer.write("/robot_pose", pose, time_ns)
            if tick == 100:
                lost = pose
            if tick % 20 == 0:
                writer.write("/intent", messages.intent(time_s, 1.0, 0.0), time_ns)
    file = next(folder.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    content[content.index(lost) + 30] ^= 1
    file.write_bytes(bytes(content))
    return folder


def test_what_follows_the_gap_is_dropped_until_the_next_start(torn_bag, tmp_path):
    recovered = recover(torn_bag, tmp_path / "recovered").target
    for bag, tolerant in ((torn_bag, True), (recovered, False)):
        drives = read_drives(bag, tolerant=tolerant)
        found, report = demonstrations_of_drives(drives, GRID, 2.0)
        decisions = found.decisions
        first = decisions.select(decisions.episode == 4)
        assert first.time_s.tolist() == [100.0, 102.0, 104.0, 106.0]
        assert decisions.episodes.tolist() == [4, 6]
        # of the second episode, intents at 12 to 18 s; at 8 s the first is cut short
        assert report.dropped[AFTER_CUT_OFF] == 4
        assert report.dropped[CUT_SHORT] == 1
