"""The parameters of each node: name, type, default, unit, range and description."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from pydantic import model_validator

from serd_app.learning.settings import LearningSettings
from serd_app.navigation.settings import NavigationSettings
from serd_app.teleop.direction_choice import Mode
from serd_bag.recorder_settings import RecorderSettings
from serd_files.settings import setting, setting_of
from serd_files.yaml_config import StrictModel
from serd_sim.drivers.catalogue import driver_names
from serd_sim.episodes.settings import EpisodeSettings, WorldSettings
from serd_sim.perception.scan_people import WALL_MARGIN_M
from serd_sim.planning.settings import PlannerSettings
from serd_sim.safety.settings import GuardSettings, LidarPlace
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.scenario.settings import RobotSettings

_ROBOT, _RECORDER = RobotSettings(), RecorderSettings()
# A ROS parameter cannot be an empty list: [""] stands for none.
_NONE = ("",)


class NodeConfig(StrictModel):
    """The parameters of a node. changeable: those that can be set while it runs."""

    changeable: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def defaults(cls, given: Mapping[str, Any]) -> dict[str, Any]:
        """Every parameter with its default. given: the values that were set."""
        del given
        return {name: field.default for name, field in cls.model_fields.items()}


class ManagedConfig(NodeConfig):
    """A node that a lifecycle manager can configure and activate."""

    managed: bool = setting(
        False, "start unconfigured; a lifecycle manager configures and activates the node"
    )


class FramesConfig(NodeConfig):
    """The frames of the robot."""

    frame_prefix: str = setting(
        "",
        'before the frames base_link and odom, as "robot1/"; robots whose frames meet on one /tf'
        " need it",
    )


class HallwaySimConfig(FramesConfig):
    """Parameters of hallway_sim."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    seed: int = setting_of(EpisodeSettings, "seed")
    people: int = setting(-1, "number of people; -1: as the scenario has it", ge=-1)
    start_area: str = setting_of(WorldSettings, "start_area")
    goal: str = setting_of(NavigationSettings, "goal")
    lockstep: bool = setting(False, "wait for the command of every clock tick")
    lockstep_timeout_s: float = setting(
        60.0, "end after this wall time without a command in lock-step", unit="s", gt=0
    )
    gui: bool = setting(False, "show PyBullet's window")
    real_time_factor: float = setting(1.0, "speed of the world when not in lock-step", gt=0)
    stamped_cmd_vel: bool = setting(
        False, "cmd_vel is a TwistStamped; in lock-step it always is one"
    )
    command_timeout_s: float = setting(
        0.2, "stop the robot after this time without a command", unit="s", gt=0, le=0.5
    )
    publish_tf: bool = setting(False, "publish map -> odom -> base_link on tf")
    required_nodes: tuple[str, ...] = setting(_NONE, "reset fails until these nodes subscribe")


class LocalisationConfig(FramesConfig):
    """Where the pose of the robot comes from."""

    pose_from: Literal["robot_pose", "amcl_pose", "tf"] = setting(
        "robot_pose",
        "pose of the robot in the map: the topic robot_pose; the topic amcl_pose, carried on by"
        " odom; or base_link in map by /tf",
    )
    stamp_tolerance_s: float = setting(
        0.0,
        "pose, odom and pedestrians belong together when their stamps differ by at most this; 0:"
        " they have one stamp, as in a simulator",
        unit="s",
        ge=0,
        le=2,
    )


class ObservationConfig(LocalisationConfig):
    """How nodes put observations of the robot and of people together."""

    people_topic: str = setting(
        "pedestrians",
        "topic of people: PointCloud2 as hallway_sim publishes it, people_msgs/People,"
        " TrackedPersons of spencer_tracking_msgs, or vision_msgs/Detection3DArray",
        min_length=1,
    )


class LidarConfig(LidarPlace, FramesConfig):
    """Where the lidar of the scans is."""

    scan_frame: str = setting(
        "base_link",
        "frame of scans whose lidar is at sensor_x, sensor_y and sensor_yaw; scans of other frames"
        " need its transform on /tf",
        min_length=1,
    )


