"""`serd doctor`: what is installed and works, and the command that mends what does not."""

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from pathlib import Path
from typing import Literal

import typer
from packaging.requirements import Requirement
from rich.table import Table
from rich.text import Text

from serd_bag.recorder_settings import RecorderSettings
from serd_cli.errors import FAILED
from serd_cli.options import AsJson
from serd_cli.output.terminal import console, print_json
from serd_cli.processes.discovery import lidar_report, processes_discover_each_other
from serd_cli.processes.workspace import ros_environment, workspace_install

#: Of the page for driving by hand.
PAGE_PORT = 8765
_LEAST_FREE_BYTES = 1_000_000_000
_COLOURS = {"works": "green", "optional": "yellow", "fails": "red"}
_EARLIEST_S = 1_735_689_600.0  # 1 January 2025: every release is younger


@dataclass(frozen=True)
class Check:
    """One finding; fix: the command that mends it, empty where nothing is to be mended."""

    subject: str
    state: Literal["works", "optional", "fails"]
    finding: str
    fix: str = ""


def all_checks(environment: Mapping[str, str], folder: Path) -> Iterator[Check]:
    """Every check as it is made, for commands that write into the folder."""
    ros = ros_environment(environment)
    yield python()
    yield packages()
    yield extras()
    yield workspace()
    yield ros_client(ros)
    yield discovery(ros)
    yield lidar(ros)
    yield page_port(PAGE_PORT)
    yield display(environment)
    yield disk(folder)
    yield clock(time.time())


def python() -> Check:
    """The interpreter is one that the ROS wheels exist for."""
    found = ".".join(map(str, sys.version_info[:3]))
    if (3, 10) <= sys.version_info[:2] <= (3, 12):
        return Check("Python", "works", f"{found} in {sys.prefix}")
    return Check("Python", "fails", f"{found}, not 3.10 to 3.12", "make setup PYTHON=python3.11")


def requirements() -> dict[str, list[str]]:
    """Names of the distributions that each extra adds here; those of no extra under \"\"."""
    found = [Requirement(line) for line in requires("serd") or ()]
    always = [each.name for each in found if _applies(each, "")]
    more = {
        extra: [each.name for each in found if each.name not in always and _applies(each, extra)]
        for extra in metadata("serd").get_all("Provides-Extra") or ()
    }
    return {"": always, **more}


def _applies(requirement: Requirement, extra: str) -> bool:
    return requirement.marker is None or requirement.marker.evaluate({"extra": extra})


def _missing(names: Iterable[str]) -> list[str]:
    return [name for name in names if not _installed(name)]


def _installed(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


def packages() -> Check:
    """Every distribution that the project requires is installed."""
    try:
        names = requirements()[""]
    except PackageNotFoundError:
        return Check("packages", "fails", "serd is not installed here", "make setup")
    missing = _missing(names)
    if missing:
        return Check("packages", "fails", f"without {', '.join(missing)}", "make setup")
    return Check("packages", "works", f"serd {version('serd')} and all {len(names)} it requires")


def extras() -> Check:
    """Extras of which a distribution is missing; none is needed for the main job."""
    try:
        of_extra = requirements()
    except PackageNotFoundError:
        return Check("extras", "optional", "not known, for serd is not installed here")
    partly = sorted(name for name, found in of_extra.items() if name and _missing(found))
    if partly:
        fix = f"pip install 'serd[{','.join(partly)}]'"
        return Check("extras", "optional", f"not complete: {', '.join(partly)}", fix)
    return Check("extras", "works", f"all: {', '.join(sorted(filter(None, of_extra)))}")


def workspace() -> Check:
    """Where the nodes are run from."""
    install = workspace_install()
    if install.is_dir():
        return Check("workspace", "works", str(install))
    return Check("workspace", "optional", "not built, the nodes run as modules", "make build")


def ros_client(environment: Mapping[str, str]) -> Check:
    """Rclpy can be imported and started."""
    program = "import rclpy; rclpy.init(); rclpy.shutdown()"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=dict(environment),
        capture_output=True,
        text=True,
        check=False,
    )
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
    return Check(
        "DDS discovery",
        "fails",
        f"two processes do not meet in domain {domain}",
        "allow UDP on loopback and unset ROS_DISCOVERY_SERVER and FASTRTPS_DEFAULT_PROFILES_FILE",
    )


def lidar(environment: Mapping[str, str]) -> Check:
    """What the lidar that runs now means by ranges of 0, which the guard must be told."""
    report = lidar_report(environment)
    if not report.n_scans:
        return Check("lidar", "optional", "no scan is published now")
    finding = f"{report.n_scans} scans, {100.0 * report.zero_share:.0f} % of their ranges are 0"
    if report.zero is None:
        return Check("lidar", "works", finding)
    finding = f"{finding}, which seems to mean {report.zero}"
    fix = "" if report.zero == "unknown" else f"serd launch guard zero_is:={report.zero}"
    return Check("lidar", "works", finding, fix)


def page_port(port: int) -> Check:
    """The page for driving by hand can be served; port: 0 for any."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            reason = f"port {port}: {error.strerror or error}"
            return Check("teleop page", "fails", reason, "serd teleop --port 0")
    return Check("teleop page", "works", f"port {port} of 127.0.0.1 is free")


def display(environment: Mapping[str, str]) -> Check:
    """A screen, which RViz alone needs."""
    name = environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
    if name:
        return Check("display", "works", name)
    return Check("display", "optional", "none; RViz alone needs one", "ssh -X, or a remote desktop")


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


def clock(now_s: float) -> Check:
    """The system clock is set, for recordings bear its times."""
    text = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(now_s))
    if now_s < _EARLIEST_S:
        return Check("clock", "fails", f"{text} is in the past", "timedatectl set-ntp true")
    return Check("clock", "works", text)


def doctor(as_json: AsJson = False) -> None:
    """Check what is installed and works here, and name the command that mends it.

    serd doctor

    Nothing is changed. Exit code 1 where something that the main job needs fails.
    """
    found = list(all_checks(os.environ, Path.cwd()))
    if as_json:
        print_json([asdict(each) for each in found])
    else:
        console.print(checks_table(found))
        for each in found:
            if each.fix:
                print(f"{each.subject}: {each.fix}")
    if any(each.state == "fails" for each in found):
        raise typer.Exit(FAILED)


def checks_table(found: list[Check]) -> Table:
    """One row per check."""
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for each in found:
        state = Text(each.state, style=_COLOURS[each.state])
        table.add_row(each.subject, state, each.finding)
    return table
