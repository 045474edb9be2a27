"""A scenario in three dimensions: walls, a floor with a grid, the robot and people who walk.

PyBullet's software renderer draws about ten pictures a second.

Nothing in it moves by itself. Wheels, legs and arms are turned by the way that robot and people
have come since they were placed last; who has not moved keeps direction and stride.
"""

import math
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray
from serd_sim.errors import SimError
from serd_sim.pictures.movie import Frame
from serd_sim.robot.bullet import add_wall, close, load_urdf, new_world, pybullet, turned
from serd_sim.scenario.scenario import Scenario
from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.observation import Observation, Pose

_PERSON_URDF = Path(__file__).with_name("person.urdf")
_WALL_COLOUR = (0.80, 0.78, 0.74, 1.0)
_FLOOR_COLOUR, _LINE_COLOUR = (0.93, 0.92, 0.89, 1.0), (0.85, 0.84, 0.81, 1.0)
_LINE_M, _MOST_LINES, _HALF_PLATE_M = 0.03, 200, 0.001
_LIGHT_FROM = (3.0, -4.0, 8.0)
#: A step is this long; legs swing by up to `_SWING_RAD` to each side.
_STEP_M, _SWING_RAD = 0.7, 0.33
#: A longer way in one go is a jump to another place.
_LONGEST_WAY_M = 1.0
_MOVED_M = 1e-3
#: Left and right joint of the person's URDF.
_LEGS, _ARMS = (3, 4), (5, 6)
_SHIRTS = (
    (0.91, 0.56, 0.24, 1.0),
    (0.86, 0.47, 0.20, 1.0),
    (0.95, 0.66, 0.33, 1.0),
    (0.80, 0.42, 0.22, 1.0),
)

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


