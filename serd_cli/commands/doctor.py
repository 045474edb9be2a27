"""serd doctor

Nothing is changed. Exit code 1 where something that the main job needs fails.
"""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import typer

from serd_bag.recorder import RecorderSettings
from serd_cli.errors import FAILED
from serd_cli.options import AsJson
from serd_cli.output.terminal import console, facts_table, print_json
from serd_cli.processes.workspace import ros_environment

_LEAST_FREE_BYTES = 1_000_000_000


class Check(NamedTuple):
    """One finding; fix: the command that mends it, empty where it works."""

    subject: str
    finding: str
    fix: str = ""

    @property
    def state(self) -> str:
        """Whether it works."""
        return "fails" if self.fix else "works"


def all_checks(environment: Mapping[str, str], folder: Path) -> list[Check]:
    """Every check, for commands that write into the folder."""
    ros = ros_environment(environment)
    return [ros_client(ros), discovery(ros), disk(folder)]


def ros_client(environment: Mapping[str, str]) -> Check:
    """Rclpy can be imported and started."""
    words = [sys.executable, "-c", "import rclpy; rclpy.init(); rclpy.shutdown()"]
    done = subprocess.run(words, env=dict(environment), capture_output=True, text=True, check=False)
    if done.returncode == 0:
        distribution = environment.get("ROS_DISTRO", "ROS wheels of this environment")
        return Check("rclpy", distribution)
    reason = (done.stderr.strip().splitlines() or ["ended without a message"])[-1]
    foreign = environment.get("ROS_DISTRO", "jazzy") != "jazzy"
    fix = "open a shell without a sourced ROS set-up" if foreign else "make setup"
    return Check("rclpy", reason, fix)


def discovery(environment: Mapping[str, str]) -> Check:
    """A message of one process reaches another."""
    domain = environment.get("ROS_DOMAIN_ID", "0")
    if processes_discover_each_other(environment):
        return Check("DDS discovery", f"two processes meet in domain {domain}")
    variables = "ROS_DISCOVERY_SERVER and FASTRTPS_DEFAULT_PROFILES_FILE"
    fix = f"allow UDP on loopback and unset {variables}"
    return Check("DDS discovery", f"two processes do not meet in domain {domain}", fix)


def disk(folder: Path) -> Check:
    """The folder can be written to and has room for recordings."""
    free = shutil.disk_usage(folder).free
    finding = f"{free / 1e9:.1f} GB free in {folder}"
    if not os.access(folder, os.W_OK):
        return Check("disk", f"{folder} is not writable", "change to a folder of your own")
    if free < _LEAST_FREE_BYTES:
        least_gb = RecorderSettings().min_free_bytes / 1e9
        fix = f"free some space; recording stops below {least_gb:g} GB"
        return Check("disk", finding, fix)
    return Check("disk", finding)


def doctor(as_json: AsJson = False) -> None:
    """Make all checks and print them."""
    found = all_checks(os.environ, Path.cwd())
    if as_json:
        print_json([{**each._asdict(), "state": each.state} for each in found])
    else:
        console.print(
            facts_table((each.subject, f"{each.state}: {each.finding}") for each in found)
        )
        for each in found:
            if each.fix:
                print(f"{each.subject}: {each.fix}")
    if any(each.fix for each in found):
        raise typer.Exit(FAILED)


TOPIC, LONGEST_S = "serd_doctor", 30.0
_PERIOD_S = 0.05
_LONGEST_END_S = 5.0


def processes_discover_each_other(environment: Mapping[str, str]) -> bool:
    """Whether a message of one process reaches another."""
    words, quiet = [sys.executable, "-m", "serd_cli.commands.doctor"], subprocess.DEVNULL
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
    """Talk until the end, or listen: 0 at the first message, else 1; entry point of a process."""
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
