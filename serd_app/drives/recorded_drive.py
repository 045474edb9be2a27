"""What a bag holds of a drive: poses, intents and episodes, on the clock of the header stamps."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from serd_app.drives.episode_spans import EpisodeSpan
from serd_bag.errors import BagError
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import HIDDEN
from serd_core.grid.grid import action_of_direction

POSE, INTENT = "robot_pose", "intent"
NOT_FINITE = "direction not finite"
LONGEST_GAP_S = 0.5
#: In place of an action: no command is in force from then on.
SILENCE = HIDDEN - 1


@dataclass(frozen=True, eq=False)
class RecordedDrive:
    """pose_time_s (T,) increasing, position_m (T, 2); intent_time_s, intent_action (N,).

    intent_action: `Action`, `HIDDEN` or `SILENCE`. intent_hold_s: how long an intent is in force
    where no other one comes; None for the patience of the driver.
    n_bad_poses: poses left out because a number in them is not finite; n_bad_commands: velocity
    commands likewise.
    n_unplaced_poses: those left out because no transform was recorded about their time.
    dropped: intents that are none already, by why.
    longest_gap_s: between two poses across which the place is still interpolated.
    minimum_speed_mps: mean speed from which on the robot moves.
    cuts: how many episodes without marks end at a gap, a goal, a stop or a turn.
    """

    pose_time_s: FloatArray
    position_m: FloatArray
    intent_time_s: FloatArray
    intent_action: IntArray
    episodes: tuple[EpisodeSpan, ...]
    source: str = ""
    n_bad_poses: int = 0
    n_unplaced_poses: int = 0
    n_bad_commands: int = 0
    dropped: Mapping[str, int] = field(default_factory=dict)
    intent_hold_s: float | None = None
    longest_gap_s: float = LONGEST_GAP_S
    minimum_speed_mps: float = 0.05
    cuts: Mapping[str, int] = field(default_factory=dict)


def source_of(bag: str | Path) -> str:
    """What tables call a bag: its path as given, since many bags have one name."""
    return f"bag {Path(bag)}"


def finite_poses(rows: FloatArray, source: str) -> FloatArray:
    """The (N, n) rows in which every number is finite; BagError where that is none of them."""
    finite = np.isfinite(rows).all(axis=1)
    if len(rows) and not finite.any():
        raise BagError(
            f"{source} must hold poses that are finite, none of its {len(rows)} is; look at what"
            " published them"
        )
    return rows[finite]


def actions_of_directions(directions: FloatArray) -> IntArray:
    """(N,) actions that finite (N, 2) directions east and north mean."""
    actions = [action_of_direction(float(east), float(north)) for east, north in directions]
    return np.array(actions, dtype=np.int64)