class Scene:
    """Pictures of one scenario, or the window that shows it with `gui`."""

    def __init__(self, scenario: Scenario, *, gui: bool = False) -> None:
        if gui:
            _require_display()
        self.client = new_world(gui=gui)
        try:
            self._add_bodies(scenario, gui=gui)
        except BaseException:
            self.close()
            raise
        self._robot_pose: Pose | None = None
        self._people_m: FloatArray | None = None
        count = scenario.pedestrians.n_people
        #: Direction and stride of each person, in radians.
        self._heading_rad = np.zeros(count)
        self._stride_rad = 2.4 * np.arange(count)

    def _add_bodies(self, scenario: Scenario, *, gui: bool) -> None:
        if gui:
            self._show(pybullet.COV_ENABLE_GUI, False)
            self._show(pybullet.COV_ENABLE_SHADOWS, False)
            # Drawn after each body that is added, the window takes minutes to open without a GPU.
            self._show(pybullet.COV_ENABLE_RENDERING, False)
        for start, end in scenario.wall_segments_m:
            wall = add_wall(self.client, start, end)
            self.client.changeVisualShape(wall, -1, rgbaColor=_WALL_COLOUR)
        self._add_floor(scenario)
        self._robot = self._load_robot(scenario)
        count = scenario.pedestrians.n_people
        self._people = [self._load_person(number) for number in range(count)]
        if gui:
            camera = overview_camera(scenario)
            direction = camera.yaw_deg, camera.pitch_deg, camera.target_m
            # The window sees more at a time than the pictures.
            self.client.resetDebugVisualizerCamera(0.6 * camera.distance_m, *direction)
            self._show(pybullet.COV_ENABLE_RENDERING, True)

    def place_robot(self, pose: Pose) -> None:
        """Put the robot somewhere; its wheels roll the way from where it was."""
        x_m, y_m, yaw_rad = pose
        root_m = (x_m, y_m, self._root_height_m)
        mass = pybullet.multiplyTransforms(root_m, turned(yaw_rad), *self._mass_in_root)
        self.client.resetBasePositionAndOrientation(self._robot, *mass)
        if self._robot_pose is not None:
            turn_rad = math.remainder(yaw_rad - self._robot_pose[2], math.tau)
            heading = self._robot_pose[2] + 0.5 * turn_rad
            way_m = (x_m - self._robot_pose[0]) * math.cos(heading)
            way_m += (y_m - self._robot_pose[1]) * math.sin(heading)
            for wheel, (joint, side) in enumerate(self._wheels.items()):
                self._wheels_rad[wheel] += (way_m + side * turn_rad) / self._wheel_radius_m
                self.client.resetJointState(self._robot, joint, self._wheels_rad[wheel], 0.0)
        self._robot_pose = pose

    def place_people(self, positions_m: ArrayLike, velocities_mps: ArrayLike | None = None) -> None:
        """Put (N, 2) people somewhere, as many as the scenario has.

        velocities_mps: (N, 2), for people who have not been placed before.
        """
        now = np.array(positions_m, dtype=np.float64).reshape(-1, 2)
        way = np.zeros_like(now) if self._people_m is None else now - self._people_m
        if self._people_m is None and velocities_mps is not None:
            velocity = np.asarray(velocities_mps, dtype=np.float64).reshape(-1, 2)
            self._heading_rad = np.arctan2(velocity[:, 1], velocity[:, 0])
        self._people_m = now
        length = np.hypot(way[:, 0], way[:, 1])
        walked = (length > _MOVED_M) & (length < _LONGEST_WAY_M)
        self._heading_rad[walked] = np.arctan2(way[walked, 1], way[walked, 0])
        self._stride_rad[walked] += math.pi * length[walked] / _STEP_M
        for body, (x_m, y_m), heading, stride in zip(
            self._people, now.tolist(), self._heading_rad, self._stride_rad, strict=True
        ):
            self.client.resetBasePositionAndOrientation(body, (x_m, y_m, 0.0), turned(heading))
            swing = _SWING_RAD * math.sin(stride)
            for (left, right), angle in ((_LEGS, swing), (_ARMS, -0.7 * swing)):
                self.client.resetJointState(body, left, angle, 0.0)
                self.client.resetJointState(body, right, -angle, 0.0)

    def render(self, camera: Camera) -> Frame:
        """(height, width, 3) picture by PyBullet's software renderer."""
        view = pybullet.computeViewMatrixFromYawPitchRoll(
            camera.target_m, camera.distance_m, camera.yaw_deg, camera.pitch_deg, 0.0, 2
        )
        ratio = camera.width_px / camera.height_px
        projection = pybullet.computeProjectionMatrixFOV(
            camera.field_of_view_deg, ratio, 0.1, 10.0 * camera.distance_m
        )
        image = self.client.getCameraImage(
            camera.width_px,
            camera.height_px,
            view,
            projection,
            lightDirection=_LIGHT_FROM,
            lightAmbientCoeff=0.62,
            lightDiffuseCoeff=0.42,
            lightSpecularCoeff=0.05,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
        )
        pixels = np.asarray(image[2], dtype=np.uint8)
        return pixels.reshape(camera.height_px, camera.width_px, 4)[:, :, :3].copy()

    def close(self) -> None:
        """Leave PyBullet; a second call does nothing."""
        close(self.client)

    def _show(self, what: int, on: bool) -> None:
        """Switch a part of the window on or off."""
        self.client.configureDebugVisualizer(what, int(on))

    def _add_floor(self, scenario: Scenario) -> None:
        """A plate with lines across the walkable area."""
        x_min, y_min, x_max, y_max = scenario.bounds_m
        half_m = (0.5 * (x_max - x_min) + 1.0, 0.5 * (y_max - y_min) + 1.0)
        self._add_plate(
            (0.5 * (x_min + x_max), 0.5 * (y_min + y_max)), half_m, -0.01, _FLOOR_COLOUR
        )
        for west, south, east, north in _floor_lines(scenario):
            self._add_plate(
                (0.5 * (west + east), 0.5 * (south + north)),
                (0.5 * (east - west + _LINE_M), 0.5 * (north - south + _LINE_M)),
                0.0,
                _LINE_COLOUR,
            )

    def _add_plate(
        self,
        middle_m: tuple[float, float],
        half_m: tuple[float, float],
        top_m: float,
        colour: tuple[float, float, float, float],
    ) -> None:
        shape = self.client.createVisualShape(
            pybullet.GEOM_BOX, halfExtents=(*half_m, _HALF_PLATE_M), rgbaColor=colour
        )
        self.client.createMultiBody(0.0, -1, shape, (*middle_m, top_m - _HALF_PLATE_M))

    def _load_robot(self, scenario: Scenario) -> int:
        """The robot of the scenario; the kinematic one looks like the built-in robot."""
        settings, scale = scenario.robot, 1.0
        if settings.drive != "physical":
            settings = RobotSettings()
            scale = scenario.robot.radius_m / settings.radius_m
        drive = settings.differential_drive()
        self._wheel_radius_m = scale * settings.rolling_radius_m(drive)
        self._root_height_m = self._wheel_radius_m - scale * drive.axle_height_m
        body = load_urdf(self.client, drive.path, globalScaling=scale, useFixedBase=True)
        #: PyBullet places a body by the frame of its mass.
        self._mass_in_root = self.client.getDynamicsInfo(body, -1)[3:5]
        sides = (-0.5 * scale * drive.separation_m, 0.5 * scale * drive.separation_m)
        joints = {
            self.client.getJointInfo(body, joint)[1].decode(): joint
            for joint in range(self.client.getNumJoints(body))
        }
        #: Half the wheels' separation, with the sign of the side, by joint.
        self._wheels = dict(zip((joints[name] for name in drive.wheel_joints), sides, strict=True))
        self._wheels_rad = [0.0, 0.0]
        return body

    def _load_person(self, number: int) -> int:
        place = (-10.0 - number, -10.0, 0.0)
        body = load_urdf(self.client, _PERSON_URDF, basePosition=place, useFixedBase=True)
        for link in (-1, *_ARMS):
            self.client.changeVisualShape(body, link, rgbaColor=_SHIRTS[number % len(_SHIRTS)])
        return body


