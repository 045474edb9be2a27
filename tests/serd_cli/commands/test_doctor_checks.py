"""What `serd doctor` finds, and the command it names."""

import os
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import PackageNotFoundError
from types import SimpleNamespace

import pytest
from sensor_msgs.msg import LaserScan

from serd_cli.commands import doctor as checks
from serd_cli.processes.discovery import (
    LidarReport,
    lidar_report,
    processes_discover_each_other,
)
from serd_cli.processes.workspace import ros_environment
from serd_ros.endpoints import qos
from support.nodes_in_process import other_participant
from support.valid_messages import valid_message
from support.waiting import wait_until


def test_here_python_and_all_required_packages_work():
    assert checks.python().state == "works"
    assert next(checks.packages()).state == "works"


@pytest.mark.parametrize(
    ("missing", "subject", "state", "finding", "fix"),
    [
        ("numpy", "packages", "fails", "without numpy", "make setup"),
        ("pyarrow", "extras", "optional", "not complete: parquet", "pip install 'serd[parquet"),
    ],
)
def test_missing_packages_are_named_with_what_mends_it(
    monkeypatch, missing, subject, state, finding, fix
):
    def version(name):
        if name == missing:
            raise PackageNotFoundError(name)
        return "1"

    monkeypatch.setattr(checks, "version", version)
    found = list(checks.packages())[-1]
    assert (found.subject, found.state) == (subject, state)
    assert found.finding.startswith(finding)
    assert found.fix.startswith(fix)


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
    with other_participant("lidar", ros_env["ROS_DOMAIN_ID"]) as lidar:
        publisher = lidar.create_publisher(LaserScan, "scan", qos.SENSOR)
        with ThreadPoolExecutor(1) as threads:
            found = threads.submit(lidar_report, ros_env)
            wait_until(lambda: publisher.publish(message) or found.done())
    assert found.result().n_scans > 0
    assert found.result().zero == "free"
    assert found.result().zero_share == pytest.approx(160 / 360)


@pytest.mark.ros
def test_without_a_lidar_the_doctor_goes_on(ros_env):
    assert lidar_report(ros_env) == LidarReport(0)
