"""Settings of the robot, its sensors and the crowd, as they stand in a scenario file."""

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from serd_core.arrays import FloatArray
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel
from serd_sim.crowd.social_force import model_named, model_names
from serd_sim.robot.footprint import Footprint, footprint_of, outline_text
from serd_sim.robot.urdf import BUILTIN_URDF, DifferentialDrive, read_differential_drive
from serd_sim.scenario.polygon import require_simple

#: Products of numbers of this size are far from overflow.
LARGEST_NUMBER = 1e6
_Coordinate = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Point = tuple[_Coordinate, _Coordinate]
Polygon = Annotated[tuple[Point, ...], Field(min_length=3)]
#: A polygon that bounds an area: it must not cross itself, nor shrink to a line.
Outline = Annotated[Polygon, AfterValidator(require_simple)]


class RobotSettings(StrictModel):
    """A differential-drive robot. Limits have the names of Nav2, with units."""

    radius_m: float = setting(
        0.25,
        "radius of the disc to which cells, people and the simulated body keep",
        unit="m",
        gt=0,
    )
    footprint: Annotated[str, AfterValidator(outline_text)] = setting(
        "",
        "outline of a robot that is not round, for local planner and guard: corners as Nav2 has"
        " them, '[[x, y], ...]', in m in the frame base_link",
    )
    height_m: float = setting(0.6, "height", unit="m", gt=0)
    max_vel_x_mps: float = setting(1.2, "largest speed forward", unit="m/s", gt=0)
    min_vel_x_mps: float = setting(-0.3, "largest speed backward", unit="m/s", le=0)
    max_vel_theta_radps: float = setting(3.5, "largest turning rate", unit="rad/s", gt=0)
    acc_lim_x_mps2: float = setting(
        2.5, "largest acceleration, and deceleration that planners plan with", unit="m/s²", gt=0
    )
    decel_lim_x_mps2: float = setting(
        6.0,
        "largest deceleration, for stops of guard and timeouts; floor and motors of a physical"
        " drive may allow less",
        unit="m/s²",
        gt=0,
    )
    acc_lim_theta_radps2: float = setting(
        12.0, "largest acceleration of turns", unit="rad/s²", gt=0
    )
    drive: Literal["kinematic", "physical"] = setting(
        "kinematic",
        "kinematic: the commanded velocity within the limits; physical: a rigid body on wheels with"
        " motors, friction and contacts. The keys below belong to `physical`",
    )
    urdf: str = setting(
        "",
        "URDF file of the robot; empty: the built-in robot. `robot_description` has it with either"
        " drive",
    )
    left_wheel_joint: str = setting("left_wheel_joint", "joint of the left wheel in the URDF")
    right_wheel_joint: str = setting("right_wheel_joint", "joint of the right wheel in the URDF")
    wheel_radius_m: float | None = setting(
        None,
        "radius that controller and odometry assume; that of the URDF by default",
        unit="m",
        gt=0,
    )
    wheel_torque_nm: float = setting(5.0, "largest torque of each motor", unit="N m", gt=0)

    @model_validator(mode="after")
    def _drivable(self) -> "RobotSettings":
        if self.footprint and self.radius_m < self.outline.inscribed_m - 1e-9:
            raise ValueError(
                "radius_m must be at least that of the largest disc within the footprint"
                f" ({self.outline.inscribed_m:.3g} m), got {self.radius_m:g}; raise it"
            )
        if self.drive == "physical":
            drive = self.differential_drive()
            if drive.radius_m is None and self.wheel_radius_m is None:
                raise ValueError(
                    f"wheel_radius_m must be given, for the wheels of {drive.path} are neither"
                    " cylinders nor spheres"
                )
        return self

    def differential_drive(self) -> DifferentialDrive:
        """The drive of the URDF."""
        return read_differential_drive(
            self.urdf_path, self.left_wheel_joint, self.right_wheel_joint
        )

    @property
    def outline(self) -> Footprint:
        """The footprint, polygon or disc."""
        return footprint_of(self.radius_m, self.footprint)

    @property
    def urdf_path(self) -> Path:
        """The file of the physical robot."""
        return Path(self.urdf) if self.urdf else BUILTIN_URDF