class SceneView(Scene):
    """Draws episodes from the overview camera, or from behind the robot when chasing."""

    def __init__(self, scenario: Scenario, *, chasing: bool = False) -> None:
        super().__init__(scenario)
        x_min, y_min, x_max, y_max = scenario.bounds_m
        size_px = (480, 640) if y_max - y_min > x_max - x_min else (640, 480)
        self._overview = None if chasing else overview_camera(scenario, *size_px)

    def frame_at(self, seen: Sequence[Observation], tick: int) -> Frame:
        """The scenario at a tick of an episode; people look the way they have just come."""
        for shown in (seen[max(tick - 1, 0)], seen[tick]):
            self.place_robot(shown.pose)
            self.place_people(shown.people_position_m)
        return self.render(self._overview or chase_camera(seen[tick].pose))


def _floor_lines(scenario: Scenario) -> list[tuple[float, float, float, float]]:
    """(west, south, east, north) of the lines of a grid, as far as they are walkable."""
    x_min, y_min, x_max, y_max = scenario.bounds_m
    area = shapely.Polygon(scenario.walkable_area_m)
    for solid in scenario.wall_polygons_m[1:]:
        area = area.difference(shapely.Polygon(solid))
    lines = [((x_m, y_min), (x_m, y_max)) for x_m in _whole_metres(x_min, x_max)]
    lines += [((x_min, y_m), (x_max, y_m)) for y_m in _whole_metres(y_min, y_max)]
    parts = shapely.get_parts(shapely.intersection(shapely.linestrings(lines), area))
    return [part.bounds for part in parts if part.length > 0.0]


def _whole_metres(low_m: float, high_m: float) -> FloatArray:
    """Between two bounds, fewer in a place that is very large."""
    distance_m = math.ceil((high_m - low_m) / _MOST_LINES)
    return np.arange(math.floor(low_m) + 1.0, high_m, distance_m)


def _require_display() -> None:
    """SimError without a display, where PyBullet would end the process."""
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        raise SimError(
            "gui must be off where there is no display, but the variable DISPLAY is not set"
            "; run with gui:=false or under xvfb-run"
        )


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
