"""What `serd demos` prints: counts per bag, warnings, flow of people, files."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from serd_app.demonstrations.decision_table import FlowField
from serd_app.demonstrations.discretise import MOST_MOVING_WAITS, OFF_GRID, joined_reports
from serd_app.drives.mapping import GAP, GOAL, STOP, TURN
from serd_app.drives.recording import Recording
from serd_app.journeys.demonstrate import Demonstrated, RecordedDemonstrations
from serd_bag.quantities import counted
from serd_cli.output.terminal import console, progress_console, table_of
from serd_core.arrays import IntArray
from serd_core.grid.navigation import NO_FLOW

#: Share of decisions off the grid above which a bag may be that of another place.
_MANY_OUTSIDE = 0.1


def print_demonstrated(done: Demonstrated) -> None:
    """The counts as a table, what was left out and why, and the files."""
    if done.missing:
        progress_console.print(done.missing, soft_wrap=True)
    place = done.place
    console.print(decisions_table(done.found))
    for line in remarks(done.found):
        console.print(line, style="yellow", soft_wrap=True)
    console.print(
        f"cells of {place.grid.cell_size_m:g} m; a decision that leads to no other cell ends after"
        f" {place.patience_s:g} s, one to wait after {place.wait_s:g} s",
        soft_wrap=True,
    )
    console.print(flow_in_words(done.flow, place.flow), soft_wrap=True)
    for name, path in done.files.items():
        console.print(f"{name}: {path.resolve()}", soft_wrap=True)


def values_of(done: Demonstrated) -> dict[str, Any]:
    """The same by name, as plain values."""
    place = done.place
    return {
        "bags": [each.values() for each in done.found],
        "flow": flow_values(done.flow, place.flow),
        "cell_size_m": place.grid.cell_size_m,
        "too_few": done.too_few,
        "patience_s": place.patience_s,
        "wait_s": place.wait_s,
        "files": {name: str(path.resolve()) for name, path in done.files.items()},
    }


def decisions_table(found: Sequence[RecordedDemonstrations]) -> Table:
    """One row per bag."""
    table = table_of("Decisions", "bag", ("decisions", "without outcome", "dropped", "episodes"))
    for name, each in zip(short_names([each.bag for each in found]), found, strict=True):
        report = each.report
        counts = report.n_decisions, report.n_censored, report.n_dropped, report.n_episodes
        table.add_row(name, *map(str, counts))
    return table


def remarks(found: Sequence[RecordedDemonstrations]) -> Iterable[str]:
    """What was left out of all bags, and why; warnings about each bag."""
    reasons = sum((Counter(each.report.dropped) for each in found), Counter[str]())
    yield from (f"dropped {count}: {reason}" for reason, count in reasons.most_common())
    every = joined_reports([each.report for each in found])
    if every.fault_share:
        yield every.faults
    for what, why, name in _LEFT_OUT:
        if count := sum(getattr(each.report, name) for each in found):
            yield f"left out {counted(count, what)} {why}"
    for name, each in zip(short_names([each.bag for each in found]), found, strict=True):
        lines = (*_damage(each.recording), *_pieces(each.recording), *_decisions(each))
        yield from (f"{name}: {line}" for line in lines)


_LEFT_OUT = (
    ("pose", "with a number that is not finite", "n_bad_poses"),
    ("pose", "about whose time no /tf was recorded", "n_unplaced_poses"),
    ("velocity command", "with a number that is not finite", "n_bad_commands"),
)
#: Where drives without marks are cut: what is counted, and more about it.
_CUTS = {
    GAP: ("gap", " of more than {gap_s:.2g} s between poses"),
    GOAL: ("goal", ""),
    STOP: ("stop", ""),
    TURN: ("end", " of the ways of round trips"),
}


def _damage(recording: Recording) -> Iterable[str]:
    yield from recording.damage
    lost = recording.losses
    if recording.damage and not (lost.n_messages or lost.all_known):
        yield "messages lost: unknown, the damaged bag has no count"
    elif recording.damage:
        yield f"{'' if lost.all_known else 'at least '}{counted(lost.n_messages, 'message')} lost"


def _pieces(recording: Recording) -> Iterable[str]:
    """Where drives without marks were cut, and what a table does not state."""
    yield from recording.assumed
    cuts = sum((Counter(drive.cuts) for drive in recording.drives), Counter[str]())
    if not cuts:
        return
    gap_s = max(drive.longest_gap_s for drive in recording.drives)
    where = " and ".join(
        counted(cuts[kind], what) + more.format(gap_s=gap_s)
        for kind, (what, more) in _CUTS.items()
        if cuts[kind]
    )
    n_episodes = sum(len(drive.episodes) for drive in recording.drives)
    yield (
        f"cut into {counted(n_episodes, 'episode')} at {where}; goal_area_m, stop_s,"
        " round_trips and longest_gap_s in the mapping set others, 'serd learn --goal' the goal"
    )


def _decisions(found: RecordedDemonstrations) -> Iterable[str]:
    """Decisions of another place, waits of a robot that moves, and hidden actions."""
    report = found.report
    outside = report.dropped.get(OFF_GRID, 0)
    taken = outside + report.n_decisions
    if outside > _MANY_OUTSIDE * taken:
        of_all = f"{outside} of {counted(taken, 'decision')}"
        yield f"{of_all} with the robot off the grid; is it this scenario?"
    if report.n_moving_waits > MOST_MOVING_WAITS * report.n_decisions:
        yield (
            f"{report.n_moving_waits} of {counted(report.n_decisions, 'decision')} wait while the"
            " robot moves, so its actions do not explain its motion; 'serd bag suggest"
            f" {found.bag}' finds how long it follows a command, or set action_from: motion in the"
            " mapping"
        )
    if n_hidden := int(found.decisions.hidden.sum()):
        yield (
            f"{counted(n_hidden, 'decision')} without action, as poses alone are used: 'serd learn'"
            " learns from the states"
        )


def flow_values(found: FlowField | None, own: IntArray | None) -> dict[str, int] | None:
    """Counts of cells; None where no people were recorded. own: (S,) of the scenario, if any."""
    if found is None:
        return None
    known = found.flow != NO_FLOW
    values = {"n_cells": len(known), "n_known": known.sum(), "n_sightings": found.count.sum()}
    if own is not None:
        both = known & (own != NO_FLOW)
        values["n_compared"] = both.sum()
        values["n_as_scenario"] = (both & (found.flow == own)).sum()
        values["n_opposite"] = (both & (np.abs(found.flow - own) == 2)).sum()
    return {name: int(count) for name, count in values.items()}


def flow_in_words(found: FlowField | None, own: IntArray | None) -> str:
    """One line."""
    values = flow_values(found, own)
    if values is None:
        return "flow of people: none was recorded"
    line = "flow of people: known in {n_known} of {n_cells} cells from {n_sightings} sightings"
    if own is not None:
        line += "; {n_as_scenario} of {n_compared} as in the scenario, {n_opposite} opposite"
    return line.format(**values)


def short_names(paths: Sequence[Path]) -> list[str]:
    """The fewest last parts of the paths that differ wherever the paths do."""
    longest = max((len(path.parts) for path in paths), default=0)
    for count in range(1, longest + 1):
        names = [str(Path(*path.parts[-count:])) for path in paths]
        if len(set(names)) == len(set(paths)):
            return names
    return [str(path) for path in paths]
