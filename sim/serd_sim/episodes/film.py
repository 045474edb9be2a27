"""An episode from above, drawn straight into pixels, and its frames as files: PNG and GIF.

A frame is (height, width, 3) uint8, row 0 at the top. Discs are blended with a smooth edge one
pixel wide.
"""

from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from serd_bag.files import atomic_write_bytes
from serd_core.arrays import FloatArray
from serd_sim.crowd.social_force import model_named
from serd_sim.errors import SimError
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.scenario.polygon import contains
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation

#: (height, width, 3) picture.
Frame = NDArray[np.uint8]


def save_png(frame: Frame, path: str | Path) -> None:
    """Write one frame."""
    content = BytesIO()
    Image.fromarray(frame).save(content, format="PNG", optimize=True)
    atomic_write_bytes(path, content.getvalue())


def save_gif(frames: Iterable[Frame], path: str | Path, frames_per_s: float = 10.0) -> None:
    """Write an endless GIF with one palette for all frames."""
    others = iter(frames)
    first = next(others, None)
    if first is None:
        raise SimError("a movie must have at least one frame, got none; record an episode first")
    palette = Image.fromarray(first).quantize(colors=64)
    images = (
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in others
    )
    content, period_ms = BytesIO(), round(1000.0 / frames_per_s)
    options = {"append_images": images, "duration": period_ms, "loop": 0}
    palette.save(content, format="GIF", save_all=True, **options)
    atomic_write_bytes(path, content.getvalue())


Colour = tuple[int, int, int]

_FLOOR, _WALL, _OUTSIDE = (250, 249, 246), (92, 90, 86), (226, 224, 219)
_GOAL, _START = (214, 236, 214), (214, 226, 242)
_PERSON, _NOSE = (232, 150, 72), (140, 78, 24)
_ROBOT, _TRAIL, _ROBOT_NOSE = (38, 92, 180), (150, 182, 226), (240, 244, 252)
_WALL_M, _MARGIN_M = 0.12, 0.3
_TRAIL_TICKS = 2


class TopView:
    """Draws one scenario from above."""

    def __init__(self, scenario: Scenario, pixels_per_m: float = 24.0) -> None:
        self._scale = pixels_per_m
        self._robot_radius_m = scenario.robot.radius_m
        self._person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        x_min, y_min, x_max, y_max = scenario.bounds_m
        self._left_m, self._top_m = x_min - _MARGIN_M, y_max + _MARGIN_M
        width = round((x_max - x_min + 2 * _MARGIN_M) * pixels_per_m)
        height = round((y_max - y_min + 2 * _MARGIN_M) * pixels_per_m)
        self._background = self._drawn_background(scenario, height, width)

    def frame(
        self,
        robot_pose: tuple[float, float, float] | None = None,
        people_m: ArrayLike = (),
        *,
        previous_people_m: ArrayLike | None = None,
        trail_m: ArrayLike = (),
    ) -> Frame:
        """The scenario with (N, 2) people, the robot and the (K, 2) way it has come.

        previous_people_m: where the people were a little before, to show which way they walk.
        """
        canvas = self._background.copy()
        for x_m, y_m in np.asarray(trail_m, dtype=np.float64).reshape(-1, 2):
            self._disc(canvas, x_m, y_m, 0.05, _TRAIL)
        people = np.asarray(people_m, dtype=np.float64).reshape(-1, 2)
        for x_m, y_m in people:
            self._disc(canvas, x_m, y_m, self._person_radius_m, _PERSON)
        if previous_people_m is not None:
            self._draw_noses(canvas, people, np.asarray(previous_people_m, dtype=np.float64))
        if robot_pose is not None:
            x_m, y_m, yaw = robot_pose
            self._disc(canvas, x_m, y_m, self._robot_radius_m, _ROBOT)
            nose = 0.6 * self._robot_radius_m
            nose_x, nose_y = x_m + nose * np.cos(yaw), y_m + nose * np.sin(yaw)
            self._disc(canvas, nose_x, nose_y, 0.3 * self._robot_radius_m, _ROBOT_NOSE)
        return canvas.astype(np.uint8)

    def frame_at(self, seen: Sequence[Observation], tick: int) -> Frame:
        """The scenario at a tick of an episode, with the way the robot has come."""
        return self.frame(
            seen[tick].pose,
            seen[tick].people_position_m,
            previous_people_m=seen[max(tick - 1, 0)].people_position_m,
            trail_m=[each.pose[:2] for each in seen[:tick:_TRAIL_TICKS]],
        )

    def _draw_noses(self, canvas: FloatArray, people: FloatArray, before: FloatArray) -> None:
        moved = people - before
        length = np.linalg.norm(moved, axis=1, keepdims=True)
        ahead = people + 0.6 * self._person_radius_m * moved / np.maximum(length, 1e-9)
        for (x_m, y_m), way in zip(ahead, length[:, 0], strict=True):
            if way > 1e-4:
                self._disc(canvas, x_m, y_m, 0.3 * self._person_radius_m, _NOSE)

    def _disc(
        self, canvas: FloatArray, x_m: float, y_m: float, radius_m: float, colour: Colour
    ) -> None:
        column, row = (x_m - self._left_m) * self._scale, (self._top_m - y_m) * self._scale
        reach = radius_m * self._scale
        low_row, low_column = max(int(row - reach - 1), 0), max(int(column - reach - 1), 0)
        window = canvas[low_row : int(row + reach + 2), low_column : int(column + reach + 2)]
        if not window.size:
            return
        rows = np.arange(window.shape[0])[:, None] + low_row + 0.5 - row
        columns = np.arange(window.shape[1])[None, :] + low_column + 0.5 - column
        cover = np.clip(reach + 0.5 - np.sqrt(rows**2 + columns**2), 0.0, 1.0)[..., None]
        window += cover * (np.array(colour) - window)

    def _drawn_background(self, scenario: Scenario, height: int, width: int) -> FloatArray:
        x_m = self._left_m + (np.arange(width) + 0.5) / self._scale
        y_m = self._top_m - (np.arange(height) + 0.5) / self._scale
        grid_x, grid_y = np.meshgrid(x_m, y_m)
        points = np.stack([grid_x.ravel(), grid_y.ravel()], axis=1)
        distance = wall_distance_raster(scenario).at(grid_x, grid_y)
        canvas = np.empty((height, width, 3))
        canvas[:] = _OUTSIDE
        canvas[distance > -_WALL_M] = _WALL
        canvas[distance > 0.0] = _FLOOR
        areas = [(area, _START) for area in scenario.start_areas_m.values()]
        for area, colour in [*areas, (scenario.goal_area_m, _GOAL)]:
            inside = contains(area, points).reshape(height, width) & (distance > 0.0)
            canvas[inside] = colour
        return canvas
