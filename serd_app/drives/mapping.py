"""The mapping file: which topics of a bag, or columns of a table, hold what; where episodes end."""

from typing import Literal

from pydantic import field_validator, model_validator

from serd_files.settings import setting
from serd_files.trajectories.columns import TableColumns
from serd_files.yaml_config import StrictModel

#: What the fields of a bag do not state.
ASSUMED_UNITS = "m, rad, m/s and s are assumed, as ROS defines the units of messages"

_LEAST_CORNERS = 3
#: Keys of one kind of actions.
_ONLY_FOR = {
    "hold_s": "velocity",
    "delay_s": "velocity",
    "silence": "velocity",
}


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
        for key, source in _ONLY_FOR.items():
            default = type(self).model_fields[key].default
            if getattr(self, key) != default and self.action_from != source:
                raise ValueError(
                    f"{key} must be left out unless action_from is {source}, it is"
                    f" {self.action_from}; correct action_from or delete the key"
                )
        return self

    @property
    def has_action_topic(self) -> bool:
        """Whether actions are messages."""
        return self.action_from not in ("motion", "hidden")
