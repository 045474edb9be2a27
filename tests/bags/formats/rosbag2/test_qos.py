"""Quality of service in bags of any version, also where it is damaged."""

import pytest

from serd_bag.formats.rosbag2.qos import QosProfile, profile_to_offer, qos_of_text, qos_text


@pytest.mark.parametrize(
    "profile",
    [
        QosProfile(),
        QosProfile(reliability="best_effort", depth=5),
        QosProfile(durability="transient_local", depth=1),
    ],
)
def test_quality_of_service_survives_the_way_into_a_bag_and_back(profile):
    assert profile_to_offer(qos_of_text(qos_text((profile,)))) == profile


@pytest.mark.parametrize("text", ["", "{", "3", "- 3", "- history: 3\n  depth: x"])
def test_invalid_quality_of_service_gives_one_profile_at_most_that_counts_as_reliable(text):
    assert len(qos_of_text(text)) <= 1
    assert profile_to_offer(qos_of_text(text)) == QosProfile()


def test_quality_of_service_of_older_bags_is_understood():
    (old,) = qos_of_text("- history: 1\n  depth: 4\n  reliability: 2\n  durability: 1\n")
    assert (old.history, old.depth) == ("keep_last", 4)
    assert (old.reliability, old.durability) == ("best_effort", "transient_local")
