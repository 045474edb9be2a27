"""Part of a bag: topics by name, seconds by log time."""

from pathlib import Path

import pytest

from bags.errors import BagError
from bags.playback import Excerpt
from bags.reader import BagReader
from bags.topic import selected_topics


@pytest.fixture(scope="module")
def reader(root: Path) -> BagReader:
    return BagReader(sorted(path.parent for path in (root / "bags/data").rglob("metadata.yaml"))[0])


def times_s(messages):
    return [message.log_time_ns * 1e-9 for message in messages]


def test_an_excerpt_begins_and_ends_where_it_is_told_to(reader):
    topics = selected_topics(reader.topics, ["robot_pose"])
    everything = times_s(Excerpt(topics).messages(reader))
    some = times_s(Excerpt(topics, start_s=10.0, duration_s=5.0).messages(reader))
    first_s = everything[0]
    assert some == [time_s for time_s in everything if 10.0 <= time_s - first_s < 15.0]
    assert 0 < len(some) < len(everything)


def test_topics_are_found_without_their_slash_and_all_are_meant_by_none(reader):
    assert selected_topics(reader.topics, ["intent"]) == {"/intent"}
    assert selected_topics(reader.topics, []) == set(reader.topics)
    with pytest.raises(BagError, match=r"must hold the topic 'intnt', .*did you mean '/intent'\?"):
        selected_topics(reader.topics, ["intnt"])


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"start_s": -1.0}, "start must be finite and at least 0 s, got -1.0"),
        ({"duration_s": 0.0}, "duration must be above 0 s, got 0.0"),
        ({"duration_s": float("nan")}, "duration must be above 0 s, got nan"),
    ],
)
def test_wrong_seconds_are_refused(given, sentence):
    with pytest.raises(BagError, match=sentence):
        Excerpt(frozenset(), **given)
