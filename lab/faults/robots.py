"""Three robots of other makers, as their lidars, rates, frames and stamps look to a stack.

Each is a stand-in: speeds, lidars and conventions are those of common robots that Nav2 drives, the
body is a kinematic one in the built-in hallway.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serd_bag.nearest import choice_rule
from serd_core.arrays import FloatArray
from serd_files.yaml_config import save_yaml_model
from serd_sim.errors import SimError
from serd_sim.robot.sensors import range_to_lines
from serd_sim.safety.motion import Pose, compose
from serd_sim.safety.scan import ScanGeometry
from serd_sim.safety.settings import CREEP_MPS
from serd_sim.scenario.scenario import Scenario, load_scenario

PERSON_RADIUS_M = 0.25
_NOISE_M = 0.01
#: A decision lasts this many times as long as the robot needs for a cell.
_PATIENCE_CELLS = 3.0


@dataclass(frozen=True)
class ReferenceRobot:
    """A robot and how its driver publishes.

    scan_hz: lowest and highest rate. lost: share of rays without a statement, and what they read.
    too_near: what is nearer than range_min reads. late_s: age of a scan's stamp. mount: of the
    lidar in base_link, which is lift_m ahead of base_footprint.
    """

    about: str
    radius_m: float
    max_vel_x_mps: float
    max_vel_theta_radps: float
    n_rays: int
    field_rad: float
    range_m: tuple[float, float]
    scan_hz: tuple[float, float]
    lost: tuple[float, float]
    too_near: float
    late_s: float
    odom_hz: float
    mount: Pose
    footprint: str = ""
    base_ahead_m: float = 0.0
    intensities: bool = False

    @property
    def geometry(self) -> ScanGeometry:
        """Angles and ranges of its scans."""
        closes = self.field_rad > 6.28
        steps = self.n_rays if closes else self.n_rays - 1
        return ScanGeometry(-0.5 * self.field_rad, self.field_rad / steps, *self.range_m)

    @property
    def _turning_s(self) -> float:
        """How long a half turn takes where the guard lets the robot only creep round (s).

        It does where a corner may swing into what the lidar does not look at. A decision that
        ends before is followed by another one, perhaps back again, and the robot stays in its cell.
        """
        if not self.footprint or self.field_rad >= math.tau:
            return 0.0
        return math.pi / (CREEP_MPS / self.max_vel_x_mps * self.max_vel_theta_radps)

    def scenario(self) -> Scenario:
        """The hallway for this robot."""
        hallway = load_scenario("hallway")
        needed_s = _PATIENCE_CELLS / self.max_vel_x_mps + self._turning_s
        patience_s = max(hallway.patience_s, math.ceil(needed_s))
        hallway = hallway.model_copy(update={"patience_s": patience_s})
        ticks = math.ceil(1.0 / (self.scan_hz[0] * hallway.control_period_s) - 1e-9)
        rate_hz = 1.0 / (ticks * hallway.control_period_s)
        return hallway.with_values("lidar", rate_hz=rate_hz).with_values(
            "robot",
            drive="kinematic",
            radius_m=self.radius_m,
            footprint=self.footprint,
            max_vel_x_mps=self.max_vel_x_mps,
            max_vel_theta_radps=self.max_vel_theta_radps,
            decel_lim_x_mps2=2.5,
            acc_lim_theta_radps2=3.2,
        )

    def save_scenario(self, folder: Path) -> Path:
        """The file of its scenario."""
        path = folder / "scenario.yaml"
        save_yaml_model(path, self.scenario())
        return path

    def ranges_m(
        self, walls_m: FloatArray, pose: Pose, people_m: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """(n_rays,) what its driver publishes from a pose of base_footprint, by its conventions."""
        lidar = compose(compose(pose, (self.base_ahead_m, 0.0, 0.0)), self.mount)
        angle = self.geometry.angles_rad(self.n_rays) + lidar[2]
        ray_x, ray_y = np.cos(angle), np.sin(angle)
        start_m, along_m = walls_m[:, 0] - lidar[:2], walls_m[:, 1] - walls_m[:, 0]
        ranges_m = range_to_lines(start_m[:, 0], start_m[:, 1], along_m, ray_x, ray_y)
        for x_m, y_m in people_m - np.array(lidar[:2]):
            ahead_m, aside_m = ray_x * x_m + ray_y * y_m, ray_x * y_m - ray_y * x_m
            depth_m = np.sqrt(np.maximum(PERSON_RADIUS_M**2 - aside_m**2, 0.0))
            met = (depth_m > 0.0) & (ahead_m > 0.0)
            ranges_m = np.where(met, np.minimum(ranges_m, ahead_m - depth_m), ranges_m)
        ranges_m = ranges_m + _NOISE_M * rng.standard_normal(self.n_rays)
        low_m, high_m = self.range_m
        ranges_m = np.where(ranges_m > high_m, np.inf, ranges_m)
        ranges_m = np.where(ranges_m < low_m, self.too_near, ranges_m)
        share, reads = self.lost
        ranges_m[rng.random(self.n_rays) < share] = reads
        return ranges_m


ROBOTS: dict[str, ReferenceRobot] = {
    "short_range": ReferenceRobot(
        "lidar of 3.5 m and 5 Hz that sends 0 and +inf", 0.11, 0.26, 1.8, 360, math.tau,
        (0.12, 3.5), (5.0, 5.0), (0.02, 0.0), 0.0, 0.03, 20.0, (-0.03, 0.0, 0.0),
    ),
    "spinning": ReferenceRobot(
        "lidar of 12 m and 7 to 10 Hz that sends +inf and NaN", 0.18, 0.5, 1.9, 720, math.tau,
        (0.15, 12.0), (7.0, 10.0), (0.02, math.nan), math.nan, 0.06, 30.0,
        (0.05, 0.0, math.pi), base_ahead_m=0.02,
    ),
    "fast": ReferenceRobot(
        "lidar of 30 m, 40 Hz, 270 degrees and 1,081 rays that sends -inf and intensities", 0.22,
        0.8, 2.0, 1081, math.radians(270.0), (0.1, 30.0), (40.0, 40.0), (0.01, math.inf),
        -math.inf, 0.012, 50.0, (0.12, 0.0, 0.0), intensities=True,
        footprint="[[0.27, 0.22], [-0.25, 0.22], [-0.25, -0.22], [0.27, -0.22]]",
    ),
}  # fmt: skip


def robot_named(name: str) -> ReferenceRobot:
    """The robot of that name; SimError with the nearest name when there is none."""
    if name not in ROBOTS:
        raise SimError(choice_rule("robot", name, ROBOTS))
    return ROBOTS[name]
