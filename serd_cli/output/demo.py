"""From the files of a finished run to its report and the table on the terminal."""

import shlex
import sys
from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np

from serd_app.demonstrations.decision_table import load_decisions
from serd_app.drives.drive import LONGEST_GAP_S
from serd_app.learning.criticism import recorded_times
from serd_app.learning.knowledge import both_dynamics, load_knowledge
from serd_app.learning.learning_files import episodes_reaching, until_goal
from serd_app.learning.outcome import fit_of_file, load_trace, outcome_files
from serd_app.report.inputs import FileLink, PhaseTiming, ReportInputs, RunFacts
from serd_app.report.summary import headline_of
from serd_app.report.write import summary_rows, write_report
from serd_bag.messages.plain import pose_position
from serd_bag.reader import BagReader
from serd_bag.topic import topic_named
from serd_cli.output.demo_folder import DemoFolder, DemoSettings
from serd_cli.output.terminal import console, facts_table, print_json
from serd_core.arrays import FloatArray
from serd_ros.endpoints import topics
from serd_sim.drivers.strategy import load_strategy
from serd_sim.scenario.scenario import load_scenario

_PACKAGES = ("serd", "numpy", "scipy", "pybullet", "ros-jazzy-rclpy", "rosbags")
_FILES = (
    FileLink("bag", "rosbag2 recording (MCAP) of all demonstrations"),
    FileLink("foxglove.json", "layout in which Foxglove shows the recording"),
    FileLink("decisions.csv", "the decisions (s, a, s') learned from"),
    FileLink("model.grid.yaml", "the grid they are on"),
    FileLink("model.yaml", "the learned model"),
    FileLink("demonstrations/episodes.csv", "how each demonstration ended"),
    FileLink("navigation/episodes.csv", "how each episode of the learned policy ended"),
    FileLink("model.learning.csv", "objective after each step of the fit"),
    FileLink("demo.yaml", "settings of this run"),
    FileLink("logs", "logs of the nodes"),
)


def report_demo(
    folder: DemoFolder, settings: DemoSettings, phases: Sequence[PhaseTiming], *, as_json: bool
) -> None:
    """Write the report beside the run's files and print its summary."""
    written = write_report(report_inputs(folder, settings, phases), folder.root)
    page, summary = written.page, written.summary
    if as_json:
        print_json({**summary, "report": page})
        return
    console.print()
    console.print(headline_of(summary))
    console.print(facts_table(summary_rows(summary)))
    command = shlex.join(["serd", "navigate", str(folder.model), "--episodes", "200"])
    console.print(f"more episodes, in process: {command}", soft_wrap=True)
    print(f"report: {page}")


def report_inputs(
    folder: DemoFolder, settings: DemoSettings, phases: Sequence[PhaseTiming]
) -> ReportInputs:
    """Everything the report is made of, read back from the run's files."""
    scenario = load_scenario(settings.scenario)
    strategy = load_strategy(
        str(folder.model), scenario, settings.policy, timeout_s=settings.timeout_s
    )
    decisions = load_decisions(folder.decisions)
    goals = strategy.problem.goal_states
    return ReportInputs(
        title=f"Learning to navigate: {scenario.name}",
        strategy=strategy,
        demonstrations=decisions,
        demonstration_tracks_m=recorded_tracks_m(folder.bag),
        fit=fit_of_file(strategy.file, strategy.problem, load_trace(folder.learning)),
        episodes=folder.episodes(folder.navigation),
        run=RunFacts(
            command=shlex.join(["serd", *sys.argv[1:]]),
            how=f"ROS 2 nodes in lock-step, {scenario.pedestrians.count} pedestrians",
            finished_at=datetime.now().astimezone().isoformat(timespec="seconds"),
            phases=tuple(phases),
            seeds={"demonstrations": settings.seed, "navigation": settings.navigation_seed},
            versions={name: version(name) for name in _PACKAGES},
        ),
        files=tuple(each for each in _FILES if (folder.root / each.path).exists()),
        knowledge=load_knowledge(outcome_files(folder.model), strategy.problem.grid),
        both=both_dynamics(outcome_files(folder.model)),
        recorded=recorded_times(
            strategy, until_goal(decisions, goals), episodes_reaching(decisions, goals)
        ),
    )


def recorded_tracks_m(bag: Path) -> tuple[FloatArray, ...]:
    """(T, 2) places of the robot in each episode of a bag; the clock jumps between episodes."""
    reader = BagReader(bag)
    rows = [
        (stamp_ns * 1e-9, x_m, y_m)
        for message in reader.messages([topic_named(reader.topics, topics.ROBOT_POSE)])
        for stamp_ns, x_m, y_m in [pose_position(message.data)]
    ]
    _, first = np.unique([row[0] for row in rows], return_index=True)
    found = np.array(rows)[first]
    cuts = np.flatnonzero(np.diff(found[:, 0]) > LONGEST_GAP_S) + 1
    return tuple(np.split(found[:, 1:], cuts))
