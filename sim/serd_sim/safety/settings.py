"""Settings of the guard, under the names of Nav2's collision_monitor where it has them."""

from functools import partial
from typing import Annotated, Literal

from pydantic import AfterValidator, model_validator

from serd_files.settings import setting, settings_of
from serd_files.yaml_config import StrictModel
from serd_sim.crowd.social_force import model_named
from serd_sim.robot.footprint import Footprint, footprint_of, outline_text
from serd_sim.safety.scan import ZeroIs
from serd_sim.scenario.scenario import Scenario
from serd_sim.scenario.settings import RobotSettings

_ROBOT = RobotSettings()
#: Setting of the guard -> setting of the robot.
_OF_ROBOT = {
    "radius": "radius_m",
    "footprint": "footprint",
    "max_vel_x": "max_vel_x_mps",
    "max_vel_theta": "max_vel_theta_radps",
    "acc_lim_x": "acc_lim_x_mps2",
    "decel_lim_x": "decel_lim_x_mps2",
    "acc_lim_theta": "acc_lim_theta_radps2",
}
#: Parameters of a running node whose lower, or higher, values are the stricter ones.
_lower, _higher = partial(setting, live="lower"), partial(setting, live="higher")
Observed = Literal["robot_pose", "pedestrians", "scan"]
_MAP_SOURCES: tuple[Observed, ...] = ("robot_pose", "pedestrians")
#: How fast (m/s) a robot drives where it touches something or little is known.
CREEP_MPS = 0.1
#: Periods of the lidar within which two scans are expected.
_SCAN_PERIODS = 2.5


class LidarPlace(StrictModel):
    """Where the lidar is on the robot, and what it means by a range of 0."""

    sensor_x: float = setting(0.0, "position of the lidar ahead of the centre", unit="m")
    sensor_y: float = setting(0.0, "position of the lidar left of the centre", unit="m")
    sensor_yaw: float = setting(0.0, "direction of the lidar's x axis", unit="rad")
    zero_is: ZeroIs = setting(
        "unknown",
        "what the lidar means by a range of 0: unknown; free: no return; obstacle: too near",
    )