class LidarSettings(StrictModel):
    """A 2-D lidar at the robot's centre that scans the full circle."""

    n_rays: int = setting(360, "rays of a scan, over the full circle", ge=4)
    range_min_m: float = setting(0.1, "smallest range; smaller ones are -inf", unit="m", ge=0)
    range_max_m: float = setting(10.0, "largest range; larger ones are inf", unit="m", gt=0)
    rate_hz: float = setting(
        10.0,
        "scans per second, at whole control periods; slower ones are too old for the guard",
        unit="Hz",
        ge=1.25,
    )
    noise_deviation_m: float = setting(
        0.0, "standard deviation of the normal noise of each range", unit="m", ge=0
    )

    @property
    def angle_min_rad(self) -> float:
        """Direction of the first ray, relative to the robot's heading."""
        return -math.pi

    @property
    def angle_increment_rad(self) -> float:
        """Angle between neighbouring rays."""
        return 2.0 * math.pi / self.n_rays

    @property
    def angles_rad(self) -> FloatArray:
        """(n_rays,) directions of the rays, relative to the robot's heading."""
        rays = np.arange(self.n_rays, dtype=np.float64)
        return self.angle_min_rad + self.angle_increment_rad * rays


class OdometrySettings(StrictModel):
    """Drift of the dead reckoning; none by default."""

    distance_scale_deviation: float = setting(
        0.0, "standard deviation of the relative error of distances, drawn per episode", ge=0
    )
    turn_scale_deviation: float = setting(
        0.0, "standard deviation of the relative error of turns, drawn per episode", ge=0
    )
    distance_noise_m: float = setting(
        0.0,
        "standard deviation of the distance error after 1 m; grows with the root of the distance",
        unit="m",
        ge=0,
    )
    turn_noise_rad: float = setting(
        0.0,
        "standard deviation of the turn error after 1 m; grows with the root of the distance",
        unit="rad",
        ge=0,
    )

    @property
    def drifts(self) -> bool:
        """Whether any deviation is above zero."""
        scales = self.distance_scale_deviation + self.turn_scale_deviation
        return scales + self.distance_noise_m + self.turn_noise_rad > 0.0


class Obstacle(StrictModel):
    """A solid inside the walkable area."""

    name: str = setting(..., "name of the obstacle")
    outline_m: Outline = setting(..., "corners of a simple polygon, in order", unit="m")


class Loop(StrictModel):
    """A closed line that people walk around, in the order of its waypoints."""

    name: str = setting(..., "name in the legend of the plan")
    waypoints_m: Polygon = setting(
        ...,
        "three corners or more, in the order of walking; no hairpins: turn round with two corners",
        unit="m",
    )
    lane_half_width_m: float = setting(
        1.2,
        "largest distance of people from the line; the whole lane must be walkable",
        unit="m",
        ge=0,
    )
    share: float = setting(1.0, "share of the people, relative to the other loops", gt=0)


class PedestrianSettings(StrictModel):
    """How many people walk, where, how fast, and by which social force model."""

    model: str = setting(
        "collision_prediction", f"social force model: {' or '.join(model_names())}"
    )
    count: int = setting(24, "number of people, at most 5.4 per walkable m²", ge=0)
    loops: tuple[Loop, ...] = setting((), "closed lines that people walk around")
    standing_m: tuple[Point, ...] = setting(
        (), "places of people who stand there, beside `count`; pushed away, they return", unit="m"
    )
    desired_speed_mean_mps: float = setting(
        1.34,
        "mean of the desired speeds, a normal distribution cut off at two deviations",
        unit="m/s",
        gt=0,
    )
    desired_speed_deviation_mps: float = setting(
        0.26, "standard deviation of the desired speeds", unit="m/s", ge=0
    )
    fluctuation_mps2: float = setting(
        0.1, "standard deviation of the random acceleration", unit="m/s²", ge=0
    )
    warm_up_s: float = setting(
        10.0, "simulated time that people walk before an episode begins", unit="s", ge=0
    )
    robot_visible: bool = setting(
        True, "whether people avoid the robot; contacts push them in either case"
    )

    @property
    def n_people(self) -> int:
        """Those who walk and those who stand."""
        return self.count + len(self.standing_m)

    @field_validator("model")
    @classmethod
    def _known_model(cls, name: str) -> str:
        model_named(name)
        return name
