"""Movable obstacles as rigid bodies: upright prisms that slide and turn, and doors on hinges.

A body without hinge slides on two prismatic joints and turns on a third. Coulomb friction with the
floor opposes u = (vx, vy, r w), with r the radius of gyration, by m g mu u / |u|, the ellipsoidal
limit surface of Howe & Cutkosky (1996). A door turns by up to a quarter to each side.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from serd_core.arrays import FloatArray
from sim.robot.bullet import GRAVITY_MPS2, BulletClient, add_jointed, pybullet
from sim.robot.people_bodies import CONTACT_FRICTION
from sim.scenario.obstacle import Obstacle, Pose

Motion = tuple[float, float, float]

FLOOR_FRICTION = 0.4
HINGE_TORQUE_NM = 1.0
LARGEST_OPENING_RAD = 0.5 * math.pi
HEIGHT_M = 0.8
#: Below this speed all of the friction holds in each direction.
_RESTS_MPS = 1e-4
_NO_COLLISION = 0


class MovableBodies:
    """The movable obstacles of a scenario in a PyBullet world, in the order of the scenario."""

    def __init__(
        self,
        client: BulletClient,
        obstacles: Sequence[Obstacle],
        *,
        walls: Iterable[int],
        floor: int,
    ) -> None:
        self._client, self._obstacles = client, obstacles
        fixed = tuple(walls)
        self._bodies = [
            self._add(each, (floor, *fixed) if each.hinge_m else (floor,)) for each in obstacles
        ]

    def brake(self) -> None:
        """Set the friction with the floor for the next substep."""
        for obstacle, body in zip(self._obstacles, self._bodies, strict=True):
            if obstacle.hinge_m is None:
                self._set_floor_friction(obstacle, body)

    def stop_doors(self) -> None:
        """Keep doors within the largest opening."""
        for obstacle, body in zip(self._obstacles, self._bodies, strict=True):
            if obstacle.hinge_m is not None:
                angle_rad = self._client.getJointState(body, 0)[0]
                if abs(angle_rad) > LARGEST_OPENING_RAD:
                    widest = math.copysign(LARGEST_OPENING_RAD, angle_rad)
                    self._client.resetJointState(body, 0, widest, 0.0)

    @property
    def poses(self) -> tuple[Pose, ...]:
        """Where the obstacles are."""
        moved = zip(self._obstacles, self._joints(0), strict=True)
        return tuple((o.pose[0] + dx, o.pose[1] + dy, yaw) for o, (dx, dy, yaw) in moved)

    @property
    def motions(self) -> tuple[Motion, ...]:
        """(vx_mps, vy_mps, yaw rate_radps) of the obstacles at their poses."""
        return tuple(self._joints(1))

    def number_of(self, body: int) -> int | None:
        """The place of a body of PyBullet among the obstacles, None for another body."""
        return self._bodies.index(body) if body in self._bodies else None

    def _joints(self, which: int) -> Iterator[Motion]:
        """Positions (0) or velocities (1) along x and y, and of the turn, of each body."""
        for body in self._bodies:
            *along, turn = (state[which] for state in self._states(body))
            x, y = along or (0.0, 0.0)
            yield x, y, turn

    def _states(self, body: int) -> list[tuple[float, ...]]:
        joints = range(self._client.getNumJoints(body))
        states: list[tuple[float, ...]] = self._client.getJointStates(body, joints)
        return states

    def _add(self, obstacle: Obstacle, apart_from: tuple[int, ...]) -> int:
        assert obstacle.mass_kg is not None
        joints = ("x", "y", "yaw") if obstacle.hinge_m is None else ("yaw",)
        x_m, y_m = np.subtract(obstacle.centroid_m, obstacle.pose[:2]).tolist()
        body = add_jointed(
            self._client,
            joints,
            (*obstacle.pose[:2], 0.0),
            prism(self._client, obstacle.corners_m, HEIGHT_M),
            obstacle.mass_kg,
            (x_m, y_m, 0.5 * HEIGHT_M),
        )
        inertia = obstacle.mass_kg * obstacle.gyration_radius_m**2
        self._client.changeDynamics(
            body,
            len(joints) - 1,
            localInertiaDiagonal=(inertia, inertia, inertia),
            lateralFriction=CONTACT_FRICTION,
            restitution=0.0,
        )
        for joint in range(len(joints)):
            self._hold(body, joint, HINGE_TORQUE_NM)
        for other in apart_from:
            self._client.setCollisionFilterPair(other, body, -1, len(joints) - 1, _NO_COLLISION)
        return body

    def _set_floor_friction(self, obstacle: Obstacle, body: int) -> None:
        assert obstacle.mass_kg is not None
        radius_m = obstacle.gyration_radius_m
        force_n = FLOOR_FRICTION * obstacle.mass_kg * GRAVITY_MPS2
        vx, vy, yaw_rate = (state[1] for state in self._states(body))
        slip = (vx, vy, radius_m * yaw_rate)
        speed = math.hypot(*slip)
        for joint, most in enumerate((force_n, force_n, radius_m * force_n)):
            share = abs(slip[joint]) / speed if speed > _RESTS_MPS else 1.0
            self._hold(body, joint, share * most)

    def _hold(self, body: int, joint: int, most: float) -> None:
        """Brake a joint with up to a force (N) or a torque (N m)."""
        self._client.setJointMotorControl2(
            body, joint, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=most
        )


def prism(client: BulletClient, corners_m: FloatArray, height_m: float) -> int:
    """Collision shape of the upright prism over a convex outline (n, 2), from the floor up."""
    corners = corners_m.tolist()
    vertices = [(x_m, y_m, z_m) for z_m in (0.0, height_m) for x_m, y_m in corners]
    shape: int = client.createCollisionShape(pybullet.GEOM_MESH, vertices=vertices)
    return shape
