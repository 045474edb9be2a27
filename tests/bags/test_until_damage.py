"""A replay gets every sound message before it hears of the damage."""

import pytest

from serd_bag.errors import BagError
from serd_bag.playback import Playback, UntilDamage
from serd_bag.topic import RawMessage

MESSAGES = [RawMessage("/odom", "nav_msgs/msg/Odometry", b"", ns, ns) for ns in range(1, 6)]


def damaged_after_five():
    yield from MESSAGES
    raise BagError("a chunk is damaged; repair it")


def test_every_message_before_the_damage_comes_out_in_one_go():
    sound = UntilDamage(damaged_after_five())
    playback = Playback(sound)
    playback.due(0.0)
    assert playback.due(1.0) == MESSAGES[1:]
    assert playback.finished
    assert sound.damage == "a chunk is damaged; repair it"


def test_a_sound_bag_ends_without_a_word():
    sound = UntilDamage(MESSAGES)
    assert list(sound) == MESSAGES
    assert sound.damage == ""


def test_a_mistake_of_ours_is_not_taken_for_damage():
    def mistaken():
        yield MESSAGES[0]
        raise ValueError("ours")

    with pytest.raises(ValueError, match="ours"):
        list(UntilDamage(mistaken()))
