"""Parameters that several nodes have, or a node and a command, which reads no rclpy."""

from collections.abc import Mapping
from typing import Any, Literal, TypeVar

from serd_files.settings import setting, setting_of
from serd_files.yaml_config import StrictModel
from serd_sim.episodes.episode import EpisodeSettings
from serd_sim.safety.settings import LidarPlace

# A ROS parameter cannot be an empty list: [""] stands for none.
NO_NAMES = ("",)


class NodeConfig(StrictModel):
    """The parameters of a node, fixed while it runs but for those that are `live`."""

    @classmethod
    def defaults(cls, given: Mapping[str, Any]) -> dict[str, Any]:
        """Every parameter with its default. given: the values that were set."""
        del given
        return {name: field.default for name, field in cls.model_fields.items()}


Config = TypeVar("Config", bound=NodeConfig)


class ManagedConfig(NodeConfig):
    """A node that a lifecycle manager can configure and activate."""

    managed: bool = setting(False, "a lifecycle manager configures and activates the node")


class FramesConfig(NodeConfig):
    """The frames of the robot."""

    frame_prefix: str = setting("", "before base_link and odom where robots share /tf, as robot1/")


class StackConfig(NodeConfig):
    """Parameters that nodes of a stack have in common."""

    lockstep: bool = setting(False, "wait for the command of every clock tick")
    stamped_cmd_vel: bool = setting(False, "cmd_vel is a TwistStamped, as in lock-step always")
    people_from: Literal["given", "none"] = setting(
        "given",
        "given: people of the topic of people, as people_tracker publishes them; none: no people",
    )
    required_nodes: tuple[str, ...] = setting(NO_NAMES, "the first command waits for these nodes")


class LocalisationConfig(FramesConfig):
    """Where the pose of the robot comes from."""

    pose_from: Literal["robot_pose", "tf"] = setting(
        "robot_pose",
        "pose in the map: the topic robot_pose; or base_link in map by /tf, as of amcl",
    )
    stamp_tolerance_s: float = setting(
        0.0, "between stamps of pose, odom and people; 0: they have one", unit="s", ge=0, le=2
    )


class ObservationConfig(LocalisationConfig):
    """How nodes put observations of the robot and of people together."""

    people_topic: str = setting(
        "pedestrians",
        "topic of people: PointCloud2 as of hallway_sim, people_msgs/People, TrackedPersons, or"
        " Detection3DArray",
        min_length=1,
    )


class LidarConfig(LidarPlace, FramesConfig):
    """Where the lidar of the scans is."""

    scan_frame: str = setting(
        "base_link",
        "frame of scans with sensor_x, sensor_y, sensor_yaw; others by /tf",
        min_length=1,
    )


class DriverConfig(EpisodeSettings, ObservationConfig, ManagedConfig):
    """Parameters of the nodes that drive a series of episodes."""

    required_nodes: tuple[str, ...] = setting(
        ("hallway_sim", "local_planner", "guard"), "the first episode waits for these nodes"
    )
    output: str = setting("", "folder for the tables of episodes; no tables when empty")


class PageConfig(FramesConfig):
    """Parameters of a node that serves a page."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    address: str = setting("127.0.0.1", "of the page; beyond loopback with a token", min_length=1)
    port: int = setting(8765, "port of the page; 0: any free one", ge=0, le=65535)
    token_file: str = setting("", "file whose first line is the token of the page")


class WatchPageConfig(PageConfig):
    """Parameters of watch_page, and options of `serd watch`."""

    port: int = setting_of(PageConfig, "port", default=8766)


class BagReplayConfig(NodeConfig):
    """Parameters of bag_replay, and options of `serd bag play`."""

    bag: str = setting("recording", "bag folder, or .mcap, .db3 or .bag file", min_length=1)
    topics: tuple[str, ...] = setting(NO_NAMES, "topics to play; all when empty")
    # Beyond, times of messages overflow.
    rate: float = setting(1.0, "bag seconds per second", ge=1e-6, le=1e6)
    start_s: float = setting(0.0, "skip this much bag time", unit="s", ge=0)
    duration_s: float = setting(0.0, "play this much bag time; 0: all", unit="s", ge=0)
    loop: bool = setting(False, "start again at the end")
    required_nodes: tuple[str, ...] = setting(NO_NAMES, "start when these nodes subscribe")
    exit_when_done: bool = setting(True, "end the process after the last message")
