"""How long a robot follows a velocity command, and after what delay, by the motion that follows.

At times a step apart, the command that acts by a hold and a delay predicts whether the robot moves,
and to which side; the disagreement is the share of the times at which it does not. It is computed
for a grid of holds and delays, with no command acting after its hold.
"""

from dataclasses import dataclass

import numpy as np

from serd_app.drives.mapped.actions import PoseTrack
from serd_app.drives.unmarked import usual_gap_s
from serd_core.arrays import BoolArray, FloatArray

USUAL_HOLD_S = 0.5
#: In the order of preference where they explain the motion equally well.
_HOLDS_S = (USUAL_HOLD_S, np.inf, 1.0, 0.25, 2.0, 0.1, 0.75, 1.5, 3.0, 5.0)
_DELAYS_S = tuple(round(0.05 * number, 2) for number in range(31))
_EQUAL = 0.005
_SHORTEST_STEP_S = 0.2
_MOST_TIMES = 20_000
_FEWEST_SILENT = 5
_BRAKING_S = 1.0


@dataclass(frozen=True)
class CommandFit:
    """hold_s: None until the next command. usual: the disagreement without delay and with the usual
    hold. still_in_silence: share of the times without a command at which the robot stood, None
    where there are too few."""

    hold_s: float | None
    delay_s: float
    disagreement: float
    usual: float
    still_in_silence: float | None


def fit_commands(
    track: PoseTrack, at_s: FloatArray, commands_mps: FloatArray, minimum_speed_mps: float
) -> CommandFit:
    """at_s (C,) increasing, commands_mps (C, 2) forward and left."""
    motion = _Motion(track, minimum_speed_mps)
    table = np.array(
        [
            [motion.disagreement(at_s, commands_mps, hold_s, delay_s) for delay_s in _DELAYS_S]
            for hold_s in _HOLDS_S
        ]
    )
    row = int(np.argmax(table.min(axis=1) <= table.min() + _EQUAL))
    column = int(np.argmax(table[row] <= table[row].min() + _EQUAL / 2))
    hold_s, delay_s = _HOLDS_S[row], _DELAYS_S[column]
    return CommandFit(
        hold_s=None if np.isinf(hold_s) else hold_s,
        delay_s=delay_s,
        disagreement=float(table[row, column]),
        usual=float(table[0, 0]),
        still_in_silence=motion.still_in_silence(at_s, hold_s, delay_s),
    )


class _Motion:
    """Displacements (N, 2) in steps of equal length, without those in gaps of the poses."""

    def __init__(self, track: PoseTrack, minimum_speed_mps: float) -> None:
        usual_s = float(np.median(np.diff(track.time_s)))
        step_s = max(_SHORTEST_STEP_S, 2.0 * usual_s)
        time_s = np.arange(track.time_s[0], track.time_s[-1] - step_s, step_s)
        time_s = time_s[:: len(time_s) // _MOST_TIMES + 1]
        after = np.searchsorted(track.time_s, time_s + step_s).clip(1, len(track.time_s) - 1)
        gap_s = track.time_s[after] - track.time_s[after - 1]
        time_s = time_s[gap_s <= usual_gap_s(track.time_s)]
        self._middle_s = time_s + step_s / 2
        self._moved_m = track.at(time_s + step_s) - track.at(time_s)
        self._least_mps = minimum_speed_mps
        self._moves: BoolArray = np.hypot(*self._moved_m.T) >= minimum_speed_mps * step_s
        yaw_rad = np.interp(self._middle_s, track.time_s, np.unwrap(track.poses[:, 2]))
        self._ahead = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=1)

    def disagreement(
        self, at_s: FloatArray, commands_mps: FloatArray, hold_s: float, delay_s: float
    ) -> float:
        """Share of the steps in which the robot does not do what the acting command states."""
        acting, row = self._acting(at_s, hold_s, delay_s)
        forward, left = commands_mps[row].T
        commanded = acting & (np.hypot(forward, left) >= self._least_mps)
        (east, north), (x, y) = self._ahead.T, self._moved_m.T
        along = (forward * east - left * north) * x + (forward * north + left * east) * y
        wrong = (commanded != self._moves) | (commanded & self._moves & (along <= 0.0))
        return float(wrong.mean()) if len(wrong) else 1.0

    def still_in_silence(self, at_s: FloatArray, hold_s: float, delay_s: float) -> float | None:
        """Share of the steps in which the robot stands, of those a while after the last command
        has ended."""
        braking, _ = self._acting(at_s, hold_s + _BRAKING_S, delay_s)
        silent = ~braking
        return float((~self._moves)[silent].mean()) if silent.sum() >= _FEWEST_SILENT else None

    def _acting(
        self, at_s: FloatArray, hold_s: float, delay_s: float
    ) -> tuple[BoolArray, "np.ndarray[tuple[int], np.dtype[np.intp]]"]:
        """Whether a command acts in each step, and the row of the newest one."""
        row = np.searchsorted(at_s + delay_s, self._middle_s, side="right") - 1
        age_s = self._middle_s - delay_s - at_s[row]
        return (row >= 0) & (age_s <= hold_s), row
