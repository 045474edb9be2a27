"""A replay returns every message of a bag, or of a part of it, once, in order, at its time."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_bag.topic import RawMessage, selected_topics
from serd_ros.process.playback import Playback, excerpt


def recorded(*times_s):
    """Messages at those log times."""
    times_ns = [round(time_s * 1e9) for time_s in times_s]
    return [RawMessage("/x", "std_msgs/msg/String", b"", time_ns, 0) for time_ns in times_ns]


def test_messages_come_at_their_time_at_any_rate():
    playback = Playback(recorded(100.0, 101.0, 102.0), rate=2.0)
    assert len(playback.due(7.0)) == 1
    assert len(playback.due(7.4)) == 0
    assert len(playback.due(7.5)) == 1
    assert playback.bag_time_ns(7.75) == 101_500_000_000
    assert len(playback.due(7.99)) == 0
    assert len(playback.due(8.0)) == 1
    assert playback.finished


def test_a_log_time_that_steps_back_is_due_at_once():
    playback = Playback(recorded(10.0, 5.0, 11.0))
    assert len(playback.due(0.0)) == 2
    assert playback.bag_time_ns(0.5) == 10_500_000_000


@given(
    times_s=st.lists(st.floats(0, 5), max_size=20),
    walls_s=st.lists(st.floats(0, 1), max_size=20),
    rate=st.floats(0.1, 10),
)
def test_every_message_comes_once_and_in_order(times_s, walls_s, rate):
    messages = recorded(*times_s)
    playback, wall_s, found, clock_ns = Playback(messages, rate=rate), 0.0, [], -1
    for step_s in [0.0, *walls_s, 1e3]:
        wall_s += step_s
        found += playback.due(wall_s)
        assert playback.bag_time_ns(wall_s) >= clock_ns
        clock_ns = playback.bag_time_ns(wall_s)
    assert found == messages
    assert playback.finished


def test_an_excerpt_starts_and_ends_at_the_given_seconds(small_bag):
    reader = BagReader(small_bag())
    topics = selected_topics(reader.topics, ["robot_pose"])
    found = excerpt(reader, topics, start_s=1.0, duration_s=0.5)
    assert [m.log_time_ns for m in found] == [11 * 10**9 + n * 5 * 10**7 for n in range(10)]


def test_topics_are_found_without_their_slash_and_none_means_all():
    topics = ["/robot_pose", "/intent", "/episode"]
    with pytest.raises(BagError, match=r"must hold the .*mean '/intent'\?"):
        selected_topics(topics, ["intnt"])
    assert selected_topics(topics, ["intent"]) == {"/intent"}
    assert selected_topics(topics, []) == set(topics)


@pytest.mark.parametrize("error", [None, BagError, ValueError])
def test_every_message_before_damage_comes_and_a_mistake_of_ours_is_no_damage(error):
    messages = recorded(1e-9, 2e-9, 3e-9, 4e-9, 5e-9)

    def ending():
        yield from messages
        if error:
            raise error("it ends")

    playback = Playback(ending())
    played = playback.due(0.0)
    if error is ValueError:
        with pytest.raises(ValueError, match="it ends"):
            playback.due(1.0)
        return
    assert played + playback.due(1.0) == messages
    assert playback.finished
    assert playback.damage == ("it ends" if error else "")
