"""What `serd doctor` finds, and the command it names."""

import os
import socket
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import PackageNotFoundError
from types import SimpleNamespace

import pytest
import rclpy
from rclpy.context import Context
from sensor_msgs.msg import LaserScan

from serd_cli.commands.stacks import doctor as checks
from serd_cli.processes.discovery import (
    LidarReport,
    lidar_report,
    processes_discover_each_other,
)
from serd_cli.processes.workspace import ros_environment
from serd_ros.endpoints import qos
from serd_ros.graph.configs import TeleopPageConfig
from support.valid_messages import valid_message
from support.waiting import wait_until


def test_here_python_and_all_required_packages_work():
    assert checks.python().state == "works"
    assert checks.packages().state == "works"
    names = checks.requirements()
    assert "numpy" in names[""]
    assert "pyarrow" in names["parquet"]


def test_missing_packages_are_named_with_the_set_up(monkeypatch):
    def version(name):
        if name == "numpy":
            raise PackageNotFoundError(name)
        return "1"

    monkeypatch.setattr(checks, "version", version)
    found = checks.packages()
    assert (found.state, found.finding, found.fix) == ("fails", "without numpy", "make setup")


def test_a_port_in_use_fails_and_another_is_named():
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        found = checks.page_port(busy.getsockname()[1])
    assert found.state == "fails"
    assert found.fix == "serd teleop --port 0"
    assert checks.page_port(0).state == "works"
    assert TeleopPageConfig.model_fields["port"].default == checks.PAGE_PORT


def test_no_display_is_no_failure():
    assert checks.display({}).state == "optional"
    assert checks.display({"DISPLAY": ":0"}).finding == ":0"


def test_a_clock_that_was_not_set_fails():
    assert checks.clock(0.0).finding == "1970-01-01 00:00:00 UTC is in the past"


def test_a_full_disk_fails(tmp_path, monkeypatch):
    assert checks.disk(tmp_path).finding.endswith(str(tmp_path))
    monkeypatch.setattr(checks.shutil, "disk_usage", lambda _: SimpleNamespace(free=10**8))
    found = checks.disk(tmp_path)
    assert (found.state, found.finding) == ("fails", f"0.1 GB free in {tmp_path}")
    assert found.fix == "free some space; recording stops below 0.1 GB"


@pytest.mark.ros
def test_processes_discover_each_other_and_a_broken_rclpy_is_reported(tmp_path):
    environment = ros_environment(os.environ)
    assert checks.ros_client(environment).state == "works"
    assert processes_discover_each_other(environment)
    (tmp_path / "rclpy.py").write_text("raise ImportError('no library')\n")
    broken = checks.ros_client({**environment, "PYTHONPATH": str(tmp_path)})
    assert (broken.state, broken.finding) == ("fails", "ImportError: no library")


@pytest.mark.parametrize(
    ("report", "state", "fix"),
    [
        (LidarReport(0), "optional", ""),
        (LidarReport(10, 0.0), "works", ""),
        (LidarReport(10, 0.3, "unknown"), "works", ""),
        (LidarReport(10, 0.3, "free"), "works", "serd launch guard zero_is:=free"),
    ],
)
def test_the_setting_for_a_lidar_that_runs_is_named(report, state, fix, monkeypatch):
    monkeypatch.setattr(checks, "lidar_report", lambda _: report)
    found = checks.lidar({})
    assert (found.state, found.fix) == (state, fix)


@pytest.mark.ros
def test_the_scans_that_another_process_publishes_are_looked_at(ros_env):
    message = valid_message("scan", 1.0)
    message.ranges = type(message.ranges)("f", [9.0] * 100 + [0.0] * 160 + [9.0] * 100)
    context = Context()
    context.init(domain_id=int(ros_env["ROS_DOMAIN_ID"]))
    try:
        publisher = rclpy.create_node("lidar", context=context).create_publisher(
            LaserScan, "scan", qos.SENSOR
        )
        with ThreadPoolExecutor(1) as threads:
            found = threads.submit(lidar_report, ros_env)
            wait_until(lambda: publisher.publish(message) or found.done())
    finally:
        context.try_shutdown()
    assert found.result().n_scans > 0
    assert found.result().zero == "free"
    assert found.result().zero_share == pytest.approx(160 / 360)


@pytest.mark.ros
def test_without_a_lidar_the_doctor_goes_on(ros_env):
    assert lidar_report(ros_env) == LidarReport(0)
