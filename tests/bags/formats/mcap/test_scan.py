"""Definitions of an MCAP file that contradict each other."""

import pytest
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from serd_bag.formats.mcap.definitions import Definitions
from serd_bag.formats.mcap.records import RECORD_HEAD

FIRST = Channel(1, "/text", "cdr", {"one": "1", "other": "2"}, 1)
SCHEMA = Schema(1, b"string data", "ros2msg", "std_msgs/msg/String")


def noted(definitions, record):
    """What `Definitions` finds wrong with the record."""
    builder = RecordBuilder()
    record.write(builder)
    opcode = Opcode.CHANNEL if isinstance(record, Channel) else Opcode.SCHEMA
    return definitions.add(opcode, builder.end()[RECORD_HEAD.size :])


@pytest.mark.parametrize(
    "changed",
    [
        Channel(1, "/other", "cdr", FIRST.metadata, 1),
        Channel(1, "/text", "json", FIRST.metadata, 1),
        Channel(1, "/text", "cdr", FIRST.metadata, 2),
        Channel(1, "/text", "cdr", {"one": "1", "other": "3"}, 1),
        Schema(1, b"string data # \xff", "ros2msg", "std_msgs/msg/String"),
    ],
)
def test_of_two_records_with_one_number_every_field_must_be_equal(changed):
    """As the format demands ("Any two channel records sharing a common ID must be identical")."""
    definitions = Definitions()
    again = Channel(1, "/text", "cdr", dict(reversed(FIRST.metadata.items())), 1)
    assert [noted(definitions, each) for each in (SCHEMA, FIRST, SCHEMA, again)] == [""] * 4
    kind = type(changed).__name__.lower()
    assert noted(definitions, changed) == f"{kind} 1 is defined twice, in different ways"
    assert definitions.names(1) == ("/text", "std_msgs/msg/String")
