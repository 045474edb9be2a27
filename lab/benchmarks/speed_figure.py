"""Every comparison with a peer in one figure, from the kept results: how many times our time."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from lab.benchmarks.report import RESULTS
from serd_app.report import style
from serd_app.report.style import new_figure, save_figure

_BAR_IN, _ROOM_IN, _WIDTH_IN = 0.23, 1.3, 8.2


@dataclass(frozen=True)
class Peer:
    """times_ours: its time over ours for the same work."""

    name: str
    times_ours: float


@dataclass(frozen=True)
class Comparison:
    """ours: what we take for the work, in words."""

    work: str
    ours: str
    peers: tuple[Peer, ...]


def run() -> None:
    """Draw lab/results/speed.png; needs the results of the other benchmarks."""
    save_figure(RESULTS / "speed.png", speed_figure(list(comparisons())))


def comparisons() -> Iterator[Comparison]:
    """In the order of the README's table."""
    gridworld = [r for r in _rows("gradient") if r["problem"].startswith("gridworld")]
    known = {
        "thesis: value iteration and recursion": "value iteration and recursion of the thesis",
        "Q-gradient by LU, values known": "LU of the thesis, values known",
    }
    yield _by_time("gradient, 400 states", "ms", gridworld, "way", "serd_core", known)
    learning = _rows("learning_peers")
    for problem, work in (
        ("likelihood", "two rewards by likelihood"),
        ("features", "two rewards by features"),
        ("optimal control, 40000 states", "optimal control, 40,000 states"),
    ):
        rows = [row for row in learning if row["problem"] == problem]
        yield _by_time(work, "ms", rows, "by", "serd_core")
    bags = {(row["work"], row["by"]): row["messages/s"] for row in _rows("bags_throughput")}
    ours, theirs = bags["read bytes", "BagReader"], bags["read bytes", "rosbags"]
    yield Comparison("bags read", f"{ours:,.0f} messages/s", (Peer("rosbags", ours / theirs),))


def speed_figure(compared: Sequence[Comparison]) -> Figure:
    """A bar per peer on a logarithmic axis; 1 is our time."""
    n_bars = sum(len(each.peers) for each in compared) + len(compared)
    with style.report_style():
        figure = new_figure(_WIDTH_IN, _BAR_IN * n_bars + _ROOM_IN)
        axes = figure.subplots()
        labels: list[tuple[float, str]] = []
        place = 0.0
        for each in compared:
            labels.append((place, f"{each.work}: {each.ours}"))
            for peer in each.peers:
                place += 1
                _draw_bar(axes, place, peer)
                labels.append((place, peer.name))
            place += 1
        _label(axes, labels, {f"{each.work}: {each.ours}" for each in compared})
    return figure


def _draw_bar(axes: Axes, place: float, peer: Peer) -> None:
    colour = style.BLUE if peer.times_ours >= 1 else style.RED
    axes.barh(place, peer.times_ours - 1, left=1, height=0.72, color=colour)
    digits = 0 if peer.times_ours >= 10 else 1
    text = f"{peer.times_ours:,.{digits}f}×"
    axes.annotate(
        text, (max(peer.times_ours, 1), place), (3, 0), textcoords="offset points", va="center"
    )


def _label(axes: Axes, labels: Sequence[tuple[float, str]], headings: set[str]) -> None:
    axes.set_xscale("log")
    axes.set_xlim(0.3, 6_000)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda times, _: f"{times:,g}"))
    axes.axvline(1, color=style.INK, linewidth=1)
    axes.invert_yaxis()
    axes.set_yticks([place for place, _ in labels], [text for _, text in labels])
    axes.tick_params(axis="y", length=0)
    for tick in axes.get_yticklabels():
        heading = tick.get_text() in headings
        tick.set_fontweight("bold" if heading else "normal")
        tick.set_color(style.INK)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x")
    axes.set_xlabel("time of others over ours for the same work; left of 1, red: they are faster")


def _by_time(
    work: str,
    column: str,
    rows: Sequence[dict[str, Any]],
    by: str,
    ours: str,
    chosen: dict[str, str] | None = None,
) -> Comparison:
    """Rows with a time each; `chosen` renames, and leaves out, what is not in it."""
    times = {row[by]: row[column] for row in rows}
    base = times.pop(ours)
    names = chosen or {name: name for name in times}
    peers = tuple(Peer(text, times[name] / base) for name, text in names.items())
    return Comparison(work, f"{base:.3g} ms", tuple(sorted(peers, key=lambda p: -p.times_ours)))


def _rows(name: str) -> list[dict[str, Any]]:
    file = RESULTS / f"{name}.json"
    if not file.is_file():
        raise SystemExit(
            f"{file} must be there to draw; run `python -m lab {name.replace('_', '-')}` first"
        )
    rows: list[dict[str, Any]] = json.loads(file.read_text())["rows"]
    return rows
