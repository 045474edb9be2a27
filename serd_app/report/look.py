"""The first page about a recording, without a model: what `serd look` does."""

import math
import shlex
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from serd_app.demonstrations.discretise import demonstrations_of_drives
from serd_app.demonstrations.fitted_grid import (
    USUAL_WAIT_S,
    fitted_grid,
    fitting_cell_size_m,
    fitting_patience_s,
)
from serd_app.demonstrations.flow_field import recorded_sightings
from serd_app.demonstrations.suggest import suggest_mapping
from serd_app.drives.actions import MappedActions, PoseTrack
from serd_app.drives.drive import EPISODE, INTENT, POSE, RecordedDrive, source_of
from serd_app.drives.mapped import MappedPoses
from serd_app.drives.mapping import BagMapping
from serd_app.drives.recording import Recording, is_table, read_mapping, read_recording
from serd_app.drives.scan_map import PlaceMap, RecordedMap
from serd_app.learning.criticism import FEWEST_DRIVES
from serd_bag.health.check import BagCheck, check_bag
from serd_bag.quantities import counted
from serd_bag.reader import BagReader
from serd_bag.topic import topics_named
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Action, Grid, Outcome
from serd_files.errors import USER_ERRORS

#: Nats that one more drive may still add to what is known of moves where there are enough.
_ENOUGH_NATS = 0.3
_WAYS = {
    "gap": "a gap between poses",
    "goal": "the goal area",
    "stop": "a stop",
    "turn": "the far end of a round trip",
}
#: Places of people that are kept for the page.
_MOST_PEOPLE = 20_000


@dataclass(frozen=True)
class LookedDrive:
    """A drive that was found: when and how far it went, and why it ends."""

    number: int
    agent: str
    start_s: float
    duration_s: float
    way_m: float
    ends: str
    demonstrates: bool


@dataclass(frozen=True, eq=False)
class Looked:
    """What a recording shows. tracks_m: per drive (T, 3) of time (s), x and y; people (N, 3)
    likewise. commands: (C, 2) times and forward speeds that were sent. outcomes: of moves by
    commands, counted; n_decisions: all. mapping: as it was used, None for our own bags and tables;
    mapping_file: that was given. failure: why no drive was found, else empty. enough: the sentence
    about what is missing.
    """

    path: Path
    recording: Recording | None = None
    mapping: BagMapping | None = None
    mapping_file: Path | None = None
    drives: tuple[LookedDrive, ...] = ()
    tracks_m: tuple[FloatArray, ...] = ()
    people: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    n_people: int = 0
    commands: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    disagreement: str = ""
    place: PlaceMap | None = None
    cell_size_m: float = 0.0
    n_decisions: int = 0
    n_episodes: int = 0
    outcomes: dict[str, int] = field(default_factory=dict)
    check: BagCheck | None = None
    remarks: tuple[str, ...] = ()
    failure: str = ""
    enough: str = ""

    def next_commands(self) -> tuple[str, ...]:
        """The commands that make decisions of it; none where it gives none."""
        if not self.n_decisions:
            return ()
        path = shlex.quote(str(self.path))
        if self.mapping_file is not None:
            return (f"serd demos {path} --mapping {shlex.quote(str(self.mapping_file))}",)
        if self.mapping is None:
            cells = "" if is_table(self.path) else f" --cell-size-m {self.cell_size_m:g}"
            return (f"serd demos {path}{cells}",)
        return (f"serd bag suggest {path}", f"serd demos {path} --mapping mapping.yaml")


def look(path: Path, mapping: Path | None = None) -> Looked:
    """Read a bag or a table and state what it shows; FileError where there is none.

    mapping: as of `serd demos`; without one a bag of another robot gets the suggested one.
    """
    given = read_mapping(mapping, [path])
    if is_table(path):
        recording = read_recording(path, mapping=given, tolerant=True)
        people = [np.column_stack([p.time_s, p.position_m]) for p in recording.people]
        found = Looked(path, recording, mapping_file=mapping, remarks=recording.assumed)
        return _completed(replace(found, n_people=len(people), people=_stacked(people)))
    check = check_bag(path)
    remarks = (*check.faults, *check.remarks)
    found = Looked(path, mapping_file=mapping, check=check, remarks=remarks)
    try:
        found = _drives_of_bag(found, given if isinstance(given, BagMapping) else None)
    except USER_ERRORS as error:
        found = replace(found, failure=str(error))
    return _completed(_with_place(found))


