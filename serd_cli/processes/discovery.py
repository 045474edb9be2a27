"""What runs in a ROS domain, as other processes see it: whether two meet, and what a lidar sends.

`python -m serd_cli.processes.discovery talk` publishes until it is ended, `listen` ends with 0 at
the first message and with 1 after LONGEST_S, and `scans` prints as JSON what the scans of a few
seconds mean by 0.
"""

import json
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any

TOPIC, LONGEST_S = "serd_doctor", 30.0
_PERIOD_S = 0.05
_SCANS_S, _ENOUGH_SCANS = 2.0, 10
_LONGEST_END_S = 5.0


def processes_discover_each_other(environment: Mapping[str, str]) -> bool:
    """Whether a message of one process reaches another."""
    words = [sys.executable, "-m", "serd_cli.processes.discovery"]
    talker, listener = (
        subprocess.Popen(
            [*words, role],
            env=dict(environment),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for role in ("talk", "listen")
    )
    with talker, listener:
        try:
            return listener.wait() == 0
        finally:
            for each in (talker, listener):
                _end(each)


@dataclass(frozen=True)
class LidarReport:
    """n_scans that were received; zero_share of their ranges are 0, which seems to mean `zero`."""

    n_scans: int
    zero_share: float = 0.0
    zero: str | None = None


def lidar_report(environment: Mapping[str, str]) -> LidarReport:
    """What the scans of the topic `scan` show now."""
    words = [sys.executable, "-m", "serd_cli.processes.discovery", "scans"]
    done = subprocess.run(words, env=dict(environment), capture_output=True, text=True, check=False)
    lines = done.stdout.splitlines()
    return LidarReport(**json.loads(lines[-1])) if lines else LidarReport(0)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process so that DDS frees its shared memory; kill it only when it does not end."""
    process.terminate()
    try:
        process.wait(_LONGEST_END_S)
    except subprocess.TimeoutExpired:
        process.kill()


def _look_at_scans(node: Any) -> None:
    """Print what the scans of `_SCANS_S` are, if there is a publisher."""
    import rclpy
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import LaserScan

    from serd_ros.convert.sensors import from_scan, scan_geometry_of
    from serd_ros.errors import MessageError
    from serd_sim.safety.scan import Scan
    from serd_sim.safety.zero_ranges import ZeroRanges

    zeros, n_scans = ZeroRanges(), 0

    def take(message: Any) -> None:
        nonlocal n_scans
        with suppress(MessageError):
            time_ns, ranges_m = from_scan(message, frame="")
            zeros.take(Scan(time_ns * 1e-9, ranges_m, scan_geometry_of(message)))
            n_scans += 1

    node.create_subscription(LaserScan, "scan", take, qos_profile_sensor_data)
    until_s = time.monotonic() + _SCANS_S
    while time.monotonic() < until_s and n_scans < _ENOUGH_SCANS:
        rclpy.spin_once(node, timeout_sec=_PERIOD_S)
    print(json.dumps(asdict(LidarReport(n_scans, zeros.share, zeros.seems_to_be))))


def main(role: str) -> int:
    """Entry point of each process."""
    import rclpy
    from std_msgs.msg import Empty

    rclpy.init()
    node = rclpy.create_node(f"serd_doctor_{role}")
    if role == "scans":
        _look_at_scans(node)
        return 0
    if role == "talk":
        publisher = node.create_publisher(Empty, TOPIC, 1)
        while rclpy.ok():
            publisher.publish(Empty())
            time.sleep(_PERIOD_S)
        return 0
    heard: list[Empty] = []
    node.create_subscription(Empty, TOPIC, heard.append, 1)
    until_s = time.monotonic() + LONGEST_S
    while not heard and time.monotonic() < until_s:
        rclpy.spin_once(node, timeout_sec=_PERIOD_S)
    return 0 if heard else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
