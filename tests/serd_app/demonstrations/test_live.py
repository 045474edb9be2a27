"""Decisions from messages as they come equal those from the bag that recorded them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import concatenate_renumbered
from serd_app.demonstrations.discretise import (
    AFTER_CUT_OFF,
    demonstrations_of_bag,
    demonstrations_of_drives,
)
from serd_app.demonstrations.live import LiveDrive
from serd_app.drives.sessions import read_drives
from serd_bag.reader import BagReader
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.bag_messages import OWN_TOPICS, write_bag

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)
TIMES_S = HALLWAY.patience_s, HALLWAY.wait_s
OTHER_BAG = Path(__file__).parents[3] / "bags" / "data" / "hallway" / "transfer"
TOPICS = ("robot_pose", "intent", "episode")


@pytest.fixture(scope="module")
def bag(root: Path):
    return sorted(path.parent for path in (root / "bags" / "data").rglob("metadata.yaml"))[0]


def recorded(*bags: Path):
    """The messages of bags, one after the other."""
    return [each for bag in bags for each in BagReader(bag).messages(f"/{name}" for name in TOPICS)]


def sent_of(found):
    return [(each.topic[1:], each.data) for each in found]


@pytest.fixture(scope="module")
def sent(bag):
    """Topics and bytes of the bag's messages."""
    return sent_of(recorded(bag))


def bag_of(target: Path, found) -> Path:
    rows = ((each.topic, each.log_time_ns / 1e9, each.data) for each in found)
    return write_bag(target, OWN_TOPICS, rows)


def live_drive(messages, earlier=None) -> LiveDrive:
    drive = LiveDrive("live", GRID, *TIMES_S, earlier)
    for topic, data in messages:
        drive.take(topic, data)
    return drive


def of_bag(bag):
    return demonstrations_of_bag(bag, GRID, *TIMES_S)


def same(first, second) -> bool:
    columns = (each.columns().values() for each in (first, second))
    return all(map(np.array_equal, *columns))


def only(sent, *topics):
    return [each for each in sent if each[0] in topics]


def test_without_its_intents_a_bag_gives_hidden_decisions_with_the_same_moves(bag):
    def moves(decisions):
        """Of all episodes, from cell to cell."""
        moved = decisions.select(decisions.state != decisions.next_state)
        columns = moved.episode, moved.state, moved.next_state
        return [column.tolist() for column in columns]

    drives = [drive.with_hidden_actions for drive in read_drives(bag)]
    hidden, _ = demonstrations_of_drives(drives, GRID, *TIMES_S)
    assert hidden.hidden.all()
    assert moves(hidden) == moves(of_bag(bag)[0])


def test_live_messages_give_the_decisions_of_the_bag_in_whatever_order_topics_come(bag, sent):
    offline, report = of_bag(bag)
    drive = live_drive(sent)
    assert same(drive.gathered(), offline)
    assert (drive.report, drive.n_late) == (report, 0)
    assert drive.n_ended == len(offline.episodes)
    for ahead in TOPICS:
        others = only(sent, *(name for name in TOPICS if name != ahead))
        drive = live_drive(only(sent, ahead) + others)
        assert same(drive.gathered(), offline)
        behind = live_drive(others + only(sent, ahead))
        assert same(behind.gathered(), offline)
        assert behind.n_late == (len(only(sent, ahead)) if ahead == "intent" else 0)


def test_a_bag_over_which_the_world_was_started_again_gives_both_runs(bag, tmp_path):
    found = recorded(bag, OTHER_BAG)
    both, report = of_bag(bag_of(tmp_path / "restarted", found))
    assert same(both, concatenate_renumbered([of_bag(bag)[0], of_bag(OTHER_BAG)[0]]))
    assert report.n_decisions == len(both)
    assert same(live_drive(sent_of(found)).gathered(), both)


def test_what_was_lost_between_episodes_is_the_same_live_and_from_a_bag(bag, sent, tmp_path):
    found = recorded(bag)
    marks = [index for index, each in enumerate(found) if each.topic == "/episode"]
    # From the end of the third to the start of the sixth.
    kept = found[: marks[5] - 200] + found[marks[10] + 200 :]
    torn, report = of_bag(bag_of(tmp_path / "torn", kept))
    drive = live_drive(sent_of(kept))
    assert same(drive.gathered(), torn)
    assert drive.report == report
    assert report.dropped[AFTER_CUT_OFF] > 0
    whole = live_drive(sent).gathered()
    for episode in torn.episodes:
        own = torn.select_episodes([episode]).time_s
        assert set(own) <= set(whole.select_episodes([episode]).time_s)


def test_what_was_known_before_comes_first_and_is_counted_once(sent):
    decisions = live_drive(sent).gathered()
    kept = decisions.select_episodes(decisions.episodes[:2])
    assert same(live_drive(sent, kept).gathered(), decisions)
    other = replace(decisions, time_s=decisions.time_s + 0.5)
    both = live_drive(sent, other).gathered()
    assert len(both) == 2 * len(decisions)
    assert len(both.episodes) == 2 * len(decisions.episodes)


def test_poses_that_lag_behind_the_end_of_an_episode_are_waited_for(sent):
    last_end = max(index for index, (topic, _) in enumerate(sent) if topic == "episode")
    drive = live_drive(only(sent[: last_end + 1], "intent", "episode"))
    assert not drive.caught_up
    for each in only(sent, "robot_pose"):
        drive.take(*each)
    assert drive.caught_up


def test_an_episode_still_being_driven_waits_for_its_end_unless_it_is_asked_for(sent):
    marks = [index for index, (topic, _) in enumerate(sent) if topic == "episode"]
    drive = live_drive(sent[: marks[3]])
    assert len(drive.gathered(unfinished=False).episodes) == 1
    assert len(drive.gathered().episodes) == 2
    # A world that starts again before it had many decisions gets a session of its own.
    short = only(sent[: marks[1] // 2], "robot_pose")
    assert same(live_drive(short + sent).gathered(), live_drive(sent).gathered())
