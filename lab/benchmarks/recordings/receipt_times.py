"""Log times of a recorder process against the wall clock at publishing, where stamps are wrong.

Poses are published at 100 Hz on each of five topics: stamps an hour ahead, an hour behind, running
backwards, none, and right ones. The demo_recorder node records them as a process of its own. Busy:
while four processes per core compute.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped

from lab.benchmarks.faults.kill_matrix import place
from lab.benchmarks.report import Row, save
from serd_bag.reader import BagReader
from serd_cli.processes.node_commands import node_command
from serd_ros.endpoints import qos

_HOUR_NS = 3_600_000_000_000
#: Stamps by topic, from the wall clock and the number of the message.
_STAMPS: dict[str, Callable[[int, int], int]] = {
    "/ahead": lambda now_ns, _: now_ns + _HOUR_NS,
    "/behind": lambda now_ns, _: now_ns - _HOUR_NS,
    "/backwards": lambda now_ns, number: now_ns - number * 20_000_000,
    "/unset": lambda _, __: 0,
    "/right": lambda now_ns, _: now_ns,
}
_RATE_HZ, _N_ROUNDS = 100, 3000
_BUSY_PER_CORE = 4


def run() -> None:
    """Measure on the machine as it is, and while it is busy."""
    rows = []
    for name, n_busy in (("as it is", 0), ("busy", _BUSY_PER_CORE * (os.cpu_count() or 1))):
        with _busy(n_busy):
            late_ms = measured_ms()
        rows.append(_row(name, late_ms))
    save("receipt_times", "Log time after the wall clock at publishing, stamps wrong", rows)


def _row(name: str, late_ms: np.ndarray) -> Row:
    median, most_of, most = np.quantile(late_ms, (0.5, 0.99, 1.0))
    return {
        "machine": name,
        "messages": len(late_ms),
        "median (ms)": round(float(median), 2),
        "99 % (ms)": round(float(most_of), 2),
        "most (ms)": round(float(most), 2),
        "within 5 ms": f"{100 * np.mean(late_ms <= 5.0):.1f} %",
    }


def measured_ms() -> np.ndarray:
    """(M,) log time of each message less the wall clock before it was published."""
    with place() as (environment, folder):
        bag = folder / "bag"
        given = {
            "output": str(bag),
            "topics": [f"{name}:geometry_msgs/msg/PoseStamped" for name in _STAMPS],
        }
        recorder = subprocess.Popen(
            node_command("demo_recorder", given, {}, environment), env=environment
        )
        with ExitStack() as stack:
            stack.callback(recorder.wait)
            stack.callback(recorder.send_signal, signal.SIGINT)
            sent_ns = _published_ns(int(environment["ROS_DOMAIN_ID"]))
        messages = BagReader(bag).messages()
        return np.array(
            [
                1e-6 * (each.log_time_ns - sent_ns[each.topic, _number(each.data)])
                for each in messages
            ]
        )


def _published_ns(domain: int) -> dict[tuple[str, int], int]:
    """Wall clock before the publishing of each message, by topic and number."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("source", context=context)
    publishers = {name: node.create_publisher(PoseStamped, name, qos.STATE) for name in _STAMPS}
    while not all(each.get_subscription_count() for each in publishers.values()):
        time.sleep(0.05)
    sent_ns = {}
    next_s = time.monotonic()
    for number in range(_N_ROUNDS):
        next_s += 1 / _RATE_HZ
        time.sleep(max(0.0, next_s - time.monotonic()))
        for name, publisher in publishers.items():
            message = PoseStamped()
            message.header.frame_id = f"{number:08}"
            stamp_ns = _STAMPS[name](time.time_ns(), number)
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
            sent_ns[name, number] = time.time_ns()
            publisher.publish(message)
    time.sleep(1.0)
    node.destroy_node()
    rclpy.shutdown(context=context)
    return sent_ns


def _number(data: bytes) -> int:
    """From the frame, behind the CDR head, the stamp and the length of the text."""
    return int(data[16:24])


@contextmanager
def _busy(count: int) -> Iterator[None]:
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for each in processes:
            each.kill()
            each.wait()