class GuardSettings(LidarPlace):
    """The footprint, the zones around it, and the limits of each input; SI units."""

    observation_sources: tuple[Observed, ...] = setting(
        ("robot_pose", "pedestrians", "scan"),
        "inputs that the robot relies on beside odom; the robot stands without one of them",
        min_length=1,
    )
    radius: float = setting(
        _ROBOT.radius_m, "radius of a round footprint", unit="m", gt=0, live="any"
    )
    footprint: Annotated[str, AfterValidator(outline_text)] = setting(
        "",
        "corners of a footprint that is not round, as Nav2 has them: '[[x, y], ...]', in m in the"
        " frame base_link; takes the place of radius",
        live="any",
    )
    max_vel_x: float = _lower(_ROBOT.max_vel_x_mps, "largest speed", unit="m/s", gt=0)
    max_vel_theta: float = _lower(
        _ROBOT.max_vel_theta_radps, "largest turning rate", unit="rad/s", gt=0
    )
    acc_lim_x: float = setting(
        _ROBOT.acc_lim_x_mps2, "acceleration of the robot", unit="m/s²", gt=0
    )
    decel_lim_x: float = setting(
        0.0, "deceleration of the robot at a stop; 0: acc_lim_x", unit="m/s²", ge=0
    )
    acc_lim_theta: float = setting(
        _ROBOT.acc_lim_theta_radps2, "acceleration of turns of the robot", unit="rad/s²", gt=0
    )
    controller_frequency: float = setting(20.0, "commands per second", unit="Hz", ge=1, le=1000)

    reaction_time: float = _higher(
        0.05, "approach zone: delay of braking beyond one command", unit="s", ge=0, le=2
    )
    collision_margin: float = _higher(
        0.02, "approach zone: gap to keep from scan points and people", unit="m", ge=0
    )
    min_points: int = _lower(2, "scan points that count as an obstacle", ge=1)
    person_radius: float = _higher(0.25, "radius of a person of pedestrians", unit="m", gt=0)
    stop_radius: float = _higher(
        0.0, "stop zone: no motion towards points nearer to the centre; 0: none", unit="m", ge=0
    )
    slowdown_radius: float = _higher(
        0.0, "slowdown zone: slower while points are nearer to the centre; 0: none", unit="m", ge=0
    )
    slowdown_ratio: float = _lower(0.5, "share of the speed in the slowdown zone", gt=0, le=1)
    linear_limit: float = _lower(
        0.5, "largest speed while only the scan shows people", unit="m/s", gt=0
    )
    person_speed: float = _higher(
        1.3, "speed of scan points towards the robot while only they show people", unit="m/s", ge=0
    )

    source_timeout: float = _lower(
        0.25, "zero speed when the newest stamp of an input is this old", unit="s", gt=0, le=2
    )
    slowdown_timeout: float = _lower(
        0.15, "slower in proportion from this age of a stamp on", unit="s", gt=0
    )
    command_timeout: float = _lower(
        0.2, "stop without a command for this time", unit="s", gt=0, le=0.5
    )
    transform_tolerance: float = _lower(
        0.2, "a stamp this far in the future is a fault", unit="s", ge=0
    )
    override_timeout: float = _lower(
        0.3, "an override lasts this long after its last message", unit="s", gt=0, le=1
    )

    lost_rays: float = _lower(
        0.05, "share of lost rays from which the robot drives slower in proportion", ge=0, lt=1
    )
    blind_rays: float = _lower(
        0.5,
        "share of rays that state nothing, or are lost, from which the robot stands",
        gt=0,
        le=1,
    )
    frozen_motion: float = setting(
        0.03, "a scan or pose that is the same after this motion is frozen", unit="m", gt=0
    )
    pose_tolerance: float = setting(
        0.15, "error allowed between the motion of pose and odometry", unit="m", gt=0
    )
    yaw_tolerance: float = setting(
        0.25, "error allowed between the turn of pose and odometry", unit="rad", gt=0
    )
    drift_ratio: float = setting(0.1, "error allowed in addition, per motion or turn", ge=0)

    @model_validator(mode="after")
    def _consistent(self) -> "GuardSettings":
        sources = self.observation_sources
        if "pedestrians" in sources and "robot_pose" not in sources:
            raise ValueError(
                "observation_sources must have 'robot_pose' where it has 'pedestrians', whose"
                f" positions are in the map, got {', '.join(sources)}; add it or leave both out"
            )
        if not {"scan", "pedestrians"} & {*sources}:
            raise ValueError(
                "observation_sources must have 'scan' or 'pedestrians', got"
                f" {', '.join(sources)}; add one that shows obstacles"
            )
        for low, high in (("slowdown_timeout", "source_timeout"), ("lost_rays", "blind_rays")):
            if not getattr(self, low) < getattr(self, high):
                raise ValueError(
                    f"{low} must be less than {high} ({getattr(self, high):g}), got"
                    f" {getattr(self, low):g}; lower it"
                )
        return self

    def loosened(self, after: "GuardSettings") -> tuple[str, ...]:
        """The settings by which later ones of the same class allow more."""
        names = []
        for each in settings_of(type(self)):
            change = getattr(after, each.name), getattr(self, each.name)
            if (each.live == "lower" and change[0] > change[1]) or (
                each.live == "higher" and change[0] < change[1]
            ):
                names.append(each.name)
        if after.outline is not self.outline and not after.outline.covers(self.outline):
            names.append("footprint" if after.footprint or self.footprint else "radius")
        return tuple(names)

    @property
    def outline(self) -> Footprint:
        """The footprint, polygon or disc."""
        return footprint_of(self.radius, self.footprint)

    @property
    def braking(self) -> float:
        """Deceleration at a stop in m/s²."""
        return self.decel_lim_x or self.acc_lim_x

    def robot(self) -> RobotSettings:
        """A disc with these limits; backward as fast as forward."""
        limits = {of_robot: getattr(self, name) for name, of_robot in _OF_ROBOT.items()}
        limits |= {"min_vel_x_mps": -self.max_vel_x, "decel_lim_x_mps2": self.braking}
        limits["footprint"] = ""
        return RobotSettings(**limits)

    @classmethod
    def of_scenario(cls, scenario: Scenario, people_from: str = "given") -> "GuardSettings":
        """The guard of the robot of a scenario; people_from: where its planner gets people from."""
        robot = scenario.robot
        scan_period_s = scenario.ticks_per_scan * scenario.control_period_s
        timeout_s = max(cls.model_fields["source_timeout"].default, _SCAN_PERIODS * scan_period_s)
        sees_people = people_from == "given"
        return cls(
            observation_sources=(*_MAP_SOURCES[: 1 + sees_people], "scan"),
            **{name: getattr(robot, of_robot) for name, of_robot in _OF_ROBOT.items()},
            controller_frequency=1.0 / scenario.control_period_s,
            person_radius=model_named(scenario.pedestrians.model).body_radius_m,
            source_timeout=timeout_s,
            slowdown_timeout=0.6 * timeout_s,
        )
