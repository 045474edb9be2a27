"""The mapping file: which topics of a bag, or columns of a table, hold what; where episodes end.

A drive without marks is cut at gaps, at the goal, at stops and where a round trip turns.
Gap: no pose for longer than the longest gap. Goal: an episode ends on entering the goal area, and
the way back, from the area to the place farthest from where it was left, is no demonstration. Stop:
an episode ends where the robot comes to stand for `stop_s` or longer, the next begins when it moves
on. Round trip: where a robot comes back to its start, each lap is cut at its place farthest from
the start, so that the way out is one demonstration and the way back another.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, TypeVar

import numpy as np
from pydantic import field_validator, model_validator

from serd_app.drives.drive import LONGEST_GAP_S, RETURN, EpisodeSpan, places_at
from serd_core.arrays import BoolArray, FloatArray
from serd_files.settings import setting
from serd_files.trajectories.columns import TableColumns
from serd_files.yaml_config import StrictModel
from serd_sim.scenario.polygon import Point, contains

#: What the fields of a bag do not state.
ASSUMED_UNITS = "m, rad, m/s and s are assumed, as ROS defines the units of messages"

_LEAST_CORNERS = 3
#: Keys that are read where actions are velocities.
_OF_VELOCITIES = ("hold_s", "delay_s", "silence")
UNMARKED, ARRIVED = "unmarked", "arrived"
GAP, GOAL, STOP, TURN = "gap", "goal", "stop", "turn"
_OUTCOMES = {"": UNMARKED, GAP: UNMARKED, RETURN: RETURN}
#: Without one in the mapping, the longest gap is so many usual steps between poses.
_GAP_STEPS = 5.0
#: A robot that stays within this distance stands.
_STANDING_M = 0.1
_SAMPLES_OF_A_STOP = 10
#: Shares of the largest distance from the start within which a lap ends, and beyond which one is.
_BACK, _AWAY = 0.25, 0.5
_SHORTEST_TRIP_M = 1.0


_Mapped = TypeVar("_Mapped", bound="DriveMapping")


class DriveMapping(StrictModel):
    """What holds for every recording without marks of episodes."""

    minimum_speed_mps: float = setting(
        0.05, "mean speed of a second below which it is a wait", unit="m/s", ge=0
    )
    longest_gap_s: float | None = setting(
        None,
        "longest gap between poses across which places are interpolated; a longer one ends an"
        " episode. By default five usual steps between poses, at least 0.5 s",
        unit="s",
        gt=0,
    )
    goal_area_m: tuple[tuple[float, float], ...] = setting(
        (),
        "corners of an area in which a lap ends. The way back from it, up to the place farthest"
        " away, is no demonstration. With `--scenario` its goal area by default",
        unit="m",
    )
    stop_s: float | None = setting(
        10.0, "an episode ends where the robot stands for so long; null: nowhere", unit="s", ge=1.0
    )
    round_trips: bool = setting(
        True, "whether a drive that comes back to its start is cut at its place farthest from it"
    )

    def with_goal(self: _Mapped, area_m: tuple[tuple[float, float], ...]) -> _Mapped:
        """The mapping, with the goal area of a scenario where it has none."""
        return self if self.goal_area_m else self.model_copy(update={"goal_area_m": area_m})

    @field_validator("goal_area_m")
    @classmethod
    def _has_corners(
        cls, area_m: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        if area_m and len(area_m) < _LEAST_CORNERS:
            raise ValueError(
                f"must have at least {_LEAST_CORNERS} corners, got {len(area_m)}; add some"
            )
        return area_m


class TableMapping(DriveMapping, TableColumns):
    """A table of trajectories."""

    action_from: Literal["hidden", "motion"] = setting(
        "hidden", "hidden: learn from the states; motion: the displacement is the action"
    )
    experts: tuple[str, ...] = setting(
        (),
        "ids or kinds of the agents that demonstrate, * for any text, the others are people; by"
        " default those with robot, agv, amr or ego in them, else all",
    )


class BagMapping(DriveMapping):
    """Topics of a bag, and the fields of their messages as paths: `pose.pose`, `axes.1`."""

    pose_topic: str = setting(
        "robot_pose", "any message with a pose; or tf: then the pose is that of robot_frame"
    )
    pose_fields: tuple[str, ...] = setting(
        (),
        "paths of x and y, or of x, y and yaw, or of one message with a pose; by default the pose"
        " nearest to the top of the message",
        max_length=3,
    )
    frame: str = setting(
        "", "frame of the grid; poses in others are brought there by /tf. Empty: as they are"
    )
    robot_frame: str = setting("base_link", "frame of the robot, where poses are from tf")
    action_from: Literal["intent", "velocity", "motion", "hidden"] = setting(
        "intent",
        "what the action topic holds: intent, a vector; velocity, a twist or the speed of a steered"
        " vehicle. Without a topic hidden (the states alone are learned from) or"
        " motion (the displacement of the next second is the action)",
    )
    action_topic: str = setting("intent", "topic of the actions")
    action_fields: tuple[str, ...] = setting(
        (),
        "paths of two numbers, or one of a message; of a velocity forward and left, or forward"
        " alone. By default as for pose_fields",
        max_length=2,
    )
    episode_topic: str = setting(
        "", "marks of episodes, as our recorder writes them; empty: episodes are cut by the rules"
    )
    people_topic: str = setting(
        "pedestrians",
        "people, where there is such a topic: PointCloud2 with x, y, vx, vy, People,"
        " TrackedPersons or Detection3DArray; brought into `frame` by /tf",
    )
    hold_s: float | None = setting(
        0.5, "how long the robot follows a velocity; null: until the next one", unit="s", gt=0
    )
    delay_s: float = setting(
        0.0, "how long after a velocity command the robot begins to follow it", unit="s", ge=0
    )
    silence: Literal["unknown", "wait"] = setting(
        "unknown",
        "what time without any velocity command means: unknown, it is left out and counted;"
        " wait, where the robot is known to stop when nothing is sent",
    )

    @model_validator(mode="after")
    def _keys_have_an_effect(self) -> "BagMapping":
        """A key that is given and not read is a mistake that would go unnoticed."""
        for key in _OF_VELOCITIES if self.action_from != "velocity" else ():
            if getattr(self, key) != type(self).model_fields[key].default:
                raise ValueError(
                    f"{key} must be left out unless action_from is velocity, it is"
                    f" {self.action_from}; correct action_from or delete the key"
                )
        return self

    @property
    def has_action_topic(self) -> bool:
        """Whether actions are messages."""
        return self.action_from not in ("motion", "hidden")


@dataclass(frozen=True, eq=False)
class _Piece:
    """time_s (T,), position_m (T, 2); ended_by: what it was cut at, empty at the end; from_goal:
    whether it begins where the robot leaves the goal area."""

    time_s: FloatArray
    position_m: FloatArray
    ended_by: str = ""
    from_goal: bool = False

    def part(self, start: int, stop: int, ended_by: str) -> "_Piece":
        """Rows from start to before stop."""
        rows = slice(start, stop)
        from_goal = self.from_goal and start == 0
        return _Piece(self.time_s[rows], self.position_m[rows], ended_by, from_goal)


def unmarked_spans(
    time_s: FloatArray, position_m: FloatArray, longest_gap_s: float, mapping: DriveMapping
) -> tuple[tuple[EpisodeSpan, ...], Counter[str]]:
    """The episodes in order, numbered from 0, and how many of them end at what."""
    pieces = list(_at_gaps(_Piece(time_s, position_m), longest_gap_s))

    def cut(rule: Callable[..., Iterator[_Piece]], *settings: Any) -> list[_Piece]:
        return [part for piece in pieces for part in rule(piece, *settings)]

    if mapping.goal_area_m:
        pieces = cut(_at_goal_area, mapping.goal_area_m)
    has_goal = any(piece.ended_by == GOAL or piece.from_goal for piece in pieces)
    if mapping.stop_s is not None:
        pieces = cut(_at_stops, mapping.stop_s)
    if mapping.round_trips and not has_goal:
        pieces = cut(_at_turns)
    pieces = [piece for piece in cut(_without_return) if len(piece.time_s) > 1]
    spans = []
    for number, piece in enumerate(pieces):
        outcome = _OUTCOMES.get(piece.ended_by, ARRIVED)
        edges_s = float(piece.time_s[0]), float(piece.time_s[-1])
        spans.append(EpisodeSpan(number, *edges_s, outcome, piece.ended_by))
    cuts = Counter(piece.ended_by for piece in pieces if piece.ended_by not in ("", RETURN))
    return tuple(spans), cuts


def usual_gap_s(time_s: FloatArray) -> float:
    """The longest gap for poses that come as often as these: slow topics miss some as well."""
    usual_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    return max(LONGEST_GAP_S, _GAP_STEPS * usual_s)


def _at_gaps(piece: _Piece, longest_gap_s: float) -> Iterator[_Piece]:
    edges = [0, *(np.flatnonzero(np.diff(piece.time_s) > longest_gap_s) + 1), len(piece.time_s)]
    for start, stop in pairwise(edges):
        yield piece.part(start, stop, "" if stop == len(piece.time_s) else GAP)


def _at_goal_area(piece: _Piece, area_m: tuple[Point, ...]) -> Iterator[_Piece]:
    for start, stop in _runs(~contains(area_m, piece.position_m)):
        last = stop == len(piece.time_s)
        part = piece.part(start, min(stop + 1, len(piece.time_s)), piece.ended_by if last else GOAL)
        yield replace(part, from_goal=start > 0)


def _without_return(piece: _Piece) -> Iterator[_Piece]:
    """The way back from the goal area, and what follows, where it comes nearer again."""
    if not piece.from_goal:
        yield piece
        return
    away_m = np.linalg.norm(piece.position_m - piece.position_m[0], axis=1)
    turn = int(away_m.argmax())
    if away_m[turn:].min() > away_m[turn] - _SHORTEST_TRIP_M:
        turn = len(away_m) - 1
    yield piece.part(0, turn + 1, RETURN)
    if turn < len(away_m) - 1:
        yield piece.part(turn, len(away_m), piece.ended_by)


def _at_stops(piece: _Piece, stop_s: float) -> Iterator[_Piece]:
    """The parts in which it moves; the whole piece where it never does."""
    standing = _standing(piece, stop_s)
    moving = list(_runs(~standing))
    if not moving:
        yield piece
    for start, stop in moving:
        last = stop == len(piece.time_s)
        yield piece.part(
            max(start - 1, 0), min(stop + 1, len(piece.time_s)), piece.ended_by if last else STOP
        )


def _standing(piece: _Piece, stop_s: float) -> BoolArray:
    """(T,) whether it stays within the standing distance for the time of a stop, around then."""
    first_s, last_s = piece.time_s[0], piece.time_s[-1]
    sample_s = np.arange(first_s, last_s, stop_s / _SAMPLES_OF_A_STOP)
    place_m = places_at(sample_s, piece.time_s, piece.position_m)
    standing = np.zeros(len(piece.time_s), dtype=bool)
    row = 0
    while row + _SAMPLES_OF_A_STOP < len(sample_s):
        soon_m = place_m[row : row + _SAMPLES_OF_A_STOP + 1] - place_m[row]
        if (np.linalg.norm(soon_m, axis=1) > _STANDING_M).any():
            row += 1
            continue
        away_m = np.linalg.norm(place_m[row:] - place_m[row], axis=1)
        left = np.flatnonzero(away_m > _STANDING_M)
        end = row + (int(left[0]) if len(left) else len(away_m))
        until_s = sample_s[end - 1] if len(left) else last_s
        standing |= (piece.time_s >= sample_s[row]) & (piece.time_s <= until_s)
        row = end
    return standing


def _at_turns(piece: _Piece) -> Iterator[_Piece]:
    away_m = np.linalg.norm(piece.position_m - piece.position_m[0], axis=1)
    largest_m = float(away_m.max(initial=0.0))
    laps = _laps(away_m, largest_m) if largest_m >= _SHORTEST_TRIP_M else []
    if not laps:
        yield piece
        return
    for start, home in laps:
        turn = start + int(away_m[start : home + 1].argmax())
        yield piece.part(start, turn + 1, TURN)
        yield piece.part(turn, home + 1, TURN)
    start = laps[-1][1]
    if away_m[start:].max() > _AWAY * largest_m:
        yield piece.part(start, len(away_m), piece.ended_by)


def _laps(away_m: FloatArray, largest_m: float) -> list[tuple[int, int]]:
    """(row of the start, row at which it is back) of each lap."""
    laps, start = [], 0
    is_away = away_m > _AWAY * largest_m
    near = list(_runs(away_m < _BACK * largest_m))
    for first, stop in near[1:]:
        if is_away[start:first].any():
            home = first + int(away_m[first:stop].argmin())
            laps.append((start, home))
            start = home
    return laps


def _runs(rows: BoolArray) -> Iterator[tuple[int, int]]:
    """(first, one past the last) of each run of true rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(np.int8)))
    for start, stop in edges.reshape(-1, 2):
        yield int(start), int(stop)
