"""What `serd doctor` finds, and the command it names."""

import os
from types import SimpleNamespace

import pytest

from serd_cli.commands import doctor as checks
from serd_cli.processes.discovery import processes_discover_each_other
from serd_cli.processes.workspace import ros_environment


def test_here_python_and_all_required_packages_work():
    assert checks.python().state == "works"
    assert next(checks.packages()).state == "works"


@pytest.mark.parametrize(
    ("missing", "subject", "state", "finding", "fix"),
    [
        ("numpy", "packages", "fails", "without numpy", "make setup"),
        ("imageio-ffmpeg", "extras", "optional", "not complete: movie", "pip install 'serd[movie"),
    ],
)
def test_missing_packages_are_named_with_what_mends_it(
    monkeypatch, missing, subject, state, finding, fix
):
    monkeypatch.setattr(checks, "distributions", lambda name: [] if name == missing else ["one"])
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
