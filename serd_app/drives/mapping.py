"""The mapping file: which topics of a bag hold the poses, actions and episodes."""

from typing import Literal

from pydantic import Field

from storage.yaml_config import StrictModel


class BagMapping(StrictModel):
    """pose_topic: PoseStamped, PoseWithCovarianceStamped or Odometry.

    frame: frame of the grid; poses in another are brought there by /tf; empty: as they are.
    action_from, action_topic: `intent` (Vector3Stamped), `velocity` (Twist or TwistStamped) or
    `waypoint` (PoseStamped).
    episode_topic: marks as our recorder writes them; empty: every stretch without a gap is one.
    silence: what a decision period without any velocity command means: `unknown`, it is dropped and
    counted, or `wait`, where the robot is known to stop when nothing is sent.
    longest_gap_s: between poses across which places are interpolated, longer ones end an episode
    that is not marked; by default five usual steps between poses, at least 0.5 s.
    people_topic: PointCloud2 with x, y, vx, vy in the frame of the grid, where there is one.
    """

    pose_topic: str = "robot_pose"
    frame: str = ""
    action_from: Literal["intent", "velocity", "waypoint"] = "intent"
    action_topic: str = "intent"
    episode_topic: str = ""
    people_topic: str = "pedestrians"
    hold_s: float = Field(default=0.5, gt=0)
    silence: Literal["unknown", "wait"] = "unknown"
    minimum_speed_mps: float = Field(default=0.05, ge=0)
    waypoint_reached_m: float = Field(default=0.25, ge=0)
    longest_gap_s: float | None = Field(default=None, gt=0)
