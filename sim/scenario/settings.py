"""Settings of the robot, its lidar and the crowd, as they stand in a scenario file."""

import math
from typing import Annotated

from pydantic import AfterValidator, Field, field_validator

from sim.crowd.social_force import model_named
from sim.geometry.polygon import Point, require_simple
from storage.yaml_config import StrictModel

Polygon = Annotated[tuple[Point, ...], Field(min_length=3)]
#: A polygon that bounds an area: it must not cross itself, nor shrink to a line.
Outline = Annotated[Polygon, AfterValidator(require_simple)]


class RobotSettings(StrictModel):
    """A round differential-drive robot. Limits carry the names Nav2 users know."""

    radius_m: float = Field(default=0.25, gt=0)
    height_m: float = Field(default=0.6, gt=0)
    max_vel_x_mps: float = Field(default=1.2, gt=0)
    min_vel_x_mps: float = Field(default=-0.3, le=0)
    max_vel_theta_radps: float = Field(default=3.5, gt=0)
    acc_lim_x_mps2: float = Field(default=2.5, gt=0)
    acc_lim_theta_radps2: float = Field(default=12.0, gt=0)


class LidarSettings(StrictModel):
    """A 2-D lidar at the robot's centre that looks all around."""

    n_rays: int = Field(default=360, ge=4)
    range_min_m: float = Field(default=0.1, ge=0)
    range_max_m: float = Field(default=10.0, gt=0)
    rate_hz: float = Field(default=10.0, gt=0)
    noise_deviation_m: float = Field(default=0.0, ge=0)

    @property
    def angle_min_rad(self) -> float:
        """Direction of the first ray, relative to the robot's heading."""
        return -math.pi

    @property
    def angle_increment_rad(self) -> float:
        """Angle between neighbouring rays."""
        return 2.0 * math.pi / self.n_rays

    @property
    def angle_max_rad(self) -> float:
        """Direction of the last ray."""
        return self.angle_min_rad + (self.n_rays - 1) * self.angle_increment_rad


class OdometrySettings(StrictModel):
    """Drift of the wheels' dead reckoning; none by default.

    Scale deviations are relative, drawn per episode; noise grows with the root of the way.
    """

    distance_scale_deviation: float = Field(default=0.0, ge=0)
    turn_scale_deviation: float = Field(default=0.0, ge=0)
    distance_noise_m: float = Field(default=0.0, ge=0)
    turn_noise_rad: float = Field(default=0.0, ge=0)

    @property
    def drifts(self) -> bool:
        """Whether any deviation is above zero."""
        scales = self.distance_scale_deviation + self.turn_scale_deviation
        return scales + self.distance_noise_m + self.turn_noise_rad > 0.0


class Loop(StrictModel):
    """A closed way people walk round and round, listed as right-hand traffic walks it.

    share: part of the people that walk here, relative to the other loops.
    """

    name: str
    waypoints_m: Polygon
    lane_half_width_m: float = Field(default=1.2, ge=0)
    share: float = Field(default=1.0, gt=0)


class PedestrianSettings(StrictModel):
    """How many people walk, where, how fast, and by which social force model."""

    model: str = "circular_anisotropic"
    count: int = Field(default=24, ge=0)
    loops: tuple[Loop, ...] = ()
    desired_speed_mean_mps: float = Field(default=1.34, gt=0)
    desired_speed_deviation_mps: float = Field(default=0.26, ge=0)
    fluctuation_mps2: float = Field(default=0.1, ge=0)
    warm_up_s: float = Field(default=10.0, ge=0)
    robot_visible: bool = True

    @field_validator("model")
    @classmethod
    def _known_model(cls, name: str) -> str:
        model_named(name)
        return name