def _stacked(parts: list[FloatArray]) -> FloatArray:
    table = np.concatenate(parts) if parts else np.zeros((0, 3))
    return table[:: 1 + len(table) // _MOST_PEOPLE]


def _drives_of_bag(found: Looked, given: BagMapping | None) -> Looked:
    reader = BagReader(found.path, tolerant=True)
    is_own = all(topics_named(reader.topics, name) for name in (POSE, INTENT, EPISODE))
    mapping, comments = given, tuple[str, ...]()
    if mapping is None and not is_own:
        suggestion = suggest_mapping(found.path)
        mapping = suggestion.mapping
        comments = (*suggestion.comments.get("", ()), *suggestion.comments.get("action_from", ()))
    recording = read_recording(found.path, mapping=mapping, tolerant=True)
    return replace(
        found, recording=recording, mapping=mapping, disagreement="; ".join(comments[:6])
    )


def _with_place(found: Looked) -> Looked:
    """The same with map, commands and people, of one more pass over the bag."""
    reader = BagReader(found.path, tolerant=True)
    seen, source = RecordedMap(reader.topics), source_of(found.path)
    mapping = found.mapping or BagMapping()
    poses = actions = None
    if found.recording is not None:
        poses = MappedPoses(reader.topics, mapping, source)
        if mapping.action_from == "velocity":
            topic = topics_named(reader.topics, mapping.action_topic)
            actions = MappedActions(mapping, reader.topics[topic[0]], source) if topic else None
    wanted = {*seen.topics, *(poses.topics if poses else ()), *(actions.topics if actions else ())}
    for message in reader.messages(wanted & reader.topics.keys()):
        seen.take(message)
        if poses is not None and message.topic in poses.topics:
            poses.take(message)
        if actions is not None and message.topic in actions.topics:
            actions.take(message)
    track = _track(poses, mapping)
    commands = np.zeros((0, 2))
    if actions is not None and track is not None and actions.has_messages:
        at_s, vectors, _ = actions.stated(track)
        commands = np.column_stack([at_s, vectors[:, 0]])
    people, n_people = _people(reader, mapping)
    return replace(
        found, place=seen.map(track), commands=commands, people=people,
        n_people=n_people,
    )  # fmt: skip


def _track(poses: MappedPoses | None, mapping: BagMapping) -> PoseTrack | None:
    try:
        return None if poses is None else poses.track(mapping)
    except USER_ERRORS:
        return None


def _people(reader: BagReader, mapping: BagMapping) -> tuple[FloatArray, int]:
    """Time, x and y of each sighting, and the most at one time."""
    if not topics_named(reader.topics, mapping.people_topic):
        return np.zeros((0, 3)), 0
    try:
        seen = recorded_sightings(reader, mapping.people_topic, frame=mapping.frame)
    except USER_ERRORS:
        return np.zeros((0, 3)), 0
    rows = [
        np.column_stack(
            [np.full(len(each.people.position_m), each.time_s), each.people.position_m[:, :2]]
        )
        for each in seen
    ]
    return _stacked(rows), max((len(each) for each in rows), default=0)


def _completed(found: Looked) -> Looked:
    """The same with drives, outcomes and the sentence about what is missing."""
    recording = found.recording
    drives, tracks = _drives(recording.drives) if recording is not None else ((), ())
    found = replace(found, drives=drives, tracks_m=tracks)
    if recording is not None:
        try:
            found = _with_decisions(found, recording)
        except USER_ERRORS as error:
            found = replace(found, failure=str(error))
    return replace(found, enough=_enough(found))


def _drives(
    drives: tuple[RecordedDrive, ...],
) -> tuple[tuple[LookedDrive, ...], tuple[FloatArray, ...]]:
    rows, tracks = list[LookedDrive](), list[FloatArray]()
    for drive in drives:
        for span in drive.episodes:
            inside = (drive.pose_time_s >= span.start_s) & (drive.pose_time_s <= span.end_s)
            track = np.column_stack([drive.pose_time_s, drive.position_m])[inside]
            if len(track) < 2:
                continue
            way_m = float(np.hypot(*np.diff(track[:, 1:], axis=0).T).sum())
            ends = _WAYS.get(span.ended_by, "")
            marked = span.outcome.replace("_", " ") if span.outcome not in ("unmarked",) else ""
            ends = ends or (f"marked as {marked}" if marked else "the end of the recording")
            agent = drive.source.rsplit("/", 1)[-1] if len(drives) > 1 else ""
            duration_s = span.end_s - span.start_s
            row = (span.start_s, duration_s, way_m, ends, span.demonstrates)
            rows.append(LookedDrive(len(rows) + 1, agent, *row))
            tracks.append(track)
    return tuple(rows), tuple(tracks)


def _with_decisions(found: Looked, recording: Recording) -> Looked:
    """The same with what the robot did when it was to go somewhere."""
    drives = recording.drives
    size_m = fitting_cell_size_m(drives)
    grid = fitted_grid([recording], size_m)
    decisions, report = demonstrations_of_drives(
        drives, grid, fitting_patience_s(drives, size_m), USUAL_WAIT_S, agents=recording.of_table
    )
    return replace(
        found,
        cell_size_m=size_m,
        n_decisions=report.n_decisions,
        n_episodes=report.n_episodes,
        outcomes=outcome_counts(grid, decisions),
    )


def outcome_counts(grid: Grid, decisions: TimedDecisions) -> dict[str, int]:
    """Where shown moves led that could lead to another cell, relative to where they were for."""
    moves = ~decisions.hidden & (decisions.censored == 0) & (decisions.action != Action.WAIT)
    state, action = decisions.state[moves], decisions.action[moves]
    next_state, found = decisions.next_state[moves], Counter[str]()
    open_way = grid.neighbours[state, action] != state
    stayed = next_state == state
    for turn, outcome in enumerate(list(Outcome)[1:]):
        there = grid.neighbours[state, (action - 1 + turn) % 4 + 1] == next_state
        found[outcome.name.lower()] = int((there & ~stayed & open_way).sum())
    found[Outcome.STAY.name.lower()] = int((stayed & open_way).sum())
    return dict(found)


def _enough(found: Looked) -> str:
    """What there is to learn from, and how many more drives would do.

    One more drive of as many moves m as the others adds about (K - 1) / 2 log(1 + m / n) nats to
    what n moves tell of K outcomes (`serd_core.bayes.information`); enough is below 0.3 nats.
    """
    if found.failure or not found.drives:
        return f"Nothing can be learned from it yet: {found.failure or 'it holds no drive'}."
    used = [each for each in found.drives if each.demonstrates]
    way_m = np.mean([each.way_m for each in used]) if used else 0.0
    have = f"{counted(len(used), 'drive')} of {way_m:.0f} m{' each' if len(used) > 1 else ''}"
    n_moves = sum(found.outcomes.values())
    if not n_moves:
        needed = max(FEWEST_DRIVES - len(used), 0)
        more = f"; {needed} more would allow a test" if needed else ""
        return f"{have} without actions: only where it went can be learned{more}."
    half = (len(Outcome) - 1) / 2
    wanted = math.ceil(1.0 / (math.exp(_ENOUGH_NATS / half) - 1.0))
    missing = max(wanted, FEWEST_DRIVES) - len(used)
    if missing <= 0:
        return f"{have} with {counted(n_moves, 'move')}: enough to learn from."
    fewer = "is" if len(used) == 1 else "are"
    return (
        f"{have} with {counted(n_moves, 'move')} {fewer} too little for a claim;"
        f" {missing} more from where {'it' if len(used) == 1 else 'they'} began would do."
    )
