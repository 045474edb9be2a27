"""Every node of every stack, killed (SIGKILL) and stopped (SIGSTOP), and what becomes of the rest.

Live stacks run without a supervisor and are driven: time and distance until the robot stands. All
stacks run under `serd launch`: when they end, whether the node is named, what is left and lost. The
tables of docs/safety.md are `lab/results/kill_matrix.md`.
"""

import math
import os
import signal
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
from domain_coordinator import domain_id

from lab.benchmarks.faults.driven_stack import SOURCE, DrivenStack
from lab.benchmarks.faults.launched_stack import LaunchedStack
from lab.benchmarks.report import RESULTS, Row
from serd_app.learning.checkpoint import CheckpointFolder
from serd_bag.files import atomic_write_text
from serd_bag.reader import BagReader
from serd_cli.processes.workspace import ros_environment
from serd_files.episode_table import load_episodes
from serd_ros.graph.graph import find_stack
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario

_ROOT = Path(__file__).resolve().parents[3]
_BAG = _ROOT / "bags/data/hallway/training"
LIVE = ("live", "goto", "teleop")
LAUNCHED = (
    "demonstrate", "demonstrate_and_learn", "learn", "replay_and_learn", "navigate", "live", "goto",
    "teleop",
)  # fmt: skip
_RECORDED = ("demonstrate", "demonstrate_and_learn", "teleop")


def run() -> None:
    """Measure both tables and write them as Markdown."""
    with tempfile.TemporaryDirectory() as folder:
        model = _learned_model(Path(folder))
        motion = [
            motion_row(stack, node, number, model)
            for stack in LIVE
            for node in (*find_stack(stack).nodes, *([SOURCE] if stack == "live" else []))
            for number in ((signal.SIGKILL,) if node == SOURCE else _SIGNALS)
        ]
        launched = [
            launch_row(stack, node, model) for stack in LAUNCHED for node in find_stack(stack).nodes
        ]
        commands = [command_row(stack, model) for stack in LAUNCHED]
    tables = [pd.DataFrame(rows).to_markdown(index=False) for rows in (motion, launched, commands)]
    atomic_write_text(RESULTS / "kill_matrix.md", "\n\n".join(tables) + "\n")
    print("\n\n".join(tables))


_SIGNALS = (signal.SIGKILL, signal.SIGSTOP)


@contextmanager
def place() -> Iterator[tuple[dict[str, str], Path]]:
    """Environment and folder of one run, in a ROS domain of its own."""
    with tempfile.TemporaryDirectory() as folder, domain_id() as domain:
        environment = {**ros_environment(os.environ), "ROS_DOMAIN_ID": str(domain)}
        environment["ROS_LOG_DIR"] = str(Path(folder) / "ros")
        yield environment, Path(folder)


def motion_row(stack: str, node: str, number: signal.Signals, model: Path) -> Row:
    """Time and distance until the robot stands after a fault in a driven stack."""
    with place() as (environment, folder):
        given = parameters(stack, folder, model) | {"people": 0}
        with DrivenStack(stack, given, environment, folder) as driven:
            driven.drive()
            standing = driven.inject(node, number)
            resumes = number == signal.SIGSTOP and driven.resume(node)
        lost_s = ""
        if stack in _RECORDED:
            lost_s = f"{max(0.0, driven.fault_time_s - newest_stamp_s(folder / 'bag')):.2f}"
    return {
        "stack": stack,
        "node": node,
        "signal": number.name if node != SOURCE else "silence",
        "stands after (s)": _seconds(standing.after_s),
        "distance (m)": f"{standing.distance_m:.2f}",
        "after SIGCONT": ("drives" if resumes else "stands") if number == signal.SIGSTOP else "",
        "lost before the fault (s)": lost_s,
        "reported on diagnostics": "; ".join(standing.reports),
    }


def launch_row(stack: str, node: str, model: Path) -> Row:
    """How `serd launch` names a node that is stopped, and ends after the same node was killed."""
    with place() as (environment, folder):
        launched = started(stack, environment, folder, model)
        stopped = launched.stop_node(node)
        killed = launched.kill_node(node)
        lost = lost_episodes(folder) if stack == "demonstrate_and_learn" else ""
    return {
        "stack": stack,
        "node": node,
        "SIGSTOP: named after (s)": _seconds(stopped.after_s) if stopped.named else "not named",
        "SIGKILL: all ended after (s)": _seconds(killed.after_s),
        "named": "yes" if killed.named else "no",
        "left": killed.n_left,
        "episodes lost of the checkpoint": lost,
    }


def command_row(stack: str, model: Path) -> Row:
    """When the nodes have ended after SIGKILL of `serd launch`."""
    with place() as (environment, folder):
        ending = started(stack, environment, folder, model).kill()
    return {"stack": stack, "SIGKILL of serd launch: last node ended after (s)": ending.after_s}


def started(stack: str, environment: Mapping[str, str], folder: Path, model: Path) -> LaunchedStack:
    """`serd launch STACK`, once all its nodes run."""
    given = [f"{name}:={value}" for name, value in parameters(stack, folder, model).items()]
    launched = LaunchedStack(stack, given, environment, folder)
    launched.wait_until_running(find_stack(stack).nodes, folder)
    return launched


def parameters(stack: str, folder: Path, model: Path) -> dict[str, Any]:
    """The parameters with which a stack runs until it is ended."""
    expert = {"scripted_expert.output": str(folder), "scripted_expert.episodes": 1000}
    of_nodes: dict[str, dict[str, Any]] = {
        "demo_recorder": {"demo_recorder.output": str(folder / "bag")},
        "scripted_expert": expert,
        "learner": {"learner.output": str(folder / "model.yaml")},
        "bag_replay": {"bag_replay.bag": str(_BAG)},
        "strategy": {"model": str(model)},
        "teleop_page": {"port": 0},
    }
    of_stacks = {"learn": {"learner.bag": str(_BAG)}, "navigate": {"episodes": 1000}}
    given = dict(of_stacks.get(stack, {}))
    for node in find_stack(stack).nodes:
        given |= of_nodes.get(node, {})
    return given


def newest_stamp_s(bag: Path) -> float:
    """Stamp of the last odometry in a bag, NaN where there is none."""
    reader = BagReader(bag, tolerant=True)
    stamps = [each.log_time_ns for each in reader.messages() if each.topic == "/odom"]
    return max(stamps) * 1e-9 if stamps else math.nan


def lost_episodes(folder: Path) -> int:
    """Episodes that had ended and are not in the learner's checkpoint."""
    scenario = load_scenario("hallway")
    memory = CheckpointFolder(folder / "model_learner", scenario.name, grid_of(scenario)).load()
    n_kept = len(memory[1].episodes) if memory is not None else 0
    return len(load_episodes(folder / "episodes.csv")) - n_kept


def _learned_model(folder: Path) -> Path:
    """A model that the stack learn makes of the shipped recording."""
    with place() as (environment, _):
        given = [f"bag:={_BAG}", f"learner.output:={folder / 'model.yaml'}"]
        LaunchedStack("learn", given, environment, folder).process.wait()
    return folder / "model.yaml"


def _seconds(value: float) -> str:
    if math.isinf(value):
        return "drives on"
    return "no stamps" if math.isnan(value) else f"{value:.2f}"
