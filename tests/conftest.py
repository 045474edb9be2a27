"""Settings for all tests: message field checks, loopback, one thread, a ROS domain per test."""

import os
import signal
from collections.abc import Callable, Iterator
from itertools import accumulate, groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
# As `make` does: otherwise each node that a test starts compiles what has changed again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import pytest
from domain_coordinator import domain_id
from hypothesis import HealthCheck, settings

from serd_cli.processes.workspace import ros_environment
from serd_files.model_file import FitRecord, GridSummary, ModelFile, OutcomeModel
from serd_files.yaml_config import save_yaml_model
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario

# A shell starts background jobs, and nohup all, with these ignored; child processes inherit it.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
os.environ.update(ros_environment(os.environ))
pytest_plugins = ["support.bag_messages", "support.nav2_server", "support.quick_pictures"]
settings.register_profile(
    "any speed of the machine", deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any speed of the machine")
ROOT = Path(__file__).resolve().parents[1]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files of tests/system, whose nodes wait for each other, come among those that compute.

    Otherwise all workers would be there at the end, and none would use what the others leave.
    """
    files = [list(found) for _, found in groupby(items, key=lambda item: item.path)]
    system = ROOT / "tests" / "system"
    parts = ([each for each in files if (each[0].path.parent == system) == kind] for kind in (0, 1))
    placed = sorted((place for part in parts for place in _placed(part)), key=itemgetter(0))
    items[:] = [item for _, file in placed for item in file]


def _placed(files: list[list[pytest.Item]]) -> Iterator[tuple[float, list[pytest.Item]]]:
    """Each file with the share of tests that are before it."""
    counts = [len(each) for each in files]
    for file, before in zip(files, accumulate(counts, initial=0), strict=False):
        yield before / sum(counts), file


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture
def ros_env(tmp_path: Path) -> Iterator[dict[str, str]]:
    """Environment for node processes: a ROS domain of this test's own, logs in its folder."""
    with domain_id() as domain:
        environment = ros_environment(os.environ)
        environment["ROS_DOMAIN_ID"] = str(domain)
        environment["ROS_LOG_DIR"] = str(tmp_path / "ros_log")
        yield environment


#: Outcomes (stay, forward, right, back, left) of each model; with the flow it is easy to go on.
OUTCOMES = {
    "with_flow": (0.05, 0.9, 0.02, 0.01, 0.02),
    "against_flow": (0.5, 0.3, 0.08, 0.04, 0.08),
    "across_flow": (0.15, 0.75, 0.04, 0.02, 0.04),
    "waiting": (0.8, 0.05, 0.05, 0.05, 0.05),
}
#: Mean dwell times (s) of moves; each law has the shape 4, and a wait takes one second.
MEAN_S = {"with_flow": 1.0, "against_flow": 2.0, "across_flow": 1.5}


def model_row(name: str, row: tuple[float, ...]) -> OutcomeModel:
    """A local model that is what the expert believes and the estimate, with its law."""
    mean_s = MEAN_S.get(name, 1.0)
    shape = 4.0 if name in MEAN_S else None
    return OutcomeModel(
        name=name, learned=row, believed=row, initial=row, mean_s=mean_s, believed_mean_s=mean_s,
        shape=shape,
    )  # fmt: skip


def model_of(scenario: str = "hallway", **changes: Any) -> ModelFile:
    """The model file of a fit to a scenario, with any of its fields replaced."""
    values: dict[str, Any] = {
        "scenario": scenario,
        "method": "written by a test",
        "prior": "none",
        "discount": 0.99,
        "beta": 1.0,
        "patience_s": 4.0,
        "reward_weights": {"goal": 5.0, "social_norm": 1.0, "inverse_wall_distance": 0.0},
        "outcome_names": ("stay", "forward", "right", "back", "left"),
        "outcome_models": tuple(model_row(name, row) for name, row in OUTCOMES.items()),
        "grid": GridSummary.of(grid_of(load_scenario(scenario))),
        "fit": FitRecord(
            converged=True, message="", n_episodes=1, n_decisions=1, objective=0.0,
            policy_log_likelihood=0.0, dynamics_log_likelihood=0.0, log_prior=0.0,
            gradient_norm=0.0, n_steps=1, n_evaluations=1,
        ),
    }  # fmt: skip
    return ModelFile(**(values | changes))


@pytest.fixture
def save_model_of(tmp_path: Path) -> Callable[..., Path]:
    """Writes such a model file."""

    def save(scenario: str = "hallway", name: str = "model.yaml", **changes: Any) -> Path:
        save_yaml_model(tmp_path / name, model_of(scenario, **changes))
        return tmp_path / name

    return save
