"""`serd bag suggest`: a mapping for a bag of any robot, tested on what it gives.

Topics are ranked by type and name. Each pose topic must move, and each pair of a pose and a command
topic is tested: how often do command and motion disagree, by hold and delay? The mapping is then
used as `serd demos` uses it. Where the robot moves in more than 2 % of the decisions to wait, its
commands do not explain its motion. Then, and where there are none, actions are hidden: learning
uses the poses alone.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from serd_app.demonstrations.discretise import MOST_MOVING_WAITS, DiscretisationReport
from serd_app.demonstrations.grid.fitted_grid import USUAL_PATIENCE_S, USUAL_WAIT_S, fitted_grid
from serd_app.demonstrations.recorded import demonstrations_of_all
from serd_app.demonstrations.suggestion.candidates import (
    Candidates,
    PoseCandidate,
    cell_size_m,
    in_one_namespace,
    minimum_speed_mps,
    poses_alone,
)
from serd_app.demonstrations.suggestion.command_fit import USUAL_HOLD_S, CommandFit, fit_commands
from serd_app.drives.mapped.actions import MappedActions
from serd_app.drives.mapped.mapping import ASSUMED_UNITS, BagMapping
from serd_app.drives.recording import Recording
from serd_app.drives.table_drives import is_table
from serd_app.drives.transforms import TF_TYPES
from serd_app.errors import AppError
from serd_bag.damage import Losses
from serd_bag.errors import BagError, printable
from serd_bag.reader import BagReader
from serd_bag.topic import Topic

_MOST_DISAGREEMENT = 0.25
#: Pairs that disagree more than the best one by less than this are taken by their names.
_EQUAL = 0.03
_STILL = 0.98
_MOTION = ("(motion: the displacement of the next second is the action)",)
#: Of the usual minimum speed: a second of little motion is then no wait.
_SPEED_SHARES = (1.0, 0.4, 0.2)


@dataclass(frozen=True)
class Suggestion:
    """comments: by key of the mapping, or of the whole file where the key is empty.

    report: what the mapping gives on cells of cell_size_m; None where that is no decision.
    """

    bag: Path
    mapping: BagMapping
    comments: dict[str, tuple[str, ...]]
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
        values = self.mapping.model_dump(mode="json")
        defaults = BagMapping().model_dump(mode="json")
        for key, value in values.items():
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
    collected = Candidates(reader)
    poses, rejected = collected.poses(), collected.rejected
    if not poses:
        raise AppError(
            f"bag {bag} must hold poses of a robot that moves, as Odometry, PoseStamped or /tf;"
            f" it holds {_listed(reader.topics.values())}"
            + (f"; {'; '.join(rejected)}" if rejected else "")
            + "; pose_topic with pose_fields or robot_frame in a --mapping file name another pose"
        )
    ranked = tuple(f"pose on {each.topic.name}: {each.way}" for each in poses)
    comments = {"": (*ranked, *(f"left out: {line}" for line in rejected), ASSUMED_UNITS)}
    search = _Search(bag, collected, poses, comments)
    if collected.own:
        own = {**comments, "pose_topic": ("as the recorder of this project writes it",)}
        found = search.tested(collected.own.mapping, own, poses[0])
        if found.report is not None:
            return found
    return search.by_velocity() or search.by_poses()


@dataclass(frozen=True, eq=False)
class _Search:
    """poses: the likeliest first; comments: see `Suggestion`, those on actions are added."""

    bag: Path
    collected: Candidates
    poses: Sequence[PoseCandidate]
    comments: dict[str, tuple[str, ...]]

    def by_velocity(self) -> Suggestion | None:
        """None where no command topic explains the motion; the comments then state how far."""
        pairs = list(_fitted(self.poses, self.collected.actions))
        if not pairs:
            self.comments["action_from"] = (
                "no velocity commands were found, so actions are hidden",
                *_MOTION,
            )
            return None
        of_one = [each for each in pairs if in_one_namespace(each[0].topic.name, each[1])]
        if any(each[0].topic.type_name not in TF_TYPES for each in of_one):
            pairs = of_one  # /tf is in no namespace
        least = min(fit.disagreement for *_, fit in pairs)
        best = next(each for each in pairs if each[2].disagreement <= least + _EQUAL)
        pose, name, fit = best
        self.comments["action_from"] = _fit_comments(best, pairs)
        if fit.disagreement > _MOST_DISAGREEMENT:
            self.comments["action_from"] += (
                "so the commands are of no use, and actions are hidden",
                *_MOTION,
            )
            return None
        shares = []
        for mapping in _velocity_mappings(pose, name, fit):
            found = self.tested(mapping, {**self.comments, **_hold_comments(fit)}, pose)
            if found.report is not None:
                shares.append(found.report.n_moving_waits / found.report.n_decisions)
                if shares[-1] <= MOST_MOVING_WAITS:
                    return found
        reason = "they give no decision"
        if shares:
            waits = f"{100 * min(shares):.1f} % of the decisions"
            reason = f"{waits} would be waits while the robot moves"
        self.comments["action_from"] += (f"{reason}, so actions are hidden", *_MOTION)
        return None

    def by_poses(self) -> Suggestion:
        """By the likeliest pose; AppError where no pose gives a decision."""
        for pose in self.poses:
            found = self.tested(poses_alone(pose), self.comments, pose)
            if found.report is not None:
                return found
        raise AppError(
            f"bag {self.bag} must hold a drive without gaps of at least a second, its poses"
            f" ({', '.join(each.topic.name for each in self.poses)}) give no decision; record a"
            " longer one"
        )

    def tested(
        self, mapping: BagMapping, comments: Mapping[str, tuple[str, ...]], pose: PoseCandidate
    ) -> Suggestion:
        """The mapping as `serd demos` uses it; without report where it gives no decision."""
        if mapping.frame:
            moved = "/tf moves the frame of these poses in it, as a localisation corrects odometry"
            comments = {**comments, "frame": (moved,)}
        report, size_m = None, cell_size_m(pose.track)
        try:
            recording = Recording(self.bag, (self.collected.drive(mapping),), (), Losses())
            grid = fitted_grid([recording], size_m)
            (found,) = demonstrations_of_all([recording], grid, USUAL_PATIENCE_S, USUAL_WAIT_S)
            report = found.report if found.report.n_decisions else None
        except (BagError, AppError) as error:
            comments = {**comments, "": (*comments.get("", ()), str(error))}
        return Suggestion(self.bag, mapping, dict(comments), report, size_m)


def _fitted(
    poses: Sequence[PoseCandidate], actions: dict[str, MappedActions]
) -> Iterator[tuple[PoseCandidate, str, CommandFit]]:
    for pose in poses:
        for name, each in actions.items():
            at_s, commands_mps, _ = each.stated(pose.track)
            if len(at_s):
                least_mps = minimum_speed_mps(pose.track)
                yield pose, name, fit_commands(pose.track, at_s, commands_mps, least_mps)


def _fit_comments(
    best: tuple[PoseCandidate, str, CommandFit],
    pairs: Sequence[tuple[PoseCandidate, str, CommandFit]],
) -> tuple[str, ...]:
    """How far commands and motion disagree, for the best pair and for the others."""
    pose, name, fit = best
    others = (
        f"or {other.topic.name} with {topic}: they disagree in {100 * each.disagreement:.1f} %"
        for other, topic, each in pairs
        if (other, topic) != (pose, name)
    )
    return (
        f"commands on {name} and the motion of {pose.topic.name} disagree in"
        f" {100 * fit.disagreement:.1f} % of the time,",
        f"with the defaults (a command holds for {USUAL_HOLD_S:g} s) in {100 * fit.usual:.1f} %",
        *others,
    )


def _velocity_mappings(pose: PoseCandidate, name: str, fit: CommandFit) -> Iterator[BagMapping]:
    """To be tried one after the other."""
    still = fit.still_in_silence is not None and fit.still_in_silence >= _STILL
    for silence in ("wait", "unknown") if still else ("unknown",):
        for share in _SPEED_SHARES:
            yield pose.mapping.model_copy(
                update={
                    "action_from": "velocity",
                    "action_topic": name,
                    "hold_s": fit.hold_s,
                    "delay_s": fit.delay_s,
                    "silence": silence,
                    "minimum_speed_mps": round(share * minimum_speed_mps(pose.track), 4),
                }
            )


def _hold_comments(fit: CommandFit) -> dict[str, tuple[str, ...]]:
    found: dict[str, tuple[str, ...]] = {"delay_s": ("from a command to the motion",)}
    if fit.hold_s is None:
        found["hold_s"] = ("the robot keeps the last command until the next one",)
    else:
        found["hold_s"] = ("a command acts this long, then the robot stops",)
    if fit.still_in_silence is not None:
        share = f"{100 * fit.still_in_silence:.0f} %"
        found["silence"] = (f"where no command acts, the robot stands in {share} of the time",)
    return found


def _comment(line: str) -> str:
    """Names in a bag may hold line ends, which would end the comment, and what is not YAML."""
    return f"# {printable(' '.join(line.splitlines()))}"


def _listed(topics: Iterable[Topic]) -> str:
    names = sorted(f"{each.name} ({each.type_name})" for each in topics)
    return ", ".join(names) or "nothing"
