"""What became of recordings, in words: a table of counts and what to be careful with."""

from collections import Counter
from collections.abc import Iterable, Sequence

from rich.markup import escape
from rich.table import Table

from report.style import counted
from serd_app.demonstrations.discretise import OFF_GRID
from serd_app.drives.mapped_drive import UNMARKED
from serd_cli.recorded_demonstrations import RecordedDemonstrations
from serd_cli.recording import Recording
from serd_cli.short_names import short_names

#: Share of decisions off the grid above which a bag may be that of another place.
_MANY_OUTSIDE = 0.1


def decisions_table(found: Sequence[RecordedDemonstrations]) -> Table:
    """One row per bag."""
    table = Table(title="Decisions", title_justify="left")
    table.add_column("bag", overflow="fold")
    for name in ("intents", "kept", "dropped", "episodes", "diagonal moves", "far moves"):
        table.add_column(name, justify="right")
    for name, each in zip(short_names([each.bag for each in found]), found, strict=True):
        report = each.report
        dropped = report.n_intents - report.n_decisions
        moves = report.n_diagonal, report.n_far
        counts = report.n_intents, report.n_decisions, dropped, report.n_episodes, *moves
        table.add_row(escape(name), *map(str, counts))
    return table


def remarks(found: Sequence[RecordedDemonstrations]) -> Iterable[str]:
    """Why intents were dropped and what was left out, over all bags; what is odd about each."""
    reasons = sum((Counter(each.report.dropped) for each in found), Counter[str]())
    yield from (f"dropped {count}: {reason}" for reason, count in reasons.most_common())
    left_out = (
        ("pose", "with a number that is not finite", "n_bad_poses"),
        ("pose", "about whose time no /tf was recorded", "n_unplaced_poses"),
        ("velocity command", "with a number that is not finite", "n_bad_commands"),
    )
    for what, why, name in left_out:
        count = sum(getattr(each.report, name) for each in found)
        if count:
            yield f"left out {counted(count, what)} {why}"
    for name, each in zip(short_names([each.bag for each in found]), found, strict=True):
        for line in (*_damage(each.recording), *_pieces(each.recording), *_place(each)):
            yield f"{name}: {line}"


def _damage(recording: Recording) -> Iterable[str]:
    yield from recording.damage
    if recording.damage:
        at_least = "" if recording.losses.all_known else "at least "
        yield f"{at_least}{counted(recording.losses.n_messages, 'message')} lost"


def _pieces(recording: Recording) -> Iterable[str]:
    """A drive without marks is one episode unless it has gaps, whose edges are no goals."""
    for drive in recording.drives:
        pieces = [span for span in drive.episodes if span.outcome == UNMARKED]
        if len(pieces) > 1:
            yield (
                f"cut into {len(pieces)} episodes where no pose came for more than"
                f" {drive.longest_gap_s:.2g} s; where they end need be no goal, so name one to"
                " 'serd learn' with --goal, or a longer longest_gap_s in the mapping"
            )


def _place(found: RecordedDemonstrations) -> Iterable[str]:
    outside = found.report.dropped.get(OFF_GRID, 0)
    if outside > _MANY_OUTSIDE * found.report.n_intents:
        yield (
            f"{outside} of {counted(found.report.n_intents, 'intent')} with the robot off the"
            " grid; is it this scenario?"
        )