class LocalPlannerConfig(PlannerSettings, ObservationConfig, ManagedConfig):
    """Parameters of local_planner; those of `PlannerSettings` default to the scenario's."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    planner: str = setting_of(WorldSettings, "planner")
    people_from: Literal["given", "scan", "none"] = setting(
        "given",
        "given: people come from the topic pedestrians; scan: from the lidar's scans; none: people"
        " are not considered",
    )
    lockstep: bool = setting_of(
        HallwaySimConfig, "lockstep", description="answer every observation with one command"
    )
    stamped_cmd_vel: bool = setting_of(HallwaySimConfig, "stamped_cmd_vel")
    input_timeout_s: float = setting(
        0.5, "stop the robot when pose or people are older", unit="s", gt=0, le=0.5
    )
    required_nodes: tuple[str, ...] = setting(
        _NONE, "the first command in lock-step waits until these nodes subscribe"
    )

    @classmethod
    def defaults(cls, given: Mapping[str, Any]) -> dict[str, Any]:
        """The defaults, with the planner and the robot of the scenario that is given."""
        defaults = super().defaults(given)
        name = given.get("scenario", defaults["scenario"])
        if not isinstance(name, str) or not name:
            return defaults  # validation rejects the name
        scenario = load_scenario(name)
        planner = scenario.local_planner.complete(scenario.robot, scenario.control_period_s)
        return defaults | planner.model_dump()

    @model_validator(mode="after")
    def _scans_fit(self) -> "LocalPlannerConfig":
        if self.people_from == "scan" and self.stamp_tolerance_s > 0.0:
            raise ValueError(
                "people_from must be given or none with stamp_tolerance_s above 0, since it takes"
                " scans with the stamp of an observation, got scan; run people_tracker and set it"
                " to given"
            )
        return self

    def planned_scenario(self) -> Scenario:
        """The scenario with the planner's parameters of this node."""
        own = self.model_dump(include=set(PlannerSettings.model_fields))
        return load_scenario(self.scenario).with_local_planner(PlannerSettings(**own))


class PeopleTrackerConfig(LocalisationConfig, LidarConfig, ManagedConfig):
    """Parameters of people_tracker."""

    scenario: str = setting_of(
        EpisodeSettings,
        "scenario",
        description="built-in scenario or file of the place, whose walls are no people",
    )
    wall_margin: float = setting(
        WALL_MARGIN_M,
        "points of scans nearer than this to a wall belong to it; larger where the localisation"
        " errs more",
        unit="m",
        ge=0,
        le=1,
    )
    source_timeout: float = setting_of(
        GuardSettings,
        "source_timeout",
        default=0.5,
        description="publish no message while the newest scan is this old",
    )
    blind_rays: float = setting_of(
        GuardSettings,
        "blind_rays",
        description="share of rays without a range from which a scan shows no people and no message"
        " is published",
    )

    def limits(self, scenario: Scenario) -> GuardSettings:
        """Limits of the scans as in the guard of the scenario's robot."""
        guard = GuardSettings.of_scenario(scenario, "scan")
        own = {"source_timeout": self.source_timeout, "blind_rays": self.blind_rays}
        return guard.model_copy(update=own)


class GuardConfig(GuardSettings, LidarConfig):
    """Parameters of guard; those of `GuardSettings` default to the scenario's robot."""

    scenario: str = setting(
        "",
        "built-in scenario or file whose robot is guarded, and at whose walls a lidar must have"
        " returns; any other robot when empty",
    )
    pose_from: Literal["robot_pose", "amcl_pose", "tf"] = setting_of(
        LocalisationConfig, "pose_from"
    )
    people_from: Literal["given", "scan", "none"] = setting_of(LocalPlannerConfig, "people_from")
    people_topic: str = setting_of(ObservationConfig, "people_topic")
    lockstep: bool = setting_of(
        HallwaySimConfig, "lockstep", description="answer every command of that stamp with one"
    )
    stamped_cmd_vel: bool = setting(False, "cmd_vel_raw and cmd_vel are TwistStamped")
    stop_pub_timeout: float = setting(
        1.0, "publish nothing after this time of stops without a command", unit="s", ge=0
    )
    clock_timeout: float = setting(
        1.0, "live: stop after this wall time without an advance of the clock", unit="s", gt=0
    )
    required_nodes: tuple[str, ...] = setting_of(LocalPlannerConfig, "required_nodes")

    @classmethod
    def defaults(cls, given: Mapping[str, Any]) -> dict[str, Any]:
        """The defaults, with the robot of the scenario that is given."""
        defaults = super().defaults(given)
        name = given.get("scenario", "")
        if not isinstance(name, str) or not name:
            return defaults
        people_from = given.get("people_from", defaults["people_from"])
        guard = GuardSettings.of_scenario(load_scenario(name), str(people_from)).model_dump()
        if "acc_lim_x" in given:
            guard["decel_lim_x"] = 0.0  # a robot that accelerates less may brake less
        return defaults | guard

    def guard(self) -> GuardSettings:
        """The settings of the guard itself."""
        return GuardSettings(**self.model_dump(include=set(GuardSettings.model_fields)))


