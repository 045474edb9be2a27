"""serd doctor

Nothing is changed. Exit code 1 where something that the main job needs fails.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, distributions, metadata, requires, version
from pathlib import Path
from typing import Literal, NamedTuple

import typer
from packaging.requirements import Requirement
from rich.table import Table
from rich.text import Text

from serd_bag.recorder_settings import RecorderSettings
from serd_cli.errors import FAILED
from serd_cli.options import AsJson
from serd_cli.output.terminal import console, print_json
from serd_cli.processes.discovery import processes_discover_each_other
from serd_cli.processes.workspace import ros_environment

_LEAST_FREE_BYTES = 1_000_000_000
_COLOURS = {"works": "green", "optional": "yellow", "fails": "red"}


class Check(NamedTuple):
    """One finding; fix: the command that mends it, empty where nothing is to be mended."""

    subject: str
    state: Literal["works", "optional", "fails"]
    finding: str
    fix: str = ""


def all_checks(environment: Mapping[str, str], folder: Path) -> Iterator[Check]:
    """Every check as it is made, for commands that write into the folder."""
    ros = ros_environment(environment)
    yield python()
    yield from packages()
    yield from (ros_client(ros), discovery(ros), disk(folder))


def python() -> Check:
    """The interpreter is one that the ROS wheels exist for."""
    found = ".".join(map(str, sys.version_info[:3]))
    if (3, 10) <= sys.version_info[:2] <= (3, 12):
        return Check("Python", "works", f"{found} in {sys.prefix}")
    return Check("Python", "fails", f"{found}, not 3.10 to 3.12", "make setup PYTHON=python3.11")


def packages() -> Iterator[Check]:
    """The distributions that the project requires, and those of its extras, which none needs."""
    try:
        found = [Requirement(line) for line in requires("serd") or ()]
    except PackageNotFoundError:
        yield Check("packages", "fails", "serd is not installed here", "make setup")
        return
    missing = {
        extra: sorted(
            each.name
            for each in found
            if (each.marker is None or each.marker.evaluate({"extra": extra}))
            and not any(distributions(name=each.name))
        )
        for extra in ("", *(metadata("serd").get_all("Provides-Extra") or ()))
    }
    if always := missing.pop(""):
        yield Check("packages", "fails", f"without {', '.join(always)}", "make setup")
        return
    yield Check("packages", "works", f"serd {version('serd')} and all it requires")
    if partly := ",".join(extra for extra, names in missing.items() if names):
        yield Check(
            "extras", "optional", f"not complete: {partly}", f"pip install 'serd[{partly}]'"
        )


def ros_client(environment: Mapping[str, str]) -> Check:
    """Rclpy can be imported and started."""
    words = [sys.executable, "-c", "import rclpy; rclpy.init(); rclpy.shutdown()"]
    done = subprocess.run(words, env=dict(environment), capture_output=True, text=True, check=False)
    if done.returncode == 0:
        distribution = environment.get("ROS_DISTRO", "ROS wheels of this environment")
        return Check("rclpy", "works", distribution)
    reason = (done.stderr.strip().splitlines() or ["ended without a message"])[-1]
    foreign = environment.get("ROS_DISTRO", "jazzy") != "jazzy"
    fix = "open a shell without a sourced ROS set-up" if foreign else "make setup"
    return Check("rclpy", "fails", reason, fix)


def discovery(environment: Mapping[str, str]) -> Check:
    """A message of one process reaches another."""
    domain = environment.get("ROS_DOMAIN_ID", "0")
    if processes_discover_each_other(environment):
        return Check("DDS discovery", "works", f"two processes meet in domain {domain}")
    variables = "ROS_DISCOVERY_SERVER and FASTRTPS_DEFAULT_PROFILES_FILE"
    fix = f"allow UDP on loopback and unset {variables}"
    return Check("DDS discovery", "fails", f"two processes do not meet in domain {domain}", fix)


def disk(folder: Path) -> Check:
    """The folder can be written to and has room for recordings."""
    free = shutil.disk_usage(folder).free
    finding = f"{free / 1e9:.1f} GB free in {folder}"
    if not os.access(folder, os.W_OK):
        return Check("disk", "fails", f"{folder} is not writable", "change to a folder of your own")
    if free < _LEAST_FREE_BYTES:
        least_gb = RecorderSettings().min_free_bytes / 1e9
        fix = f"free some space; recording stops below {least_gb:g} GB"
        return Check("disk", "fails", finding, fix)
    return Check("disk", "works", finding)


def doctor(as_json: AsJson = False) -> None:
    """Make all checks and print them."""
    found = list(all_checks(os.environ, Path.cwd()))
    if as_json:
        print_json([each._asdict() for each in found])
    else:
        table = Table(show_header=False)
        table.add_column(no_wrap=True)
        table.add_column(no_wrap=True)
        table.add_column(overflow="fold")
        for each in found:
            table.add_row(each.subject, Text(each.state, _COLOURS[each.state]), each.finding)
        console.print(table)
        for each in found:
            if each.fix:
                print(f"{each.subject}: {each.fix}")
    if any(each.state == "fails" for each in found):
        raise typer.Exit(FAILED)
