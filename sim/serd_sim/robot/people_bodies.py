"""People whom the robot can touch, as rigid bodies.

A person is an upright capsule on two prismatic joints without motors: it keeps its velocity unless
the robot pushes it, and it pushes the robot. Walls and other people act on people in the crowd's
model alone. There are as many capsules as people were near at once.
"""

from collections.abc import Iterable, Mapping

from serd_core.arrays import FloatArray
from serd_sim.robot.bullet import BulletClient, add_sliding, pybullet

Velocity = tuple[float, float]
#: Position and velocity.
Moving = tuple[tuple[float, float], Velocity]

MOST_NEAR = 12
#: Mean of adults.
PERSON_MASS_KG = 75.0
_CONTACT_FRICTION = 0.3
#: People who are this close to the robot's surface at the start of a control period of 0.05 s may
#: touch it; the distance grows with the period.
_REACH_M, _REACH_PERIOD_S = 0.3, 0.05
#: The capsule reaches below the floor, so that its side is a cylinder down to the floor.
_SIDE_M = 1.5
_OUT_OF_THE_WAY_M = 1000.0
_NO_COLLISION = 0


def near_people(
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

    def __init__(self, client: BulletClient, radius_m: float, *, apart_from: Iterable[int]) -> None:
        self._client, self._apart_from = client, tuple(apart_from)
        #: The person in each capsule that is in use.
        self._near: dict[int, int] = {}
        self._bodies: list[int] = []
        self._capsule: int = client.createCollisionShape(
            pybullet.GEOM_CAPSULE, radius=radius_m, height=_SIDE_M
        )

    def place(self, people: Mapping[int, Moving]) -> None:
        """Move people into capsules; one who is still near keeps the capsule."""
        for slot in [slot for slot, person in self._near.items() if person not in people]:
            del self._near[slot]
            self._set(slot, (_OUT_OF_THE_WAY_M, 3.0 * slot), (0.0, 0.0))
        placed = {person: slot for slot, person in self._near.items()}
        for person, (place_m, velocity_mps) in people.items():
            slot = placed[person] if person in placed else self._free_slot()
            self._near[slot] = person
            self._set(slot, place_m, velocity_mps)

    def motion(self, person: int) -> Moving:
        """Position and velocity of a person who is near."""
        slot = next(slot for slot, each in self._near.items() if each == person)
        (x_m, vx_mps, *_), (y_m, vy_mps, *_) = self._client.getJointStates(
            self._bodies[slot], (0, 1)
        )
        return (x_m, y_m), (vx_mps, vy_mps)

    def person_in(self, body: int) -> int:
        """The person in a capsule, by the number of its body."""
        return self._near[self._bodies.index(body)]

    def _free_slot(self) -> int:
        """A capsule that no person is in, a new one where there is none."""
        for slot in range(len(self._bodies)):
            if slot not in self._near:
                return slot
        base_m = (0.0, 0.0, 0.5 * _SIDE_M)
        body = add_sliding(self._client, base_m, self._capsule, PERSON_MASS_KG)
        for joint in (0, 1):
            self._client.setJointMotorControl2(body, joint, pybullet.VELOCITY_CONTROL, force=0.0)
        self._client.changeDynamics(body, 1, lateralFriction=_CONTACT_FRICTION, restitution=0.0)
        for other in self._apart_from:
            self._client.setCollisionFilterPair(body, other, 1, -1, _NO_COLLISION)
        for other in self._bodies:
            self._client.setCollisionFilterPair(body, other, 1, 1, _NO_COLLISION)
        self._bodies.append(body)
        return len(self._bodies) - 1

    def _set(self, slot: int, place_m: Velocity, velocity_mps: Velocity) -> None:
        for joint in (0, 1):
            self._client.resetJointState(
                self._bodies[slot], joint, place_m[joint], velocity_mps[joint]
            )


def _pair(row: FloatArray) -> Velocity:
    return float(row[0]), float(row[1])
