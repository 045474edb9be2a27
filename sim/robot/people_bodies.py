"""People whom the robot or a movable obstacle can touch, as rigid bodies.

A person is an upright capsule on two prismatic joints without motors: it keeps its velocity unless
the robot or an obstacle pushes it, and it pushes them. Walls and other people act on people in the
crowd's model alone. There are as many capsules as people were near at once.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from serd_core.arrays import FloatArray
from sim.robot.bullet import let_move_freely, pybullet

Velocity = tuple[float, float]
#: Position and velocity.
Moving = tuple[tuple[float, float], Velocity]

MOST_NEAR = 12
#: Mean of adults.
PERSON_MASS_KG = 75.0
CONTACT_FRICTION = 0.3
#: People who are this close to the robot's surface at the start of a control period of 0.05 s may
#: touch it; the distance grows with the period.
_REACH_M, _REACH_PERIOD_S = 0.3, 0.05
#: The capsule reaches below the floor, so that its side is a cylinder down to the floor.
_SIDE_M = 1.5
_OUT_OF_THE_WAY_M = 1000.0
_NO_COLLISION = 0
#: Of the link between the joints.
CARRIAGE_KG = 1e-3


def near_people(
    robot_m: tuple[float, float],
    reach_m: float,
    period_s: float,
    positions_m: FloatArray,
    velocities_mps: FloatArray,
) -> dict[int, Moving]:
    """Those of the (N, 2) people who may touch the robot in the next control period.

    reach_m: sum of the radii of robot and person; period_s: of control.
    """
    away = np.hypot(positions_m[:, 0] - robot_m[0], positions_m[:, 1] - robot_m[1])
    return nearest_moving(away, reach_m, period_s, positions_m, velocities_mps)


def nearest_moving(
    away: FloatArray,
    reach_m: float,
    period_s: float,
    positions_m: FloatArray,
    velocities_mps: FloatArray,
) -> dict[int, Moving]:
    """Those of the (N, 2) people who may touch a body in the next control period.

    away: (N,) distances to it, of which those up to reach_m are contacts.
    """
    reach_m += _REACH_M * (period_s / _REACH_PERIOD_S)
    near = (away < reach_m).nonzero()[0]
    nearest = near[away[near].argsort(kind="stable")][:MOST_NEAR].tolist()
    return {
        person: (_pair(positions_m[person]), _pair(velocities_mps[person])) for person in nearest
    }


class PeopleBodies:
    """Capsules in a PyBullet world, none of which touches the bodies of `apart_from`."""

    def __init__(self, client: int, radius_m: float, *, apart_from: Iterable[int]) -> None:
        self._client, self._apart_from = client, tuple(apart_from)
        #: The person in each capsule that is in use.
        self._near: dict[int, int] = {}
        self._bodies: list[int] = []
        self._capsule: int = pybullet.createCollisionShape(
            pybullet.GEOM_CAPSULE, radius=radius_m, height=_SIDE_M, physicsClientId=client
        )

    def place(self, people: Mapping[int, Moving]) -> None:
        """Move people into capsules; one who is still near keeps the capsule."""
        for slot in [slot for slot, person in self._near.items() if person not in people]:
            del self._near[slot]
            self._set(slot, _aside(slot), (0.0, 0.0))
        placed = {person: slot for slot, person in self._near.items()}
        for person, (place_m, velocity_mps) in people.items():
            slot = placed[person] if person in placed else self._free_slot()
            self._near[slot] = person
            self._set(slot, place_m, velocity_mps)

    def motion(self, person: int) -> Moving:
        """Position and velocity of a person who is near."""
        slot = next(slot for slot, each in self._near.items() if each == person)
        states = pybullet.getJointStates(self._bodies[slot], (0, 1), self._client)
        (x_m, vx_mps, *_), (y_m, vy_mps, *_) = states
        return (x_m, y_m), (vx_mps, vy_mps)

    def person_in(self, body: int) -> int:
        """The person in a capsule, by the number of its body."""
        return self._near[self._bodies.index(body)]

    def _free_slot(self) -> int:
        """A capsule that no person is in, a new one where there is none."""
        for slot in range(len(self._bodies)):
            if slot not in self._near:
                return slot
        body = self._add()
        for other in self._apart_from:
            self._separate(body, other, -1)
        for other in self._bodies:
            self._separate(body, other, 1)
        self._bodies.append(body)
        return len(self._bodies) - 1

    def _add(self) -> int:
        here, level = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        body: int = pybullet.createMultiBody(
            0.0,
            basePosition=(0.0, 0.0, 0.5 * _SIDE_M),
            linkMasses=(CARRIAGE_KG, PERSON_MASS_KG),
            linkCollisionShapeIndices=(-1, self._capsule),
            linkVisualShapeIndices=(-1, -1),
            linkPositions=(here, here),
            linkOrientations=(level, level),
            linkInertialFramePositions=(here, here),
            linkInertialFrameOrientations=(level, level),
            linkParentIndices=(0, 1),
            linkJointTypes=(pybullet.JOINT_PRISMATIC, pybullet.JOINT_PRISMATIC),
            linkJointAxis=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
            physicsClientId=self._client,
        )
        for joint in (0, 1):
            pybullet.setJointMotorControl2(
                body, joint, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=self._client
            )
            pybullet.changeDynamics(
                body,
                joint,
                lateralFriction=CONTACT_FRICTION,
                restitution=0.0,
                physicsClientId=self._client,
            )
        let_move_freely(self._client, body)
        return body

    def _separate(self, person: int, other: int, link: int) -> None:
        pybullet.setCollisionFilterPair(
            person, other, 1, link, _NO_COLLISION, physicsClientId=self._client
        )

    def _set(self, slot: int, place_m: Velocity, velocity_mps: Velocity) -> None:
        for joint in (0, 1):
            pybullet.resetJointState(
                self._bodies[slot], joint, place_m[joint], velocity_mps[joint], self._client
            )


def _aside(slot: int) -> Velocity:
    """Where a capsule is that no person is in."""
    return _OUT_OF_THE_WAY_M, 3.0 * slot


def _pair(row: FloatArray) -> Velocity:
    return float(row[0]), float(row[1])
