"""What a rescue saved and what it did not: of each file byte by byte, of each topic in bounds."""

import html
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from serd_bag.damage import Span

_SECOND_NS = 1_000_000_000
_N_BINS = 400
_COLOURS = {"read": "#2e7d32", "partly read": "#f9a825", "lost": "#c62828", "not ours": "#b0bec5"}


@dataclass(frozen=True)
class FileBytes:
    """All bytes of one file, in order."""

    path: Path
    spans: tuple[Span, ...]

    def n_bytes(self, state: str) -> int:
        """Number of bytes in a state."""
        return sum(span.end - span.start for span in self.spans if span.state == state)


@dataclass(frozen=True)
class TopicSaved:
    """Messages of one topic that were saved, and bounds of what was lost.

    n_doubtful: of n_saved, those of damaged parts, for which no checksum vouches; doubtful: first
    and last of each run of them, counted from 0 within the topic. least_lost, most_lost: messages,
    the latter None where nothing states how many there were; most_seconds_lost: time between saved
    messages on both sides of all damage, None where the end of the recording is lost; per_second:
    saved messages by whole second of log time.
    """

    name: str
    n_saved: int
    n_doubtful: int
    doubtful: tuple[tuple[int, int], ...]
    least_lost: int
    most_lost: int | None
    most_seconds_lost: float | None
    per_second: dict[int, int]


@dataclass(frozen=True)
class Certificate:
    """The result of `rescue`.

    damage: sentences, in order; n_left_out: messages that were found, but not saved; least_lost:
    messages that are known to be lost; most_lost: that may be, None where nothing states how many
    there were.
    """

    source: Path
    target: Path
    files: tuple[FileBytes, ...]
    topics: tuple[TopicSaved, ...]
    damage: tuple[str, ...]
    n_left_out: int
    least_lost: int
    most_lost: int | None

    @property
    def n_messages(self) -> int:
        """Messages that were saved."""
        return sum(topic.n_saved for topic in self.topics)

    @property
    def n_doubtful(self) -> int:
        """Those of them for which no checksum vouches."""
        return sum(topic.n_doubtful for topic in self.topics)

    @property
    def is_complete(self) -> bool:
        """Whether nothing was lost."""
        n_uncertain = self.least_lost + self.n_left_out + self.n_doubtful
        return not n_uncertain and self.most_lost == 0

    def values(self) -> dict[str, Any]:
        """Everything as plain values."""
        names = ("n_messages", "n_doubtful", "is_complete")
        return asdict(self) | {name: getattr(self, name) for name in names}

    def page(self) -> str:
        """One HTML page: each file as a bar of its bytes, each topic as a line of time."""
        seconds = [second for topic in self.topics for second in topic.per_second]
        first, last = min(seconds, default=0), max(seconds, default=0)
        bars = "".join(map(_file_bar, self.files))
        lines = "".join(_topic_line(topic, first, last + 1) for topic in self.topics)
        damage = "".join(f"<li>{html.escape(each)}</li>" for each in self.damage)
        legend = " ".join(
            f'<span style="color:{colour}">&#9632; {state}</span>'
            for state, colour in _COLOURS.items()
        )
        return _PAGE.format(
            title=html.escape(f"{self.source.name}: {self.n_messages} messages saved"),
            lost=html.escape(lost_in_words(self)),
            legend=legend,
            bars=bars,
            seconds=last + 1 - first,
            lines=lines,
            damage=damage or "<li>none</li>",
        )


def lost_in_words(found: Certificate | TopicSaved) -> str:
    """Bounds of the messages that were lost."""
    if found.most_lost is None:
        return f"at least {found.least_lost}" if found.least_lost else "unknown, there is no count"
    if found.most_lost == found.least_lost:
        return str(found.least_lost)
    return f"{found.least_lost} to {found.most_lost}"


def time_in_words(topic: TopicSaved) -> str:
    """The seconds that the messages lost of a topic may have taken."""
    return "to the end" if (most := topic.most_seconds_lost) is None else f"{most:.2f}"


def _file_bar(file: FileBytes) -> str:
    size = max(1, sum(span.end - span.start for span in file.spans))
    parts = "".join(
        _rectangle(
            span.start / size,
            (span.end - span.start) / size,
            _COLOURS[span.state],
            f"bytes {span.start} to {span.end}: {span.state} {span.reason}",
        )
        for span in file.spans
    )
    counts = ", ".join(f"{file.n_bytes(state)} B {state}" for state in _COLOURS)
    return f"<h3>{html.escape(str(file.path))}</h3><p>{counts}</p>{_bar(parts)}"


def _topic_line(topic: TopicSaved, first: int, stop: int) -> str:
    """Where the topic has messages, in bins of at least a second."""
    width = max(1, -(-(stop - first) // _N_BINS))
    counts = Counter[int]()
    for second, count in topic.per_second.items():
        counts[(second - first) // width] += count
    most = max(counts.values(), default=1)
    parts = "".join(
        _rectangle(
            number * width / (stop - first),
            width / (stop - first),
            f"rgba(21,101,192,{0.3 + 0.7 * count / most:.2f})",
            f"{count} messages from {number * width} s",
        )
        for number, count in sorted(counts.items())
    )
    about = (
        f"{topic.n_saved} saved, {topic.n_doubtful} of them doubtful, lost: {lost_in_words(topic)},"
        f" seconds at most: {time_in_words(topic)}"
    )
    return f"<tr><td>{html.escape(topic.name)}</td><td>{_bar(parts)}</td><td>{about}</td></tr>"


def _bar(parts: str) -> str:
    return f'<svg viewBox="0 0 1000 20" preserveAspectRatio="none">{parts}</svg>'


def _rectangle(start: float, width: float, colour: str, about: str) -> str:
    return (
        f'<rect x="{1000 * start:.2f}" width="{max(0.6, 1000 * width):.2f}" height="20"'
        f' fill="{colour}"><title>{html.escape(about)}</title></rect>'
    )


def runs(numbers: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """First and last of each run of numbers that follow each other."""
    found: list[tuple[int, int]] = []
    for number in numbers:
        if found and found[-1][1] == number - 1:
            found[-1] = found[-1][0], number
        else:
            found.append((number, number))
    return tuple(found)


_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 15px sans-serif; max-width: 1100px; margin: 2em auto; }}
svg {{ width: 100%; height: 20px; background: #eceff1; }}
table {{ width: 100%; border-collapse: collapse; }}
td {{ padding: 4px 8px; }} td:nth-child(2) {{ width: 50%; }}
</style></head><body>
<h1>{title}</h1><p>Messages lost: {lost}.</p>
<h2>Bytes</h2><p>{legend}</p>{bars}
<h2>Time, {seconds} s</h2><table>{lines}</table>
<h2>Damage</h2><ul>{damage}</ul>
</body></html>
"""
