"""Part of a bag: topics by name, seconds by log time."""

from pathlib import Path

import pytest

from bags.errors import BagError
from bags.excerpt import Excerpt, named_topics
from bags.reader import BagReader
from bags.rosbag2.qos import QosProfile, qos_of_yaml, qos_yaml


@pytest.fixture(scope="module")
def reader(root: Path) -> BagReader:
    return BagReader(sorted(path.parent for path in (root / "bags/data").rglob("metadata.yaml"))[0])


def times_s(messages):
    return [message.log_time_ns * 1e-9 for message in messages]


def test_an_excerpt_begins_and_ends_where_it_is_told_to(reader):
    topics = named_topics(reader.topics, ["robot_pose"])
    everything = times_s(Excerpt(topics).messages(reader))
    some = times_s(Excerpt(topics, start_s=10.0, duration_s=5.0).messages(reader))
    first_s = everything[0]
    assert some == [time_s for time_s in everything if 10.0 <= time_s - first_s < 15.0]
    assert 0 < len(some) < len(everything)


def test_topics_are_found_without_their_slash_and_all_are_meant_by_none(reader):
    assert named_topics(reader.topics, ["intent"]) == {"/intent"}
    assert named_topics(reader.topics, []) == set(reader.topics)
    with pytest.raises(BagError, match=r"must hold the topic 'intnt', .*did you mean '/intent'\?"):
        named_topics(reader.topics, ["intnt"])


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


@pytest.mark.parametrize(
    "profile",
    [
        QosProfile(),
        QosProfile(reliability="best_effort", depth=5),
        QosProfile(durability="transient_local", depth=1),
    ],
)
def test_quality_of_service_survives_the_way_into_a_bag_and_back(profile):
    assert qos_of_yaml(qos_yaml((profile,))) == profile


@pytest.mark.parametrize("text", ["", "{", "[]", "- 3", "- {depth: unlimited}"])
def test_unknown_quality_of_service_counts_as_reliable(text):
    assert qos_of_yaml(text) == QosProfile()


def test_numbers_of_older_recordings_are_understood():
    assert qos_of_yaml("- {reliability: 2, durability: 1, depth: 3}") == QosProfile(
        reliability="best_effort", durability="transient_local", depth=3
    )
