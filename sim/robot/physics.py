"""The kinematic robot in PyBullet: a cylinder that has the velocity it is set to.

Nothing touches it. `robot` keeps it out of the walls.
"""

from sim.robot.bullet import pybullet
from sim.scenario.scenario import Scenario


class Physics:
    """One PyBullet world of its own; several can live side by side in one process."""

    def __init__(self, scenario: Scenario) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._height_m = 0.5 * scenario.robot.height_m
        pybullet.setGravity(0, 0, 0, physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=scenario.control_period_s, numSubSteps=0, physicsClientId=self._client
        )
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER,
            radius=scenario.robot.radius_m,
            height=scenario.robot.height_m,
            physicsClientId=self._client,
        )
        self._robot: int = pybullet.createMultiBody(
            20.0, shape, -1, (0, 0, self._height_m), physicsClientId=self._client
        )
        pybullet.changeDynamics(
            self._robot,
            -1,
            lateralFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            restitution=0.0,
            localInertiaDiagonal=(0.0, 0.0, 1.0),
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self._client,
        )

    def place_robot(self, x_m: float, y_m: float, half_turn: tuple[float, float]) -> None:
        """Put the robot somewhere; half_turn: (z, w) of its orientation quaternion."""
        pybullet.resetBasePositionAndOrientation(
            self._robot, (x_m, y_m, self._height_m), (0.0, 0.0, *half_turn), self._client
        )

    def move_robot(self, velocity_mps: tuple[float, float], yaw_rate_radps: float) -> None:
        """Advance by one control period with the given velocity of the robot."""
        pybullet.resetBaseVelocity(
            self._robot, (*velocity_mps, 0.0), (0.0, 0.0, yaw_rate_radps), self._client
        )
        pybullet.stepSimulation(self._client)

    def robot_place(self) -> tuple[float, float, tuple[float, float]]:
        """(x_m, y_m, (z, w)) of the robot, as `place_robot` takes it."""
        (x_m, y_m, _), (_, _, z, w) = pybullet.getBasePositionAndOrientation(
            self._robot, self._client
        )
        return x_m, y_m, (z, w)

    def close(self) -> None:
        """Leave PyBullet; a second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1
