"""Bags of robots of other projects: a differential drive that is simulated, in several styles."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from support.bag_messages import STAMPED, TF, TWIST, Messages, write_bag

START_S = 1_650_000_000.0
STEP_S = 0.02
ODOMETRY = "nav_msgs/msg/Odometry"


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
        for time_s, x, y, yaw, _ in track[::every]:
            place, turn = (
                {"x": x + offset_m, "y": y},
                {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)},
            )
            data = self._messages.filled(
                ODOMETRY,
                header=self._messages.header(START_S + time_s + ahead_s, "odom"),
                child_frame_id="base_link",
                pose={"pose": {"position": place, "orientation": turn}},
            )
            self.add(topic, ODOMETRY, time_s + 0.003, data)

    def add_commands(self, topic, commands, *, stamped=False):
        """Twist, or TwistStamped."""
        for time_s, forward, turn in commands:
            stamp_s = START_S + time_s if stamped else None
            data = self._messages.twist(forward, turn, stamp_s)
            self.add(topic, STAMPED if stamped else TWIST, time_s, data)

    def add_tf(self, topic, track, parent, child, *, every=5):
        """Transforms of a track."""
        for time_s, x, y, yaw, _ in track[::every]:
            data = self._messages.transform(START_S + time_s, parent, child, x, y, yaw)
            self.add(topic, TF, time_s + 0.003, data)

    def add_pose(self, topic, time_s, x, y):
        """A PoseStamped."""
        data = self._messages.pose(START_S + time_s, x, y)
        self.add(topic, "geometry_msgs/msg/PoseStamped", time_s, data)

    def write(self, folder: Path) -> Path:
        """The bag."""
        topics = {topic: kind for _, topic, kind, _ in self._rows}
        rows = sorted(self._rows, key=lambda row: row[0])
        return write_bag(folder, topics, ((row[1], START_S + row[0], row[3]) for row in rows))
