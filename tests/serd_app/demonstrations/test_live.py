"""Decisions from messages as they come equal those from the bag that recorded them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.demonstrations import (
    Demonstrations,
    LiveDrive,
    demonstrations_of_bag,
    joined,
)
from serd_app.demonstrations.discretise import AFTER_CUT_OFF, REPEATED
from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.epochs import DecisionEpochs
from support.bag_messages import OWN_TOPICS, write_bag

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)
TIMES_S = HALLWAY.patience_s, HALLWAY.wait_s
OTHER_BAG = Path(__file__).parents[3] / "bags" / "data" / "hallway" / "transfer"
TOPICS = ("robot_pose", "intent", "episode")


@pytest.fixture(scope="module")
def messages(root: Path):
    bag = sorted(path.parent for path in (root / "bags" / "data").rglob("metadata.yaml"))[0]
    wanted = [f"/{topic}" for topic in TOPICS]
    return bag, [(each.topic[1:], each.data) for each in BagReader(bag).messages(wanted)]


def joined_bag(target: Path, *bags: Path) -> Path:
    """The messages of several bags, one after the other, as a bag."""
    wanted = [f"/{topic}" for topic in TOPICS]
    found = [each for bag in bags for each in BagReader(bag).messages(wanted)]
    return bag_of(target, found)


def bag_of(target: Path, found) -> Path:
    rows = ((each.topic, each.log_time_ns / 1e9, each.data) for each in found)
    return write_bag(target, OWN_TOPICS, rows)


def live_drive(messages, earlier: Demonstrations | None = None) -> LiveDrive:
    drive = LiveDrive("live", GRID, *TIMES_S, earlier)
    for topic, data in messages:
        drive.take(topic, data)
    return drive


def columns(found: Demonstrations):
    return list(found.decisions.columns().values())


def same(first: Demonstrations, second: Demonstrations) -> bool:
    return all(map(np.array_equal, columns(first), columns(second)))


@pytest.mark.parametrize("n_intents", [0, 5])
def test_poses_alone_give_the_hidden_decisions_of_the_bag(messages, n_intents):
    bag, sent = messages
    offline, _ = demonstrations_of_bag(bag, GRID, *TIMES_S, hidden=True)
    drive = LiveDrive("live", GRID, *TIMES_S, hidden=True)
    intents = [each for each in sent if each[0] == "intent"]
    for topic, data in intents[:n_intents] + [each for each in sent if each[0] != "intent"]:
        drive.take(topic, data)
    assert same(drive.gathered(), offline)
    assert offline.decisions.hidden.all()
    shown, _ = demonstrations_of_bag(bag, GRID, *TIMES_S)
    assert moves(offline.decisions) == moves(shown.decisions)


def moves(decisions):
    """Of all episodes, from cell to cell."""
    moved = decisions.select(decisions.state != decisions.next_state)
    columns = moved.episode, moved.state, moved.next_state
    return list(zip(*(each.tolist() for each in columns), strict=True))


def test_live_messages_give_the_decisions_of_the_bag(messages):
    bag, sent = messages
    offline, report = demonstrations_of_bag(bag, GRID, *TIMES_S)
    drive = live_drive(sent)
    assert same(drive.gathered(), offline)
    assert drive.report == report
    assert drive.n_ended == len(offline.decisions.episodes)


def test_a_bag_over_which_the_world_was_started_again_gives_both_runs(messages, tmp_path):
    bag, _ = messages
    target = joined_bag(tmp_path / "restarted", bag, OTHER_BAG)
    found, report = demonstrations_of_bag(target, GRID, *TIMES_S)
    first, _ = demonstrations_of_bag(bag, GRID, *TIMES_S)
    second, _ = demonstrations_of_bag(OTHER_BAG, GRID, *TIMES_S)
    assert same(found, joined([first, second]))
    assert report.n_decisions == len(found.decisions)
    recorded = BagReader(target).messages()
    live = live_drive([(each.topic[1:], each.data) for each in recorded])
    assert same(live.gathered(), found)


def test_what_was_lost_between_episodes_is_the_same_live_and_from_a_bag(messages, tmp_path):
    bag, _ = messages
    recorded = list(BagReader(bag).messages([f"/{topic}" for topic in TOPICS]))
    marks = [index for index, each in enumerate(recorded) if each.topic == "/episode"]
    lost = range(marks[5] - 200, marks[10] + 200)  # the end of the third to the start of the sixth
    kept = [each for index, each in enumerate(recorded) if index not in lost]
    torn = bag_of(tmp_path / "torn", kept)
    found, report = demonstrations_of_bag(torn, GRID, *TIMES_S)
    drive = live_drive([(each.topic[1:], each.data) for each in kept])
    assert same(drive.gathered(), found)
    assert drive.report == report
    assert report.dropped[AFTER_CUT_OFF] > 0
    whole = live_drive([(each.topic[1:], each.data) for each in recorded]).gathered().decisions
    for episode in found.decisions.episodes:
        own = found.decisions.select_episodes([episode]).time_s
        assert set(own) <= set(whole.select_episodes([episode]).time_s)


def test_a_bag_that_holds_its_messages_twice_counts_them_once_and_says_so(messages, tmp_path):
    bag, _ = messages
    target = joined_bag(tmp_path / "twice", bag, bag)
    found, report = demonstrations_of_bag(target, GRID, *TIMES_S)
    once, _ = demonstrations_of_bag(bag, GRID, *TIMES_S)
    assert same(found, once)
    assert report.dropped[REPEATED] == len(once.decisions)


def test_what_was_kept_before_a_restart_comes_first_and_is_not_counted_again(messages):
    _, sent = messages
    everything = live_drive(sent).gathered()
    first = everything.decisions.episodes[:2]
    kept = Demonstrations(everything.decisions.select_episodes(first))
    again = live_drive(sent, kept).gathered()
    assert same(again, everything)


def test_a_restarted_world_adds_its_episodes_under_numbers_of_their_own(messages):
    _, sent = messages
    everything = live_drive(sent).gathered().decisions
    other = Demonstrations(replace(everything, time_s=everything.time_s + 0.5))
    both = live_drive(sent, other).gathered().decisions
    assert len(both) == 2 * len(everything)
    assert len(both.episodes) == 2 * len(everything.episodes)


def test_poses_that_lag_behind_the_end_of_an_episode_are_waited_for(messages):
    _, sent = messages
    last_end = max(index for index, (topic, _) in enumerate(sent) if topic == "episode")
    before = [each for each in sent[:last_end] if each[0] != "robot_pose"]
    poses = [each for each in sent if each[0] == "robot_pose"]
    drive = live_drive([*before, sent[last_end]])
    assert not drive.caught_up
    for topic, data in poses:
        drive.take(topic, data)
    assert drive.caught_up


def test_an_intent_later_than_the_end_of_its_episode_is_noticed(messages):
    _, sent = messages
    intents = [each for each in sent if each[0] == "intent"]
    others = [each for each in sent if each[0] != "intent"]
    assert live_drive(sent).n_late == 0
    drive = live_drive(others)
    for topic, data in intents:
        drive.take(topic, data)
    assert drive.n_late == len(intents)
    assert same(drive.gathered(), live_drive(sent).gathered())


def test_a_message_too_short_for_a_stamp_is_refused():
    with pytest.raises(BagError, match=r"must have a stamp \(12 bytes\), got 3 bytes"):
        LiveDrive("live", GRID, *TIMES_S).take("intent", b"\x00\x01\x00")


def test_an_episode_still_being_driven_waits_for_its_end_unless_it_is_asked_for(messages):
    _, sent = messages
    ends = [index for index, (topic, data) in enumerate(sent) if topic == "episode"]
    drive = live_drive(sent[: ends[3]])
    finished, everything = drive.gathered(unfinished=False), drive.gathered()
    assert len(finished.decisions.episodes) == 1
    assert len(everything.decisions.episodes) == 2


@pytest.mark.parametrize("ahead", TOPICS)
def test_one_topic_may_come_long_before_the_others(messages, ahead):
    _, sent = messages
    first = [each for each in sent if each[0] == ahead]
    rest = [each for each in sent if each[0] != ahead]
    assert same(live_drive(first + rest).gathered(), live_drive(sent).gathered())


def test_a_world_restarted_before_it_had_many_decisions_gets_a_session_of_its_own(messages):
    _, sent = messages
    ends = [index for index, (topic, _) in enumerate(sent) if topic == "episode"]
    short = [each for each in sent[: ends[1] // 2] if each[0] == "robot_pose"]
    assert same(live_drive(short + sent).gathered(), live_drive(sent).gathered())


def test_episodes_are_divided_again_only_where_something_of_them_came_since(messages, monkeypatch):
    bag, sent = messages
    seen = []
    see = DecisionEpochs.see
    monkeypatch.setattr(
        DecisionEpochs, "see", lambda epochs, *place: seen.append(place) or see(epochs, *place)
    )
    intents = [each for each in sent if each[0] == "intent"]
    half = len(intents) // 2
    drive = live_drive([each for each in sent if each[0] != "intent"] + intents[:half])
    first = drive.gathered()
    n_at_first = len(seen)
    assert same(drive.gathered(), first)
    assert len(seen) == n_at_first > 0
    for each in intents[half:]:
        drive.take(*each)
    last = drive.gathered()
    assert 0 < len(seen) - n_at_first < n_at_first, "of the episodes of the later intents alone"
    assert same(last, demonstrations_of_bag(bag, GRID, *TIMES_S)[0])
    assert not same(last, first)
