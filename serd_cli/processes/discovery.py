"""Whether two processes meet in a ROS domain.

`python -m serd_cli.processes.discovery talk` publishes until it is ended; `listen` ends with 0 at
the first message, and with 1 after LONGEST_S.
"""

import subprocess
import sys
import time
from collections.abc import Mapping

TOPIC, LONGEST_S = "serd_doctor", 30.0
_PERIOD_S = 0.05
_LONGEST_END_S = 5.0


def processes_discover_each_other(environment: Mapping[str, str]) -> bool:
    """Whether a message of one process reaches another."""
    words, quiet = [sys.executable, "-m", "serd_cli.processes.discovery"], subprocess.DEVNULL
    talker, listener = (
        subprocess.Popen([*words, role], env=dict(environment), stdout=quiet, stderr=quiet)
        for role in ("talk", "listen")
    )
    with talker, listener:
        try:
            return listener.wait() == 0
        finally:
            for process in (talker, listener):  # ended, not killed: DDS frees its shared memory
                process.terminate()
                try:
                    process.wait(_LONGEST_END_S)
                except subprocess.TimeoutExpired:
                    process.kill()


def main(role: str) -> int:
    """Entry point of each process."""
    import rclpy
    from std_msgs.msg import Empty

    rclpy.init()
    node = rclpy.create_node(f"serd_doctor_{role}")
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
