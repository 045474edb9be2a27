"""A camera in the physics world, for pictures in three dimensions."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.errors import SimError
from sim.scenario import Scenario


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


def overview_camera(scenario: Scenario, *, width_px: int = 640, height_px: int = 480) -> Camera:
    """A camera that has the whole scenario in view, from the south."""
    x_min, y_min, x_max, y_max = scenario.bounds_m
    half_view = math.tan(math.radians(30.0))
    reach = max(y_max - y_min, (x_max - x_min) * height_px / width_px)
    return Camera(
        target_m=(0.5 * (x_min + x_max), 0.5 * (y_min + y_max), 0.0),
        distance_m=0.68 * reach / half_view,
        pitch_deg=-60.0,
        width_px=width_px,
        height_px=height_px,
    )


def chase_camera(pose: tuple[float, float, float], distance_m: float = 4.0) -> Camera:
    """A camera behind the robot, looking the way it goes."""
    x_m, y_m, yaw_rad = pose
    return Camera(
        target_m=(x_m, y_m, 0.5),
        distance_m=distance_m,
        yaw_deg=math.degrees(yaw_rad) - 90.0,
        pitch_deg=-45.0,
    )


def as_frame(pixels: object, camera: Camera) -> NDArray[np.uint8]:
    """(height, width, 3) of the renderer's RGBA bytes."""
    image = np.asarray(pixels, dtype=np.uint8).reshape(camera.height_px, camera.width_px, 4)
    return image[:, :, :3].copy()
