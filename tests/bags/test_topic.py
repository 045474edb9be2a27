"""Topics are found by their names, in full or without namespace."""

import pytest

from serd_bag.errors import BagError
from serd_bag.topic import selected_topics


def test_topics_are_found_without_their_slash_and_none_means_all():
    topics = ["/robot_pose", "/intent", "/episode"]
    assert selected_topics(topics, ["intent"]) == {"/intent"}
    assert selected_topics(topics, []) == set(topics)
    with pytest.raises(BagError, match=r"must hold the topic 'intnt', .*did you mean '/intent'\?"):
        selected_topics(topics, ["intnt"])
