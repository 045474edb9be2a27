"""How two bags differ: messages, types and quality of service, topic by topic."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path

from serd_bag.reader import BagReader
from serd_bag.topic import QOS, Channel


@dataclass(frozen=True)
class TopicDifference:
    """One topic of two bags: messages that both have, that only one has, and what else differs.

    Messages are the same where log time, publish time and bytes are. first_s: of the first message
    that only one has, after the first of both bags; None without one.
    """

    name: str
    n_same: int
    n_only_first: int
    n_only_second: int
    first_s: float | None
    others: tuple[str, ...]

    @property
    def is_same(self) -> bool:
        """Whether nothing differs."""
        return not (self.n_only_first or self.n_only_second or self.others)


def difference(first: str | Path, second: str | Path) -> tuple[TopicDifference, ...]:
    """Compare two bags, which may be damaged, whatever the order and compression of their files."""
    readers = [BagReader(path, tolerant=True) for path in (first, second)]
    found = [_messages(reader) for reader in readers]
    start_ns = min(
        (time for each in found for counts in each.values() for time, _ in counts), default=0
    )
    topics = []
    for name in sorted(set().union(*found, *(reader.topics for reader in readers))):
        one, other = (each.get(name, Counter()) for each in found)
        only_one, only_other = one - other, other - one
        times = [time_ns for time_ns, _ in (*only_one, *only_other)]
        topics.append(
            TopicDifference(
                *(name, (one & other).total(), only_one.total(), only_other.total()),
                (min(times) - start_ns) / 1e9 if times else None,
                _others(readers, name),
            )
        )
    return tuple(topics)


def _messages(reader: BagReader) -> dict[str, Counter[tuple[int, bytes]]]:
    found: dict[str, Counter[tuple[int, bytes]]] = {}
    for channel, _, data, log_time_ns, publish_time_ns in reader.records():
        digest = blake2b(data, digest_size=8, salt=publish_time_ns.to_bytes(16, "little")).digest()
        found.setdefault(channel.topic, Counter())[log_time_ns, digest] += 1
    return found


def _others(readers: list[BagReader], name: str) -> tuple[str, ...]:
    one, other = (
        [channel for channel in reader.channels if channel.topic == name] for reader in readers
    )
    if not (one and other):
        return ("only the first bag has it",) if one else ("only the second bag has it",)
    kinds: tuple[tuple[str, Callable[[Channel], str]], ...] = (
        ("type", lambda each: each.type_name),
        ("encoding", lambda each: each.encoding),
        ("quality of service", lambda each: each.value(QOS)),
    )
    return tuple(what for what, of in kinds if set(map(of, one)) != set(map(of, other)))
