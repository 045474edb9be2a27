"""A message as it stands in a bag."""

from typing import NamedTuple


class RawMessage(NamedTuple):
    """data: CDR bytes as recorded."""

    topic: str
    type_name: str
    data: bytes
    log_time_ns: int
    publish_time_ns: int
