"""Trajectories in the scene of PyBullet."""

from serd_sim.pictures.camera import Frame, chase_camera, overview_camera
from serd_sim.pictures.scene import Scene
from serd_sim.pictures.trajectory import Trajectory
from serd_sim.scenario.scenario import Scenario


class SceneView(Scene):
    """Draws trajectories from the overview camera, or from behind the robot when chasing."""

    def __init__(self, scenario: Scenario, *, chasing: bool = False) -> None:
        super().__init__(scenario)
        x_min, y_min, x_max, y_max = scenario.bounds_m
        size_px = (480, 640) if y_max - y_min > x_max - x_min else (640, 480)
        self._overview = None if chasing else overview_camera(scenario, *size_px)

    def frame_at(self, trajectory: Trajectory, tick: int) -> Frame:
        """The scenario at a tick of a trajectory; people look the way they have just come."""
        for shown in (max(tick - 1, 0), tick):
            x_m, y_m, yaw_rad = trajectory.robot_pose[shown].tolist()
            self.place_robot((x_m, y_m, yaw_rad))
            self.place_people(trajectory.people_position_m[shown])
        return self.render(self._overview or chase_camera((x_m, y_m, yaw_rad)))
