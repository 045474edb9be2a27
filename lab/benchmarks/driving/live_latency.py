"""Live, how old odometry is when the planner commands, and how soon the guard commands then.

The stand-ins for robots drive to and fro on the stacks of a robot. Times are those at which
publishers wrote (DDS source time), so what measures adds nothing. The age is that of the newest
odometry: one that was taken late shows in commands that are rare. The guard also commands by
itself, at its own rate. On `robot_nav2` the stand-in for Nav2 commands: there the guard alone
is measured.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node

from lab.benchmarks.report import measured_rows, save
from lab.faults.field import MODEL, STACKS, field_of, is_ready, running
from lab.faults.robots import ROBOTS
from serd_cli.processes.stack_run import stack_environment
from serd_ros.endpoints import qos
from serd_sim.errors import SimError

DRIVEN_S, _READY_S = 60.0, 90.0
_KINDS = {"odom": Odometry, "cmd_vel_raw": Twist, "cmd_vel": Twist}


def run() -> None:
    """Drive each robot on each stack for a minute."""
    cases = [{"robot": robot, "stack": stack} for robot in ROBOTS for stack in STACKS]
    save("live_latency", "Latency live, ms", measured_rows("live_latency", cases, measure))


def measure(robot: str, stack: str) -> dict[str, Any]:
    """Quantiles (ms) of a robot on a stack: age of `odom` at `cmd_vel_raw`, that to `cmd_vel`."""
    with tempfile.TemporaryDirectory() as name:
        logs = Path(name)
        with stack_environment(logs) as environment:
            domain = int(environment["ROS_DOMAIN_ID"])
            with (
                running(robot, stack, logs, environment, MODEL, seed=0),
                field_of(f"/{robot}", domain) as field,
            ):
                field.until(lambda: is_ready(logs) and field.measured, _READY_S)
                written = written_times(field.node, f"/{robot}")
                drive = field.goals_to_and_fro()
                field.until(drive, DRIVEN_S)
    if not all(written.values()):
        raise SimError(f"{robot} on {stack} sent nothing; is the machine too busy?")
    odom_s, raw_s, out_s = (np.sort(written[topic]) for topic in _KINDS)
    raw_s = raw_s[(raw_s > odom_s[0]) & (raw_s < out_s[-1])]
    lags_s = {"guard": out_s[np.searchsorted(out_s, raw_s)] - raw_s}
    if stack != "robot_nav2":
        lags_s["odom_age"] = raw_s - odom_s[np.searchsorted(odom_s, raw_s) - 1]
    return {
        f"{part}_{text}": round(float(1000.0 * np.quantile(lag_s, share)), 2)
        for part, lag_s in lags_s.items()
        for text, share in (("median", 0.5), ("95", 0.95), ("max", 1.0))
    }


def written_times(node: Node, namespace: str) -> dict[str, list[float]]:
    """By topic, the times (s) at which its messages were written, from now on."""
    found: dict[str, list[float]] = {topic: [] for topic in _KINDS}

    def follow(topic: str) -> None:
        def take(_: bytes, info: Mapping[str, int]) -> None:
            found[topic].append(1e-9 * info["source_timestamp"])

        node.create_subscription(_KINDS[topic], f"{namespace}/{topic}", take, qos.SENSOR, raw=True)

    for topic in _KINDS:
        follow(topic)
    return found
