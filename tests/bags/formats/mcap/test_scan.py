"""MCAP files of the writer of `mcap`, in all forms that the format allows, are read completely."""

import pytest
from mcap.writer import CompressionType, IndexType, Writer

from bags.reader import BagReader

OPTIONS = [
    {},
    {"use_chunking": False},
    {"repeat_channels": False, "repeat_schemas": False},
    {"use_statistics": False, "index_types": IndexType.NONE},
    {"enable_crcs": False},
]


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("options", OPTIONS)
def test_files_of_every_form_are_sound(tmp_path, compression, options):
    path = tmp_path / "their.mcap"
    written = [b"\0\1\0\0" + bytes([number % 256]) * 50 for number in range(300)]
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression, chunk_size=2000, **options)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/text", "cdr", schema)
        for number, data in enumerate(written):
            writer.add_message(channel, log_time=number, data=data, publish_time=number + 1)
        writer.finish()
    reader = BagReader(path, thorough=True)
    found = list(reader.messages())
    assert [message.data for message in found] == written
    assert {message[:2] for message in found} == {("/text", "std_msgs/msg/String")}
    assert [message[3:] for message in found] == [(n, n + 1) for n in range(300)]
    assert list(reader.topics) == ["/text"]
