"""A camera in the physics world, for pictures in three dimensions."""

import math
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from serd_sim.errors import SimError
from serd_sim.scenario.scenario import Scenario

#: (height, width, 3) picture.
Frame = NDArray[np.uint8]
_HIGHEST_M = 1.75
_FILLED = 0.96
_FITTING_PASSES = 40
#: Of the camera that follows the robot.
_BEHIND_M = 6.0


@dataclass(frozen=True)
class Camera:
    """Looks at a point of the map from a distance; yaw 0 looks north, pitch -90 straight down."""

    target_m: tuple[float, float, float]
    distance_m: float
    yaw_deg: float = 0.0
    pitch_deg: float = -50.0
    field_of_view_deg: float = 60.0
    width_px: int = 640
    height_px: int = 480

    def __post_init__(self) -> None:
        if not self.distance_m > 0:
            raise SimError(f"distance_m must be above 0, got {self.distance_m}; step back")
        if self.width_px < 1 or self.height_px < 1:
            size = (self.width_px, self.height_px)
            raise SimError(f"width_px and height_px must be at least 1, got {size}; raise them")


def overview_camera(scenario: Scenario, width_px: int = 640, height_px: int = 480) -> Camera:
    """A camera that has the whole scenario in view, from the south, as near as that allows.

    Pinhole: at (right, up, depth) from the eye a point is seen at f (right, up) / depth, with
    f = 1 / tan(half the field of view) for the height and f * height / width for the width.
    """
    x_min, y_min, x_max, y_max = scenario.bounds_m
    corners_m = np.array(list(product((x_min, x_max), (y_min, y_max), (0.0, _HIGHEST_M))))
    camera = Camera(
        target_m=(0.5 * (x_min + x_max), 0.5 * (y_min + y_max), 0.0),
        distance_m=2.0 * math.hypot(x_max - x_min, y_max - y_min),
        pitch_deg=-70.0,
        width_px=width_px,
        height_px=height_px,
    )
    for _ in range(_FITTING_PASSES):
        camera = _nearer_fit(camera, corners_m)
    return camera


def _nearer_fit(camera: Camera, points_m: FloatArray) -> Camera:
    """The camera moved so that the points fill the picture's middle more nearly."""
    pitch = math.radians(camera.pitch_deg)
    away = points_m - np.array(camera.target_m)
    forward = np.array([0.0, math.cos(pitch), math.sin(pitch)])
    upward = np.array([0.0, -math.sin(pitch), math.cos(pitch)])
    depth = np.maximum(camera.distance_m + away @ forward, 1e-3)
    focus = 1.0 / math.tan(math.radians(0.5 * camera.field_of_view_deg))
    across = focus * camera.height_px / camera.width_px * away[:, 0] / depth
    up = focus * (away @ upward) / depth
    reach = max(np.ptp(across), np.ptp(up)) / (2.0 * _FILLED)
    shift_m = camera.distance_m / focus * 0.5 * (up.max() + up.min()) / -math.sin(pitch)
    x_m, y_m, z_m = camera.target_m
    return replace(
        camera,
        target_m=(x_m, y_m + shift_m, z_m),
        distance_m=camera.distance_m * min(max(float(reach), 0.5), 2.0),
    )


def chase_camera(pose: tuple[float, float, float]) -> Camera:
    """A camera behind the robot that looks at a point ahead of it, the way it goes."""
    x_m, y_m, yaw_rad = pose
    ahead_m = 0.25 * _BEHIND_M
    return Camera(
        target_m=(x_m + ahead_m * math.cos(yaw_rad), y_m + ahead_m * math.sin(yaw_rad), 0.5),
        distance_m=_BEHIND_M,
        yaw_deg=math.degrees(yaw_rad) - 90.0,
        pitch_deg=-35.0,
    )
