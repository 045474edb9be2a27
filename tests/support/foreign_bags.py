"""Bags of robots of other projects: a differential drive that is simulated, in several styles."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serd_bag.writer import BagWriter
from support.bag_messages import Messages
from support.transforms_message import quaternion, transforms_message

START_S = 1_650_000_000.0
STEP_S = 0.02
ODOMETRY = "nav_msgs/msg/Odometry"
TWIST = "geometry_msgs/msg/Twist"
STAMPED = "geometry_msgs/msg/TwistStamped"
TF = "tf2_msgs/msg/TFMessage"


@dataclass(frozen=True)
class Robot:
    """hold_s: how long it follows a command; delay_s: until it begins to."""

    hold_s: float = math.inf
    delay_s: float = 0.1
    acceleration_mps2: float = 1.0

    def drive(self, commands, duration_s):
        """(T, 5) time, x, y, yaw and speed; commands: rows of time, forward and turn."""
        rows, x, y, yaw, speed = [], 0.0, 0.0, 0.0, 0.0
        times_s = np.array([row[0] for row in commands])
        for time_s in np.arange(0.0, duration_s, STEP_S):
            row = int(np.searchsorted(times_s, time_s - self.delay_s, side="right")) - 1
            wanted, turn = 0.0, 0.0
            if row >= 0 and time_s - self.delay_s - times_s[row] <= self.hold_s:
                wanted, turn = commands[row][1:]
            change = self.acceleration_mps2 * STEP_S
            speed += float(np.clip(wanted - speed, -change, change))
            yaw += turn * STEP_S
            x, y = x + speed * math.cos(yaw) * STEP_S, y + speed * math.sin(yaw) * STEP_S
            rows.append((time_s, x, y, yaw, speed))
        return np.array(rows)


def key_presses(rng, n_actions=25):
    """Commands sent on key presses alone, as teleop_twist_keyboard does: one for each action."""
    time_s, commands = 1.0, []
    for _ in range(n_actions):
        forward, turn = [(0.5, 0.0), (0.5, 0.6), (0.5, -0.6), (0.0, 0.0), (-0.3, 0.0)][
            rng.choice(5, p=[0.4, 0.2, 0.2, 0.15, 0.05])
        ]
        commands.append((time_s, forward, turn))
        time_s += rng.uniform(1.0, 4.0)
    return [*commands, (time_s, 0.0, 0.0)]


def held_keys(rng, n_actions=25):
    """Commands repeated at 10 Hz while a key is held, and silence between."""
    time_s, commands = 1.0, []
    for _ in range(n_actions):
        forward, turn = [(0.5, 0.0), (0.4, 0.6), (0.4, -0.6)][rng.integers(3)]
        until_s = time_s + rng.uniform(1.0, 4.0)
        commands += [(each, forward, turn) for each in np.arange(time_s, until_s, 0.1)]
        time_s = until_s + rng.uniform(1.5, 4.0)
    return commands


class ForeignBag:
    """Collects messages of any topics and writes them in the order of time."""

    def __init__(self, messages: Messages) -> None:
        self._messages = messages
        self._rows: list[tuple[float, str, str, bytes]] = []

    def add(self, topic, kind, time_s, data):
        """A message received then."""
        self._rows.append((time_s, topic, kind, data))

    def add_odometry(self, topic, track, *, every=5, ahead_s=0.0, offset_m=0.0):
        """nav_msgs/Odometry of every so many steps of a track."""
        make = self._messages.make
        still = make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = make(
            "geometry_msgs/msg/TwistWithCovariance", make(TWIST, still, still), np.zeros(36)
        )
        for time_s, x, y, yaw, _ in track[::every]:
            point = make("geometry_msgs/msg/Point", x + offset_m, y, 0.0)
            turned = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, *quaternion(yaw))
            pose = make("geometry_msgs/msg/Pose", point, turned)
            pose = make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36))
            header = self._messages.header(START_S + time_s + ahead_s, "odom")
            data = self._messages.encode(make(ODOMETRY, header, "base_link", pose, twist), ODOMETRY)
            self.add(topic, ODOMETRY, time_s + 0.003, data)

    def add_commands(self, topic, commands, *, stamped=False):
        """Twist, or TwistStamped."""
        make = self._messages.make
        for time_s, forward, turn in commands:
            message = make(
                TWIST,
                make("geometry_msgs/msg/Vector3", forward, 0.0, 0.0),
                make("geometry_msgs/msg/Vector3", 0.0, 0.0, turn),
            )
            kind = TWIST
            if stamped:
                kind = STAMPED
                message = make(kind, self._messages.header(START_S + time_s, ""), message)
            self.add(topic, kind, time_s, self._messages.encode(message, kind))

    def add_tf(self, topic, track, parent, child, *, every=5):
        """Transforms of a track."""
        for time_s, x, y, yaw, _ in track[::every]:
            placed = parent, child, (x, y), quaternion(yaw), START_S + time_s
            self.add(topic, TF, time_s + 0.003, transforms_message(placed))

    def add_pose(self, topic, time_s, x, y):
        """A PoseStamped."""
        data = self._messages.pose(START_S + time_s, x, y)
        self.add(topic, "geometry_msgs/msg/PoseStamped", time_s, data)

    def write(self, folder: Path) -> Path:
        """The bag."""
        with BagWriter(folder) as writer:
            for _, topic, kind, _ in self._rows:
                if topic not in writer.topics:
                    writer.add_topic(topic, kind)
            for time_s, topic, _, data in sorted(self._rows, key=lambda row: row[0]):
                writer.write(topic, data, round((START_S + time_s) * 1e9))
        return folder
