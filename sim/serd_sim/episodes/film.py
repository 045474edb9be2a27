"""An episode from above, drawn straight into pixels, and its frames as files: PNG and GIF.

A frame is (height, width, 3) uint8, row 0 at the top. It is drawn with finer pixels, whose means
make smooth edges.
"""

from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from serd_bag.files import atomic_write_bytes
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
#: People who move less (m) in a tick stand.
_STANDING_M = 1e-4
#: Fine pixels along a side of a pixel, whose mean it is.
_FINE = 3


class TopView:
    """Draws one scenario from above."""

    def __init__(self, scenario: Scenario, pixels_per_m: float = 24.0) -> None:
        #: Fine pixels per metre.
        self._scale = _FINE * pixels_per_m
        self._robot_radius_m = scenario.robot.radius_m
        self._person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        x_min, y_min, x_max, y_max = scenario.bounds_m
        self._left_m, self._top_m = x_min - _MARGIN_M, y_max + _MARGIN_M
        width = _FINE * round((x_max - x_min + 2 * _MARGIN_M) * pixels_per_m)
        height = _FINE * round((y_max - y_min + 2 * _MARGIN_M) * pixels_per_m)
        self._background = self._drawn_background(scenario, height, width)

    def frame_at(self, seen: Sequence[Observation], tick: int) -> Frame:
        """The scenario at a tick of an episode, with the way the robot has come.

        A nose shows the robot's heading, and which way a person has walked since the tick before.
        """
        canvas = self._background.copy()
        now, before = seen[tick], seen[max(tick - 1, 0)]
        for each in seen[:tick:_TRAIL_TICKS]:
            self._disc(canvas, each.pose[:2], 0.05, _TRAIL)
        radius_m, people_m = self._person_radius_m, now.people_position_m
        for place_m, moved_m in zip(people_m, people_m - before.people_position_m, strict=True):
            self._disc(canvas, place_m, radius_m, _PERSON)
            if (way_m := float(np.hypot(*moved_m))) > _STANDING_M:
                ahead_m = place_m + 0.6 * radius_m / way_m * moved_m
                self._disc(canvas, ahead_m, 0.3 * radius_m, _NOSE)
        (x_m, y_m, yaw_rad), radius_m = now.pose, self._robot_radius_m
        self._disc(canvas, (x_m, y_m), radius_m, _ROBOT)
        nose_m = x_m + 0.6 * radius_m * np.cos(yaw_rad), y_m + 0.6 * radius_m * np.sin(yaw_rad)
        self._disc(canvas, nose_m, 0.3 * radius_m, _ROBOT_NOSE)
        return np.asarray(canvas.reduce(_FINE))

    def _disc(
        self, canvas: Image.Image, place_m: Sequence[float], radius_m: float, colour: Colour
    ) -> None:
        column, row = place_m[0] - self._left_m, self._top_m - place_m[1]
        box_m = np.array([column - radius_m, row - radius_m, column + radius_m, row + radius_m])
        ImageDraw.Draw(canvas).ellipse((self._scale * box_m).tolist(), fill=colour)

    def _drawn_background(self, scenario: Scenario, height: int, width: int) -> Image.Image:
        x_m = self._left_m + (np.arange(width) + 0.5) / self._scale
        y_m = self._top_m - (np.arange(height) + 0.5) / self._scale
        grid_x, grid_y = np.meshgrid(x_m, y_m)
        points = np.stack([grid_x.ravel(), grid_y.ravel()], axis=1)
        distance = wall_distance_raster(scenario).at(grid_x, grid_y)
        canvas = np.empty((height, width, 3), dtype=np.uint8)
        canvas[:] = _OUTSIDE
        canvas[distance > -_WALL_M] = _WALL
        canvas[distance > 0.0] = _FLOOR
        areas = [(area, _START) for area in scenario.start_areas_m.values()]
        for area, colour in [*areas, (scenario.goal_area_m, _GOAL)]:
            inside = contains(area, points).reshape(height, width) & (distance > 0.0)
            canvas[inside] = colour
        return Image.fromarray(canvas)
