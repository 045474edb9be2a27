"""Parameters of each node as frozen, validated records; the defaults are in nodes.yaml."""

from typing import Literal

from pydantic import Field

from serd_app.learning.settings import LessonSettings
from serd_app.navigation.settings import NavigationSettings
from sim.planning.settings import PlannerSettings
from storage.yaml_config import StrictModel
from teleop.mode import Mode


class HallwaySimConfig(StrictModel):
    """See nodes.yaml for what each parameter means."""

    scenario: str = Field(min_length=1)
    seed: int = Field(ge=0)
    people: int = Field(ge=-1)
    start_area: str
    lockstep: bool
    lockstep_timeout_s: float = Field(gt=0)
    gui: bool
    real_time_factor: float = Field(gt=0)
    stamped_cmd_vel: bool
    command_timeout_s: float = Field(gt=0, le=0.5)
    required_nodes: tuple[str, ...]
    goal: str


class LocalPlannerConfig(PlannerSettings):
    """See nodes.yaml for what each parameter means."""

    scenario: str = Field(min_length=1)
    planner: str
    people_from: Literal["given", "scan"]
    lockstep: bool
    stamped_cmd_vel: bool
    input_timeout_s: float = Field(gt=0, le=0.5)
    required_nodes: tuple[str, ...]


class DriverConfig(StrictModel):
    """What every node that drives episodes needs."""

    scenario: str = Field(min_length=1)
    seed: int = Field(ge=0)
    episodes: int = Field(ge=1)
    timeout_s: float = Field(gt=0)
    required_nodes: tuple[str, ...]
    output: str


class ScriptedExpertConfig(DriverConfig):
    """driver: a name of sim.drivers.catalogue."""

    driver: str


class StrategyConfig(DriverConfig, NavigationSettings):
    """See nodes.yaml for what each parameter means."""

    reset: bool


class DemoRecorderConfig(StrictModel):
    """See nodes.yaml for what each parameter means."""

    output: str = Field(min_length=1)
    topics: tuple[str, ...] = Field(min_length=1)
    stamped_cmd_vel: bool
    record_at_start: bool
    minimum_free_mb: float = Field(ge=0)
    maximum_file_mb: float = Field(ge=0)
    compression: Literal["none", "zstd"]


class TeleopMuxConfig(StrictModel):
    """See nodes.yaml for what each parameter means."""

    mux: str
    rate_hz: float = Field(ge=10, le=200)
    stamped_cmd_vel: bool
    max_vel_x_mps: float = Field(gt=0)
    min_vel_x_mps: float = Field(le=0)
    max_vel_theta_radps: float = Field(gt=0)
    acc_lim_x_mps2: float = Field(gt=0)
    acc_lim_theta_radps2: float = Field(gt=0)


class HandDriverConfig(StrictModel):
    """What every node needs through which a person drives."""

    scenario: str = Field(min_length=1)
    driver: str = Field(min_length=1)
    mode: Mode
    timeout_s: float = Field(gt=0)
    required_nodes: tuple[str, ...]
    speed_mps: float = Field(gt=0)
    turn_radps: float = Field(gt=0)


class TeleopKeyboardConfig(HandDriverConfig):
    """See nodes.yaml for what each parameter means."""

    terminal: str = Field(min_length=1)
    key_timeout_s: float = Field(gt=0, le=0.5)


class TeleopPageConfig(HandDriverConfig):
    """See nodes.yaml for what each parameter means."""

    address: str = Field(min_length=1)
    port: int = Field(ge=0, le=65535)
    token_file: str


class TeleopJoyConfig(StrictModel):
    """See nodes.yaml for what each parameter means."""

    mapping: str


class BagReplayConfig(StrictModel):
    """See nodes.yaml for what each parameter means."""

    bag: str = Field(min_length=1)
    topics: tuple[str, ...]
    rate: float = Field(gt=0)
    start_s: float = Field(ge=0)
    duration_s: float = Field(ge=0)
    loop: bool
    paused: bool
    clock_hz: float = Field(ge=0, le=1000)
    required_nodes: tuple[str, ...]
    wait_s: float = Field(ge=0)
    keys: bool
    exit_when_done: bool


class LearnerConfig(LessonSettings):
    """See nodes.yaml for what each parameter means."""

    scenario: str = Field(min_length=1)
    bag: str
    learn_on: Literal["call", "episode"]
    state: str
    output: str = Field(min_length=1)
    decisions: str
    flow: str
    exit_when_done: bool


class Nav2BridgeConfig(StrictModel):
    """See nodes.yaml for what each parameter means."""

    mode: Literal["to_pose", "through_poses"]
    behavior_tree: str
    waypoint_timeout_s: float = Field(gt=0)
    publish_tf: bool


CONFIGS: dict[str, type[StrictModel]] = {
    "hallway_sim": HallwaySimConfig,
    "local_planner": LocalPlannerConfig,
    "scripted_expert": ScriptedExpertConfig,
    "demo_recorder": DemoRecorderConfig,
    "bag_replay": BagReplayConfig,
    "learner": LearnerConfig,
    "strategy": StrategyConfig,
    "nav2_bridge": Nav2BridgeConfig,
    "teleop_mux": TeleopMuxConfig,
    "teleop_joy": TeleopJoyConfig,
    "teleop_keyboard": TeleopKeyboardConfig,
    "teleop_page": TeleopPageConfig,
}
