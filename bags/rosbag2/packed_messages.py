"""Messages that were compressed one by one, as rosbag2 does in its compression mode `message`."""

from collections.abc import Iterator

import zstandard

from bags.rosbag2.raw_message import RawMessage

#: A compressed message begins so, any other with a zero (CDR).
_PACKED = zstandard.FRAME_HEADER


class PackedMessages:
    """Unpacks those that are packed; `n_broken`, the others, is complete after `messages`."""

    def __init__(self, found: Iterator[RawMessage]) -> None:
        self._found = found
        self.n_broken = 0

    def messages(self) -> Iterator[RawMessage]:
        """The messages that can be unpacked."""
        for message in self._found:
            if not message.data.startswith(_PACKED):
                yield message
                continue
            data = _unpacked(message.data)
            if data is None:
                self.n_broken += 1
            else:
                yield message._replace(data=data)


def _unpacked(packed: bytes) -> bytes | None:
    unpacker = zstandard.ZstdDecompressor().decompressobj()
    try:
        data = unpacker.decompress(packed)
    except zstandard.ZstdError:
        return None
    return data if unpacker.eof else None
