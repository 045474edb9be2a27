"""Pictures of the world in three dimensions, by PyBullet's software renderer: ten a second."""

import math

import numpy as np
from numpy.typing import ArrayLike

from sim.crowd.social_force import model_named
from sim.pictures.camera import Camera, chase_camera, overview_camera
from sim.pictures.trajectory import Frame, Trajectory
from sim.robot.physics import Physics
from sim.scenario.scenario import Scenario


class SceneView:
    """Draws one scenario from its overview camera, or from behind the robot when chasing."""

    def __init__(self, scenario: Scenario, *, chasing: bool = False) -> None:
        person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        self._physics = Physics(scenario, person_radius_m)
        x_min, y_min, x_max, y_max = scenario.bounds_m
        upright = y_max - y_min > x_max - x_min
        width_px, height_px = (480, 640) if upright else (640, 480)
        self._overview = overview_camera(scenario, width_px=width_px, height_px=height_px)
        self._chasing = chasing

    def frame(self, robot_pose: tuple[float, float, float], people_m: ArrayLike) -> Frame:
        """The scenario with the robot and (N, 2) people, as many as it has."""
        x_m, y_m, yaw_rad = robot_pose
        people = np.asarray(people_m, dtype=np.float64)
        self._physics.place_robot(x_m, y_m, (math.sin(0.5 * yaw_rad), math.cos(0.5 * yaw_rad)))
        self._physics.place_people(people[:, 0], people[:, 1])
        return self._physics.render(self._camera(robot_pose))

    def frame_at(self, trajectory: Trajectory, tick: int) -> Frame:
        """The scenario at a tick of a trajectory."""
        x_m, y_m, yaw_rad = trajectory.robot_pose[tick].tolist()
        return self.frame((x_m, y_m, yaw_rad), trajectory.people_position_m[tick])

    def close(self) -> None:
        """Give PyBullet's world back."""
        self._physics.close()

    def __enter__(self) -> "SceneView":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _camera(self, robot_pose: tuple[float, float, float]) -> Camera:
        return chase_camera(robot_pose) if self._chasing else self._overview
