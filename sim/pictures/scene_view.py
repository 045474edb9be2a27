"""Pictures of the world in three dimensions, by PyBullet's software renderer: ten a second."""

from numpy.typing import ArrayLike

from sim.pictures.camera import Camera, chase_camera, overview_camera
from sim.pictures.scene import Scene
from sim.pictures.trajectory import Frame, Trajectory
from sim.scenario.scenario import Scenario


class SceneView:
    """Draws one scenario from its overview camera, or from behind the robot when chasing."""

    def __init__(self, scenario: Scenario, *, chasing: bool = False) -> None:
        self._scene = Scene(scenario)
        x_min, y_min, x_max, y_max = scenario.bounds_m
        upright = y_max - y_min > x_max - x_min
        width_px, height_px = (480, 640) if upright else (640, 480)
        self._overview = overview_camera(scenario, width_px=width_px, height_px=height_px)
        self._chasing = chasing

    def frame(self, robot_pose: tuple[float, float, float], people_m: ArrayLike) -> Frame:
        """The scenario with the robot and (N, 2) people, as many as it has."""
        self._scene.place_robot(robot_pose)
        self._scene.place_people(people_m)
        return self._scene.render(self._camera(robot_pose))

    def frame_at(self, trajectory: Trajectory, tick: int) -> Frame:
        """The scenario at a tick of a trajectory; people look the way they have just come."""
        for shown in (max(tick - 1, 0), tick):
            x_m, y_m, yaw_rad = trajectory.robot_pose[shown].tolist()
            self._scene.place_robot((x_m, y_m, yaw_rad))
            self._scene.place_people(trajectory.people_position_m[shown])
        self._scene.place_obstacles(trajectory.obstacle_pose[tick])
        return self._scene.render(self._camera((x_m, y_m, yaw_rad)))

    def close(self) -> None:
        """Give PyBullet's world back."""
        self._scene.close()

    def __enter__(self) -> "SceneView":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _camera(self, robot_pose: tuple[float, float, float]) -> Camera:
        return chase_camera(robot_pose) if self._chasing else self._overview
