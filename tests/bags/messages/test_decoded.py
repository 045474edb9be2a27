"""Decoded messages, and errors for damaged bags."""

import pytest

from serd_bag.errors import BagError
from serd_bag.messages.decoded import messages_of


def test_messages_come_decoded_by_their_short_names(small_bag):
    found = list(messages_of(small_bag(), ["robot_pose"]))
    assert len(found) == 60
    assert [message.pose.position.x for _, message in found[:3]] == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_damage_anywhere_raises_an_error_that_names_the_repair(small_bag, compression):
    folder = small_bag(compression=compression)
    file = folder / "small_0.mcap"
    content = file.read_bytes()
    refused = 0
    for place in range(0, len(content), 211):
        broken = bytearray(content)
        broken[place] ^= 0xFF
        file.write_bytes(broken)
        try:
            list(messages_of(folder, ["robot_pose", "intent"]))
        except BagError as error:
            refused += "serd bag recover" in str(error)
    assert refused > 3