class DriverConfig(EpisodeSettings, ObservationConfig, ManagedConfig):
    """Parameters of the nodes that drive a series of episodes."""

    required_nodes: tuple[str, ...] = setting(
        ("hallway_sim", "local_planner", "guard"),
        "the first episode waits until these nodes subscribe",
    )
    output: str = setting("", "folder for the tables of episodes; no tables when empty")


class ScriptedExpertConfig(DriverConfig):
    """Parameters of scripted_expert."""

    driver: str = setting("expert", "driver: " + ", ".join(driver_names()))


class StrategyConfig(NavigationSettings, DriverConfig):
    """Parameters of strategy."""

    changeable: ClassVar[tuple[str, ...]] = ("goal", "model")

    lockstep: bool = setting_of(
        HallwaySimConfig,
        "lockstep",
        description="the world waits for every decision; otherwise waypoints are repeated five"
        " times a second, so that the planner stands soon after this node has ended",
    )
    reset: bool = setting(
        True, "reset the world before each episode; false: a goal starts one where the robot is"
    )
    people: int = setting(
        -1,
        "number of people for which times of arrival are predicted; -1: as the scenario has it",
        ge=-1,
    )


class DemoRecorderConfig(ManagedConfig):
    """Parameters of demo_recorder."""

    output: str = setting("recording", "folder of the bag; must not exist", min_length=1)
    topics: tuple[str, ...] = setting(
        (
            "/clock",
            "odom",
            "robot_pose",
            "scan",
            "pedestrians",
            "map",
            "cmd_vel",
            "intent",
            "waypoint",
            "episode",
        ),
        'topics of this stack, or any other as "/imu:sensor_msgs/msg/Imu" (in quotes), which is'
        " recorded from its first publisher on, with the quality of service of its publishers",
        min_length=1,
    )
    stamped_cmd_vel: bool = setting_of(HallwaySimConfig, "stamped_cmd_vel")
    record_at_start: bool = setting(True, "start recording at once, without start_recording")
    minimum_free_mb: float = setting(
        _RECORDER.min_free_bytes / 1e6,
        "stop recording when less disk space is free",
        unit="MB",
        ge=0,
    )
    maximum_file_mb: float = setting(
        0.0, "start another file of the bag beyond this size; 0: one file", unit="MB", ge=0
    )
    compression: Literal["none", "zstd"] = setting(
        _RECORDER.compression, "compression of the bag's chunks"
    )


#: Beyond, times of messages overflow.
SLOWEST_RATE, FASTEST_RATE = 1e-6, 1e6


class BagReplayConfig(NodeConfig):
    """Parameters of bag_replay."""

    changeable: ClassVar[tuple[str, ...]] = ("rate",)

    bag: str = setting("recording", "bag folder, or .mcap, .db3 or .bag file", min_length=1)
    topics: tuple[str, ...] = setting(_NONE, "topics to play; all when empty")
    rate: float = setting(1.0, "bag seconds per second", ge=SLOWEST_RATE, le=FASTEST_RATE)
    start_s: float = setting(0.0, "skip this much bag time", unit="s", ge=0)
    duration_s: float = setting(0.0, "play this much bag time; 0: all", unit="s", ge=0)
    loop: bool = setting(False, "start again at the end")
    paused: bool = setting(False, "start paused")
    clock_hz: float = setting(
        40.0,
        "rate of bag time on /clock, in place of a recorded one; 0: none",
        unit="Hz",
        ge=0,
        le=1000,
    )
    required_nodes: tuple[str, ...] = setting(_NONE, "start when these nodes subscribe")
    wait_s: float = setting(
        10.0, "longest wait for subscribers when no node is required", unit="s", ge=0
    )
    exit_when_done: bool = setting(
        True, "end the process after the last message; else its topics end and the node stays"
    )


