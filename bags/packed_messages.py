"""Messages that were compressed one by one, as rosbag2 does in its compression mode `message`."""

from collections.abc import Iterator

import zstandard

#: (topic, type, data, log time, publish time)
Found = tuple[str, str, bytes, int, int]

#: A compressed message begins so, any other with a zero (CDR).
_PACKED = zstandard.FRAME_HEADER


class PackedMessages:
    """Unpacks those that are packed; `n_broken`, the others, is complete after `messages`."""

    def __init__(self, found: Iterator[Found]) -> None:
        self._found = found
        self.n_broken = 0

    def messages(self) -> Iterator[Found]:
        """The messages that can be unpacked."""
        for message in self._found:
            if not message[2].startswith(_PACKED):
                yield message
                continue
            topic, type_name, packed, log_time_ns, publish_time_ns = message
            data = _unpacked(packed)
            if data is None:
                self.n_broken += 1
            else:
                yield topic, type_name, data, log_time_ns, publish_time_ns


def _unpacked(packed: bytes) -> bytes | None:
    unpacker = zstandard.ZstdDecompressor().decompressobj()
    try:
        data = unpacker.decompress(packed)
    except zstandard.ZstdError:
        return None
    return data if unpacker.eof else None
