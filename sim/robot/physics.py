"""The PyBullet side of the world: walls, a cylinder that is the robot, capsules that are people.

The robot is driven by setting its velocity each step (an explicit unicycle) and Bullet integrates
it. Bullet's own collision response is off: its contacts carry hidden state from step to step, which
a snapshot could not hold; `robot` keeps the robot out of the walls. People are moved by the crowd;
Bullet gets their positions for ray tests and pictures only, when one is made.
"""

import os
import sys

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from sim.errors import SimError
from sim.pictures.camera import Camera, as_frame, overview_camera
from sim.robot.bullet import add_wall, pybullet
from sim.scenario.scenario import Scenario
from sim.scenario.settings import RobotSettings

_PERSON_HEIGHT_M = 1.75
_NO_COLLISION = 0
_WALL_COLOUR = (0.75, 0.73, 0.7, 1.0)
_FLOOR_COLOUR = (0.93, 0.92, 0.89, 1.0)
_ROBOT_COLOUR = (0.15, 0.35, 0.75, 1.0)
_PERSON_COLOUR = (0.91, 0.59, 0.28, 1.0)


class Physics:
    """One PyBullet world of its own; several can live side by side in one process."""

    def __init__(self, scenario: Scenario, person_radius_m: float, *, gui: bool = False) -> None:
        if gui:
            _require_display()
        self.client = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        self._robot_height_m = scenario.robot.height_m
        pybullet.setGravity(0, 0, 0, physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=scenario.control_period_s,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )
        if gui:
            self._show(pybullet.COV_ENABLE_GUI, False)
            self._show(pybullet.COV_ENABLE_SHADOWS, False)
            # Drawn after each body that is added, the window takes minutes to open without a GPU.
            self._show(pybullet.COV_ENABLE_RENDERING, False)
        self._robot = self._add_robot(scenario.robot)
        for start, end in scenario.wall_segments_m:
            self._add_wall(start, end)
        self._add_floor(scenario.bounds_m)
        self._people = self._add_people(scenario.pedestrians.count, person_radius_m)
        if gui:
            self._look_at(overview_camera(scenario))
            self._show(pybullet.COV_ENABLE_RENDERING, True)

    def place_robot(self, x_m: float, y_m: float, half_turn: tuple[float, float]) -> None:
        """Put the robot somewhere; half_turn: (z, w) of its orientation quaternion."""
        place = (x_m, y_m, 0.5 * self._robot_height_m)
        pybullet.resetBasePositionAndOrientation(
            self._robot, place, (0.0, 0.0, *half_turn), self.client
        )

    def move_robot(self, velocity_mps: tuple[float, float], yaw_rate_radps: float) -> None:
        """Advance by one control period with the given velocity of the robot."""
        pybullet.resetBaseVelocity(
            self._robot, (*velocity_mps, 0.0), (0.0, 0.0, yaw_rate_radps), self.client
        )
        pybullet.stepSimulation(self.client)

    def robot_place(self) -> tuple[float, float, tuple[float, float]]:
        """(x_m, y_m, (z, w)) of the robot, as `place_robot` takes it."""
        (x_m, y_m, _), (_, _, z, w) = pybullet.getBasePositionAndOrientation(
            self._robot, self.client
        )
        return x_m, y_m, (z, w)

    def place_people(self, x_m: FloatArray, y_m: FloatArray) -> None:
        """Put the capsules where the people are."""
        upright = (0.0, 0.0, 0.0, 1.0)
        for body, x, y in zip(self._people, x_m.tolist(), y_m.tolist(), strict=True):
            pybullet.resetBasePositionAndOrientation(
                body, (x, y, 0.5 * _PERSON_HEIGHT_M), upright, self.client
            )

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """(height, width, 3) picture by PyBullet's software renderer."""
        view = pybullet.computeViewMatrixFromYawPitchRoll(
            camera.target_m, camera.distance_m, camera.yaw_deg, camera.pitch_deg, 0.0, 2
        )
        ratio = camera.width_px / camera.height_px
        projection = pybullet.computeProjectionMatrixFOV(
            camera.field_of_view_deg, ratio, 0.1, 10.0 * camera.distance_m
        )
        image = pybullet.getCameraImage(
            camera.width_px,
            camera.height_px,
            view,
            projection,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )
        return as_frame(image[2], camera)

    def close(self) -> None:
        """Leave PyBullet; a second call does nothing."""
        if self.client >= 0:
            pybullet.disconnect(self.client)
            self.client = -1

    def _show(self, what: int, on: bool) -> None:
        """Switch a part of the window on or off."""
        pybullet.configureDebugVisualizer(what, int(on), physicsClientId=self.client)

    def _look_at(self, camera: Camera) -> None:
        pybullet.resetDebugVisualizerCamera(
            0.6 * camera.distance_m,  # the window sees more at a time than the pictures
            camera.yaw_deg,
            camera.pitch_deg,
            camera.target_m,
            physicsClientId=self.client,
        )

    def _add_floor(self, bounds_m: tuple[float, float, float, float]) -> None:
        """A plate to look at; nothing touches it and rays pass above it."""
        x_min, y_min, x_max, y_max = bounds_m
        shape = pybullet.createVisualShape(
            pybullet.GEOM_BOX,
            halfExtents=(0.5 * (x_max - x_min) + 1.0, 0.5 * (y_max - y_min) + 1.0, 0.01),
            rgbaColor=_FLOOR_COLOUR,
            physicsClientId=self.client,
        )
        middle = (0.5 * (x_min + x_max), 0.5 * (y_min + y_max), -0.02)
        pybullet.createMultiBody(0.0, -1, shape, middle, physicsClientId=self.client)

    def _ignore_contacts_with_robot(self, body: int) -> None:
        pybullet.setCollisionFilterPair(
            body, self._robot, -1, -1, _NO_COLLISION, physicsClientId=self.client
        )

    def _add_wall(self, start: FloatArray, end: FloatArray) -> None:
        wall = add_wall(self.client, start, end)
        pybullet.changeVisualShape(wall, -1, rgbaColor=_WALL_COLOUR, physicsClientId=self.client)
        self._ignore_contacts_with_robot(wall)

    def _add_fixed_body(
        self,
        shape: int,
        position: tuple[float, float, float],
        orientation: tuple[float, float, float, float],
        colour: tuple[float, float, float, float],
    ) -> int:
        body: int = pybullet.createMultiBody(
            0.0, shape, -1, position, orientation, physicsClientId=self.client
        )
        pybullet.changeVisualShape(body, -1, rgbaColor=colour, physicsClientId=self.client)
        self._ignore_contacts_with_robot(body)
        return body

    def _add_robot(self, robot: RobotSettings) -> int:
        """A cylinder that cannot tip over and loses no speed by itself."""
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER,
            radius=robot.radius_m,
            height=robot.height_m,
            physicsClientId=self.client,
        )
        body: int = pybullet.createMultiBody(
            20.0, shape, -1, (0, 0, 0.5 * robot.height_m), physicsClientId=self.client
        )
        pybullet.changeVisualShape(body, -1, rgbaColor=_ROBOT_COLOUR, physicsClientId=self.client)
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            restitution=0.0,
            localInertiaDiagonal=(0.0, 0.0, 1.0),
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self.client,
        )
        return body

    def _add_people(self, count: int, radius_m: float) -> list[int]:
        if not count:
            return []
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_CAPSULE,
            radius=radius_m,
            height=_PERSON_HEIGHT_M - 2.0 * radius_m,
            physicsClientId=self.client,
        )
        bodies = []
        for number in range(count):
            place = (-10.0 - number, -10.0, 0.5 * _PERSON_HEIGHT_M)
            body = self._add_fixed_body(shape, place, (0.0, 0.0, 0.0, 1.0), _PERSON_COLOUR)
            bodies.append(body)
        return bodies


def _require_display() -> None:
    """SimError without a display, where PyBullet would end the process."""
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        raise SimError(
            "gui must be off where there is no display, but the variable DISPLAY is not set"
            "; run with gui:=false or under xvfb-run"
        )
