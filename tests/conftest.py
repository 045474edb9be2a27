"""Settings for all tests: message field checks, loopback, one thread, a ROS domain per test."""

import os
from collections.abc import Iterator
from pathlib import Path

os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

import pytest
from domain_coordinator import domain_id

from serd_cli.workspace import ros_environment

os.environ.update(ros_environment(os.environ))
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def root() -> Path:
    """The project's folder."""
    return ROOT


@pytest.fixture
def ros_env(tmp_path: Path) -> Iterator[dict[str, str]]:
    """Environment for node processes: a ROS domain of this test's own, logs in its folder."""
    with domain_id() as domain:
        environment = ros_environment(os.environ)
        environment["ROS_DOMAIN_ID"] = str(domain)
        environment["ROS_LOG_DIR"] = str(tmp_path / "ros_log")
        yield environment
