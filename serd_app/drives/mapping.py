"""The mapping file: which topics of a bag, or columns of a table, hold what; where episodes end."""

from typing import Literal

from pydantic import Field

from storage.trajectories.columns import TableColumns
from storage.yaml_config import StrictModel

#: What the fields of a bag do not state.
ASSUMED_UNITS = "m, rad, m/s and s are assumed, as ROS defines the units of messages"


class DriveMapping(StrictModel):
    """What holds for every recording without marks of episodes.

    minimum_speed_mps: mean speed of a period below which it is a wait.
    longest_gap_s: between poses across which places are interpolated, longer ones end an episode
    that is not marked; by default five usual steps between poses, at least 0.5 s.
    goals_m, goal_radius_m: circles in which an episode ends.
    stop_s: an episode ends where the robot stands for so long; null: none does.
    round_trips: whether a drive that comes back to its start is cut where it turns.
    """

    minimum_speed_mps: float = Field(default=0.05, ge=0)
    longest_gap_s: float | None = Field(default=None, gt=0)
    goals_m: tuple[tuple[float, float], ...] = ()
    goal_radius_m: float = Field(default=0.5, gt=0)
    stop_s: float | None = Field(default=10.0, ge=1.0)
    round_trips: bool = True


class TableMapping(DriveMapping, TableColumns):
    """A table of trajectories; see `DriveMapping` and `TableColumns`.

    action_from: see `BagMapping`.
    """

    action_from: Literal["hidden", "motion"] = "hidden"


class BagMapping(DriveMapping):
    """pose_topic: any message with a pose, or tf: then the pose is that of `robot_frame`.

    pose_fields: field paths of x and y, or of x, y and yaw, or of one message with a pose; empty:
    the pose nearest to the top of the message.
    frame: frame of the grid; poses in another are brought there by /tf; empty: as they are.
    action_from, action_topic: `intent` (a vector), `velocity` (a twist, or the speed of a steered
    vehicle), `waypoint` (a pose); without a topic `hidden` (the states alone are learned from) or
    `motion` (where the robot went within the period is taken as its action).
    action_fields: field paths of two numbers, or one of a message; empty: as for pose_fields. Of a
    velocity they are forward and left, or forward alone.
    episode_topic: marks as our recorder writes them; empty: see `DriveMapping`.
    hold_s: how long the robot follows a velocity command; null: until the next one.
    delay_s: how long after a velocity command the robot begins to follow it.
    silence: what a decision period without any velocity command means: `unknown`, it is dropped and
    counted, or `wait`, where the robot is known to stop when nothing is sent.
    people_topic: PointCloud2 with x, y, vx, vy in the frame of the grid, where there is one.
    """

    pose_topic: str = "robot_pose"
    pose_fields: tuple[str, ...] = Field(default=(), max_length=3)
    frame: str = ""
    robot_frame: str = "base_link"
    action_from: Literal["intent", "velocity", "waypoint", "motion", "hidden"] = "intent"
    action_topic: str = "intent"
    action_fields: tuple[str, ...] = Field(default=(), max_length=2)
    episode_topic: str = ""
    people_topic: str = "pedestrians"
    hold_s: float | None = Field(default=0.5, gt=0)
    delay_s: float = Field(default=0.0, ge=0)
    silence: Literal["unknown", "wait"] = "unknown"
    waypoint_reached_m: float = Field(default=0.25, ge=0)

    @property
    def has_action_topic(self) -> bool:
        """Whether actions are messages."""
        return self.action_from not in ("motion", "hidden")