class LearnerConfig(LearningSettings, ManagedConfig):
    """Parameters of learner."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    bag: str = setting("", "learn from this bag at start; from live topics when empty")
    actions: Literal["recorded", "hidden"] = setting(
        "recorded", "hidden: learn from poses and episodes alone, without intents"
    )
    learn_on: Literal["call", "episode"] = setting(
        "episode",
        "live: learn at the end of each episode, or only when the service learn is called",
    )
    state: str = setting(
        "",
        "live: folder of checkpoints, from which a killed learner resumes; beside the output"
        " when empty",
    )
    output: str = setting("model.yaml", "model file to write", min_length=1)
    decisions: str = setting("", "also write the table of decisions to this file")
    flow: str = setting(
        "",
        "table of the recorded flow of people, as `serd demos` writes it; the scenario's own"
        " flow when empty",
    )
    exit_when_done: bool = setting(True, "with a bag: end the process when the model is learned")
    exit_with_publishers: bool = setting(
        False,
        "live: end the process when nothing publishes what is learned from any more, or a replay"
        " has finished, and all is learned; without a model with exit code 2",
    )


class Nav2BridgeConfig(FramesConfig, ManagedConfig):
    """Parameters of nav2_bridge."""

    mode: Literal["to_pose", "through_poses"] = setting(
        "to_pose", "to_pose: send each waypoint; through_poses: send the plan of the strategy"
    )
    behavior_tree: str = setting("", "behavior tree of Nav2; its default when empty")
    waypoint_timeout_s: float = setting(
        1.0, "cancel Nav2's goal after this wall time without a waypoint", unit="s", gt=0
    )
    publish_tf: bool = setting(
        False,
        "publish map -> odom -> base_link from robot_pose and odom; for simulated robots, since a"
        " real one has its own",
    )


class TeleopMuxConfig(FramesConfig):
    """Parameters of teleop_mux."""

    mux: str = setting("", "YAML file of inputs and locks as twist_mux has it; built in when empty")
    rate_hz: float = setting(50.0, "rate of cmd_vel", unit="Hz", ge=10, le=200)
    stamped_cmd_vel: bool = setting_of(HallwaySimConfig, "stamped_cmd_vel")
    max_vel_x_mps: float = setting(
        _ROBOT.max_vel_x_mps, "largest speed of any command", unit="m/s", gt=0
    )
    min_vel_x_mps: float = setting(
        _ROBOT.min_vel_x_mps, "largest speed backwards", unit="m/s", le=0
    )
    max_vel_theta_radps: float = setting(
        _ROBOT.max_vel_theta_radps, "largest turning rate", unit="rad/s", gt=0
    )
    acc_lim_x_mps2: float = setting(
        _ROBOT.acc_lim_x_mps2, "largest acceleration and braking", unit="m/s2", gt=0
    )
    acc_lim_theta_radps2: float = setting(
        _ROBOT.acc_lim_theta_radps2, "largest angular acceleration", unit="rad/s2", gt=0
    )


class TeleopJoyConfig(NodeConfig):
    """Parameters of teleop_joy."""

    mapping: str = setting(
        "", "YAML file of axes and buttons as teleop_twist_joy has it; built in when empty"
    )


class TeleopPageConfig(FramesConfig):
    """Parameters of teleop_page."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    driver: str = setting("teleop_page", "name of the driver in the episode marks", min_length=1)
    mode: Mode = setting("directions", "directions: publish intent; velocity: cmd_vel_teleop")
    timeout_s: float = setting_of(EpisodeSettings, "timeout_s")
    required_nodes: tuple[str, ...] = setting(_NONE, "an episode starts when these nodes subscribe")
    speed_mps: float = setting(0.6, "speed in velocity mode", unit="m/s", gt=0)
    turn_radps: float = setting(1.5, "turning rate in velocity mode", unit="rad/s", gt=0)
    address: str = setting(
        "127.0.0.1", "address of the page; any other than loopback needs a token", min_length=1
    )
    port: int = setting(8765, "port of the page; 0: any free one", ge=0, le=65535)
    token_file: str = setting(
        "", "file whose first line is the token of the page, at least 16 characters"
    )


class WatchPageConfig(FramesConfig):
    """Parameters of watch_page."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    address: str = setting_of(TeleopPageConfig, "address")
    port: int = setting_of(TeleopPageConfig, "port", default=8766)
    token_file: str = setting_of(TeleopPageConfig, "token_file")


CONFIGS: dict[str, type[NodeConfig]] = {
    "hallway_sim": HallwaySimConfig,
    "local_planner": LocalPlannerConfig,
    "guard": GuardConfig,
    "people_tracker": PeopleTrackerConfig,
    "scripted_expert": ScriptedExpertConfig,
    "demo_recorder": DemoRecorderConfig,
    "bag_replay": BagReplayConfig,
    "learner": LearnerConfig,
    "strategy": StrategyConfig,
    "nav2_bridge": Nav2BridgeConfig,
    "teleop_mux": TeleopMuxConfig,
    "teleop_joy": TeleopJoyConfig,
    "teleop_page": TeleopPageConfig,
    "watch_page": WatchPageConfig,
}
