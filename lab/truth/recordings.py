"""Recordings of kinds that are not SERD's, written by rosbags under the topics of another robot."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lab.truth.stand_in import Logged, Rover, Way, recorded, walls_of
from serd_core.arrays import FloatArray

_PERSON = (
    "string name\ngeometry_msgs/Point position\ngeometry_msgs/Point velocity\nfloat64 reliability"
    "\nstring[] tagnames\nstring[] tags\n"
)
_ROOM = [(-1.0, -1.5), (7.0, -1.5), (7.0, 4.5), (-1.0, 4.5)]
_TABLE = [(2.0, 0.8), (4.0, 0.8), (4.0, 2.2), (2.0, 2.2)]


@dataclass(frozen=True)
class Kind:
    """A kind of recording. ways: of drives, after a random generator; rooms: rings of walls.

    hz: of poses; clock_s: by which stamps are ahead; held: commands are sent when they change
    alone; robots: namespaces.
    """

    about: str
    ways: Callable[[np.random.Generator], list[Way]]
    rooms: tuple[Any, ...] = (_ROOM, _TABLE)
    fastest_mps: float = 0.5
    hz: int = 10
    clock_s: float = 0.0
    scans: bool = True
    held: bool = False
    person: Callable[[float], FloatArray] | None = None
    robots: tuple[str, ...] = ("/rover",)


def _square(rng: np.random.Generator) -> list[Way]:
    corners = [(0.0, 0.0), (5.5, 0.0), (5.5, 3.5), (0.0, 3.5), (0.0, 0.0)]
    return [[(*_near(corner, rng), 0.0) for corner in corners] for _ in range(3)]


def _there_and_back(n: int, pause_s: float = 1.0) -> Callable[[np.random.Generator], list[Way]]:
    def ways(rng: np.random.Generator) -> list[Way]:
        there = [(0.0, 0.0), (5.5, 0.0), (5.5, 3.5)]
        laps = []
        for _ in range(n):
            out = [(*_near(place, rng), 0.0) for place in there]
            home = [(*place[:2], 0.0) for place in out[::-1][1:]]
            laps.append([*out[:-1], (*out[-1][:2], pause_s), *home[:-1], (*home[-1][:2], pause_s)])
        return laps

    return ways


def _one(rng: np.random.Generator) -> list[Way]:
    return [[(0.0, 0.0, 0.0), (*_near((5.5, 0.0), rng), 0.0), (5.5, 3.5, 0.0)]]


def _near(place: tuple[float, float], rng: np.random.Generator) -> tuple[float, float]:
    x, y = np.array(place) + 0.1 * rng.standard_normal(2)
    return float(x), float(y)


def _walker(time_s: float) -> FloatArray:
    """A person who goes to and fro ahead of the robot."""
    return np.array([2.5 + 2.5 * np.sin(time_s / 9.0), 3.2])


KINDS = {
    "square": Kind("a lone robot that drives a square", _square),
    "laps": Kind("laps to and fro with pauses of 12 s", _there_and_back(8, 12.0)),
    "one": Kind("one drive", _one),
    "two": Kind("two robots", _there_and_back(6, 12.0), robots=("/ant", "/bee")),
    "blind": Kind("no scan", _there_and_back(6, 12.0), scans=False),
    "empty": Kind("an empty room, no return at all", _there_and_back(6, 12.0), rooms=()),
    "follow": Kind("a person is seen", _there_and_back(6, 12.0), person=_walker),
    "held": Kind("teleoperation whose commands hold", _there_and_back(6, 12.0), held=True),
    "clock": Kind("stamps an hour ahead", _there_and_back(6, 12.0), clock_s=3600.0),
    "slow": Kind("poses at 5 Hz", _there_and_back(6, 12.0), hz=5),
}


def place_of(kind: Kind, rng: np.random.Generator) -> Rover:
    """A rover at the begin of the drives of a kind."""
    return Rover(walls_of(*kind.rooms), rng)


def write_recording(kind: Kind, path: Path, seed: int) -> Path:
    """Drive and write the bag."""
    rng = np.random.default_rng(seed)
    logs = {
        name: recorded(place_of(kind, rng), kind.ways(rng), kind.fastest_mps, person=kind.person)
        for name in kind.robots
    }
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        out = _Out(bag, kind)
        for name, log in logs.items():
            out.write(name, log)
    return path


class _Out:
    """Writes the messages of a robot."""

    def __init__(self, bag: Writer, kind: Kind) -> None:
        self._bag, self._kind, self._store = bag, kind, get_typestore(Stores.ROS2_JAZZY)
        own = get_types_from_msg(_PERSON, "people_msgs/msg/Person")
        own |= get_types_from_msg(
            "std_msgs/Header header\npeople_msgs/Person[] people\n", "people_msgs/msg/People"
        )
        self._store.register(own)
        self._made = {name.rsplit("/", 1)[-1]: name for name in self._store.types}

    def _new(self, kind: str, *values: Any) -> Any:
        return self._store.types[self._made[kind]](*values)

    def _header(self, time_s: float, frame: str) -> Any:
        sent_ns = round((time_s + 1e9 + self._kind.clock_s) * 1e9)
        return self._new("Header", self._new("Time", *divmod(sent_ns, 10**9)), frame)

    def write(self, name: str, log: Logged) -> None:
        """All topics of one robot, in the order of time."""
        topics = {
            kind: self._connected(f"{name}/{topic}", kind)
            for kind, topic in (
                ("Odometry", "wheel_odometry"), ("Twist", "base/command"), ("LaserScan", "lidar"),
                ("People", "people"),
            )
        }  # fmt: skip
        before, every = None, max(1, round(10 / self._kind.hz))
        for row, time_s in enumerate(log.time_s):
            messages = {}
            if row % every == 0:
                messages["Odometry"] = self._odometry(time_s, log.odometry[row])
                if self._kind.scans and row % 2 == 0:
                    messages["LaserScan"] = self._scan(time_s, log.scans[row])
                if log.people.shape[1]:
                    messages["People"] = self._people(time_s, log.people, row)
            command = tuple(log.command[row].round(2))
            if not self._kind.held or command != before:
                messages["Twist"] = self._twist(command)
            before = command
            for kind, message in messages.items():
                data = self._store.serialize_cdr(message, self._made[kind])
                self._bag.write(topics[kind], round((1e9 + time_s + 0.01) * 1e9), data)

    def _connected(self, topic: str, kind: str) -> Any:
        return self._bag.add_connection(topic, self._made[kind], typestore=self._store)

    def _twist(self, command: Any) -> Any:
        forward, turn = map(float, command)
        vector = self._new("Vector3", forward, 0.0, 0.0), self._new("Vector3", 0.0, 0.0, turn)
        return self._new("Twist", *vector)

    def _odometry(self, time_s: float, pose: FloatArray) -> Any:
        x, y, yaw = map(float, pose)
        turned = self._new("Quaternion", 0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2))
        placed = self._new("Pose", self._new("Point", x, y, 0.0), turned)
        known = self._new("PoseWithCovariance", placed, np.zeros(36))
        still = self._new("TwistWithCovariance", self._twist((0.0, 0.0)), np.zeros(36))
        return self._new("Odometry", self._header(time_s, "odo"), "rover_base", known, still)

    def _scan(self, time_s: float, ranges: FloatArray) -> Any:
        angles = -np.pi, np.pi, 2 * np.pi / len(ranges)
        limits = 0.05, 8.0, ranges.astype(np.float32), np.zeros(0, np.float32)
        return self._new(
            "LaserScan", self._header(time_s, "rover_base"), *angles, 0.0, 0.1, *limits
        )

    def _people(self, time_s: float, people: FloatArray, row: int) -> Any:
        velocity = 10 * (people[min(row + 1, len(people) - 1)] - people[row])
        rows = np.hstack([people[row], velocity])
        persons = [self._person(str(n), *each) for n, each in enumerate(rows.tolist())]
        return self._new("People", self._header(time_s, "odo"), persons)

    def _person(self, name: str, x: float, y: float, vx: float, vy: float) -> Any:
        place, velocity = self._new("Point", x, y, 0.0), self._new("Point", vx, vy, 0.0)
        return self._new("Person", name, place, velocity, 1.0, [], [])
