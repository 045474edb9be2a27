"""`serd bag suggest`: a mapping for a bag of any robot, tested on what it gives.

Topics are ranked by type and name. Each pose topic must move, and each pair of a pose and a command
topic is tested: at times a step apart, the command that acts by a hold and a delay predicts whether
the robot moves, and to which side; the disagreement is the share of the times at which it does not.
The mapping is then used as `serd demos` uses it. Where the robot moves in more than 2 % of the
decisions to wait, its commands do not explain its motion. Then, and where there are none, actions
are hidden: learning uses the poses alone.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from serd_app.demonstrations.candidates import Candidates, PoseCandidate
from serd_app.demonstrations.discretise import (
    MOST_MOVING_WAITS,
    DiscretisationReport,
    demonstrations_of_drives,
)
from serd_app.demonstrations.fitted_grid import USUAL_PATIENCE_S, USUAL_WAIT_S, fitted_grid
from serd_app.drives.actions import PoseTrack
from serd_app.drives.drive import EPISODE, INTENT, POSE
from serd_app.drives.mapping import ASSUMED_UNITS, BagMapping, usual_gap_s
from serd_app.drives.recording import Recording, is_table
from serd_app.errors import AppError
from serd_bag.errors import BagError, printable
from serd_bag.reader import BagReader
from serd_bag.topic import topics_named
from serd_core.arrays import BoolArray, FloatArray

#: In the order of preference where they explain the motion equally well.
_HOLDS_S = (0.5, np.inf, 1.0, 0.25, 2.0, 0.1, 0.75, 1.5, 3.0, 5.0)
_DELAYS_S = tuple(round(0.05 * number, 2) for number in range(31))
_EQUAL_FITS = 0.005
_SHORTEST_STEP_S = 0.2
_MOST_TIMES = 20_000
_FEWEST_SILENT = 5
_BRAKING_S = 1.0
_MOST_DISAGREEMENT = 0.25
#: Pairs that disagree more than the best one by less than this are taken by their names.
_EQUAL_PAIRS = 0.03
_STILL = 0.98
_MOTION = "(motion: the displacement of the next second is the action)"
Comments = dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class Suggestion:
    """comments: by key of the mapping, or of the whole file where the key is empty.

    report: what the mapping gives on cells of cell_size_m; None where that is no decision.
    """

    bag: Path
    mapping: BagMapping
    comments: Comments
    report: DiscretisationReport | None
    cell_size_m: float

    def command(self, mapping: Path) -> str:
        """The next command."""
        return f"serd demos {self.bag} --mapping {mapping}"

    def yaml(self, path: Path) -> str:
        """The mapping file, with everything that was assumed as comments."""
        head = (
            f"Written by 'serd bag suggest {self.bag}'; correct what is wrong, then run",
            f"  {self.command(path)}",
            *self.comments.get("", ()),
        )
        lines = [_comment(line) for line in head]
        defaults = BagMapping().model_dump(mode="json")
        for key, value in self.mapping.model_dump(mode="json").items():
            if key in self.comments or value != defaults[key]:
                lines += ["", *map(_comment, self.comments.get(key, ()))]
                lines.append(f"{key}: {json.dumps(value)}")
        return "\n".join(lines) + "\n"


def suggest_mapping(bag: Path) -> Suggestion:
    """A mapping that gives decisions; AppError where the bag has no pose of a robot that moves."""
    if is_table(bag):
        raise AppError(
            f"{bag} must be a bag, got another file; a table of trajectories needs no mapping, run"
            f" 'serd demos {bag}'"
        )
    reader = BagReader(bag, tolerant=True)
    if all(topics_named(reader.topics, name) for name in (POSE, INTENT, EPISODE)):
        raise AppError(
            f"{bag} must be of another robot, it holds {POSE}, {INTENT} and {EPISODE} as our"
            f" recorder writes them and needs no mapping; run 'serd demos {bag} --scenario NAME'"
        )
    collected = Candidates(reader)
    poses, rejected = collected.poses, collected.rejected
    if not poses:
        known = sorted(f"{topic.name} ({topic.type_name})" for topic in reader.topics.values())
        raise AppError(
            f"bag {bag} must hold poses of a robot that moves, as Odometry, PoseStamped or /tf;"
            f" it holds {', '.join(known) or 'nothing'}"
            + (f"; {'; '.join(rejected)}" if rejected else "")
            + "; pose_topic with pose_fields or robot_frame in a --mapping file name another pose"
        )
    ranked = tuple(f"pose on {pose.topic.name}: {pose.way}" for pose in poses)
    comments = {"": (*ranked, *(f"left out: {line}" for line in rejected), ASSUMED_UNITS)}
    found = _by_velocity(bag, collected, comments)
    if found is not None:
        return found
    for pose in poses:
        found = _tested(bag, collected, pose.alone, comments, pose)
        if found.report is not None:
            return found
    raise AppError(
        f"bag {bag} must hold a drive without gaps of at least a second, its poses"
        f" ({', '.join(pose.topic.name for pose in poses)}) give no decision; record a longer one"
    )


class CommandFit(NamedTuple):
    """How long a robot follows a velocity command, and after what delay.

    hold_s: None until the next command. still_in_silence: share of the times without a command at
    which the robot stood, None where there are too few.
    """

    hold_s: float | None
    delay_s: float
    disagreement: float
    still_in_silence: float | None


class _Pair(NamedTuple):
    """A pose, a command topic, and how well it explains the motion of the pose."""

    pose: PoseCandidate
    topic: str
    fit: CommandFit


def _by_velocity(bag: Path, collected: Candidates, comments: Comments) -> Suggestion | None:
    """None where no command topic explains the motion; the comments then state how far."""
    pairs = [
        _Pair(pose, name, _fit(pose, at_s, commands_mps))
        for pose in collected.poses
        for name, actions in collected.actions.items()
        for at_s, commands_mps, _ in [actions.stated(pose.track)]
        if len(at_s)
    ]
    if not pairs:
        comments["action_from"] = (
            "no velocity commands were found, so actions are hidden",
            _MOTION,
        )
        return None
    least = min(pair.fit.disagreement for pair in pairs) + _EQUAL_PAIRS
    best = next(pair for pair in pairs if pair.fit.disagreement <= least)
    comments["action_from"] = _fit_comments(best, pairs)
    reason = "the commands are of no use"
    if best.fit.disagreement <= _MOST_DISAGREEMENT:
        mapping, held = _velocity_mapping(best), _hold_comments(best.fit)
        found = _tested(bag, collected, mapping, {**comments, **held}, best.pose)
        if found.report is None:
            reason = "they give no decision"
        else:
            share = found.report.n_moving_waits / found.report.n_decisions
            if share <= MOST_MOVING_WAITS:
                return found
            reason = f"{100 * share:.1f} % of the decisions would be waits while the robot moves"
    comments["action_from"] += (f"{reason}, so actions are hidden", _MOTION)
    return None


def _tested(
    bag: Path,
    collected: Candidates,
    mapping: BagMapping,
    comments: Mapping[str, tuple[str, ...]],
    pose: PoseCandidate,
) -> Suggestion:
    """The mapping as `serd demos` uses it; without report where it gives no decision."""
    noted, report, size_m = dict(comments), None, pose.cell_size_m
    if mapping.frame:
        moved = "/tf moves the frame of these poses in it, as a localisation corrects odometry"
        noted["frame"] = (moved,)
    try:
        drives = (collected.drive(mapping),)
        grid = fitted_grid([Recording(bag, drives)], size_m)
        _, found = demonstrations_of_drives(drives, grid, USUAL_PATIENCE_S, USUAL_WAIT_S)
        report = found if found.n_decisions else None
    except (BagError, AppError) as error:
        noted[""] = (*noted.get("", ()), str(error))
    return Suggestion(bag, mapping, noted, report, size_m)


class _Motion(NamedTuple):
    """Displacements (N, 2) in steps of equal length, without those in gaps of the poses.

    ahead: (N, 2) the heading in the middle; moves: (N,) whether the robot moves.
    """

    middle_s: FloatArray
    moved_m: FloatArray
    ahead: FloatArray
    moves: BoolArray


def _motion(track: PoseTrack, least_mps: float) -> _Motion:
    step_s = max(_SHORTEST_STEP_S, 2.0 * float(np.median(np.diff(track.time_s))))
    time_s = np.arange(track.time_s[0], track.time_s[-1] - step_s, step_s)
    time_s = time_s[:: len(time_s) // _MOST_TIMES + 1]
    after = np.searchsorted(track.time_s, time_s + step_s).clip(1, len(track.time_s) - 1)
    gap_s = track.time_s[after] - track.time_s[after - 1]
    time_s = time_s[gap_s <= usual_gap_s(track.time_s)]
    middle_s, moved_m = time_s + step_s / 2, track.at(time_s + step_s) - track.at(time_s)
    yaw_rad = np.interp(middle_s, track.time_s, np.unwrap(track.poses[:, 2]))
    ahead = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=1)
    return _Motion(middle_s, moved_m, ahead, np.hypot(*moved_m.T) >= least_mps * step_s)


def _fit(pose: PoseCandidate, at_s: FloatArray, commands_mps: FloatArray) -> CommandFit:
    """at_s (C,) increasing, commands_mps (C, 2) forward and left."""
    least_mps = pose.minimum_speed_mps
    motion = _motion(pose.track, least_mps)
    (east, north), (x, y) = motion.ahead.T, motion.moved_m.T

    def acting(hold_s: float, delay_s: float) -> tuple[BoolArray, FloatArray]:
        """Whether a command acts in each step, and the newest one."""
        row = np.searchsorted(at_s + delay_s, motion.middle_s, side="right") - 1
        age_s = motion.middle_s - delay_s - at_s[row]
        return (row >= 0) & (age_s <= hold_s), commands_mps[row]

    def disagreement(hold_s: float, delay_s: float) -> float:
        acts, command_mps = acting(hold_s, delay_s)
        forward, left = command_mps.T
        commanded = acts & (np.hypot(forward, left) >= least_mps)
        along = (forward * east - left * north) * x + (forward * north + left * east) * y
        wrong = (commanded != motion.moves) | (commanded & motion.moves & (along <= 0.0))
        return float(wrong.mean()) if len(wrong) else 1.0

    table = np.array([[disagreement(hold, delay) for delay in _DELAYS_S] for hold in _HOLDS_S])
    row = int(np.argmax(table.min(axis=1) <= table.min() + _EQUAL_FITS))
    column = int(np.argmax(table[row] <= table[row].min() + _EQUAL_FITS / 2))
    hold_s, delay_s = _HOLDS_S[row], _DELAYS_S[column]
    silent = ~acting(hold_s + _BRAKING_S, delay_s)[0]
    return CommandFit(
        hold_s=None if np.isinf(hold_s) else hold_s,
        delay_s=delay_s,
        disagreement=float(table[row, column]),
        still_in_silence=float((~motion.moves)[silent].mean())
        if silent.sum() >= _FEWEST_SILENT
        else None,
    )


def _fit_comments(best: _Pair, pairs: Sequence[_Pair]) -> tuple[str, ...]:
    """How far commands and motion disagree, for the best pair and for the others."""
    others = (
        f"or {pair.pose.topic.name} with {pair.topic}: they disagree in"
        f" {100 * pair.fit.disagreement:.1f} %"
        for pair in pairs
        if pair is not best
    )
    return (
        f"commands on {best.topic} and the motion of {best.pose.topic.name} disagree in"
        f" {100 * best.fit.disagreement:.1f} % of the time",
        *others,
    )


def _velocity_mapping(pair: _Pair) -> BagMapping:
    still = pair.fit.still_in_silence
    return pair.pose.mapping.model_copy(
        update={
            "action_from": "velocity",
            "action_topic": pair.topic,
            "hold_s": pair.fit.hold_s,
            "delay_s": pair.fit.delay_s,
            "silence": "wait" if still is not None and still >= _STILL else "unknown",
            "minimum_speed_mps": pair.pose.minimum_speed_mps,
        }
    )


def _hold_comments(fit: CommandFit) -> Comments:
    hold = "a command acts this long, then the robot stops"
    if fit.hold_s is None:
        hold = "the robot keeps the last command until the next one"
    found: Comments = {"delay_s": ("from a command to the motion",), "hold_s": (hold,)}
    if fit.still_in_silence is not None:
        share = f"{100 * fit.still_in_silence:.0f} %"
        found["silence"] = (f"where no command acts, the robot stands in {share} of the time",)
    return found


def _comment(line: str) -> str:
    """Names in a bag may hold line ends, which would end the comment, and what is not YAML."""
    return f"# {printable(' '.join(line.splitlines()))}"
