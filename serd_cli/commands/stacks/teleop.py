"""`serd teleop`: drive by hand in real time, record it, and see what is recorded."""

import os
import shlex
import sys
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from serd_app.demonstrations.demonstrations import demonstrations_of_drives
from serd_app.drives.episode_mark import DISCARDED
from serd_app.drives.mapped.mapping import BagMapping
from serd_app.drives.sessions import read_drives
from serd_cli.options import AsJson, resolved_scenario, validated, with_settings
from serd_cli.output.paths import free_folder
from serd_cli.output.terminal import print_json, progress_console
from serd_cli.processes.node_commands import stack_processes
from serd_cli.processes.stack_run import require_free_domain
from serd_cli.processes.supervisor import run_together
from serd_cli.processes.workspace import ros_environment
from serd_cli.teleop.settings import TeleopSettings, require_a_way_to_drive
from serd_cli.teleop.terminal_output import DriverLines, restored_terminal
from serd_core.errors import SerdError
from serd_ros.process.progress import VARIABLE
from sim.scenario.grid import grid_of, start_states_of
from sim.scenario.scenario import load_scenario
from storage.files import atomic_write_text
from storage.quantities import counted
from storage.yaml_config import model_yaml

_VELOCITIES = BagMapping(action_from="velocity", action_topic="cmd_vel", episode_topic="episode")


@with_settings(TeleopSettings)
def teleop(
    output: Annotated[Path, typer.Option(help="folder that gets a session-N folder")] = Path(
        "teleop_output"
    ),
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Start world, planner, mux, recorder and page; drive, save or discard episodes.

    Ctrl-C ends. Without --page the terminal's keys drive. Each session has a new session-N folder.
    """
    options["keyboard"] |= not options["page"]
    options["scenario"] = resolved_scenario(options["scenario"])
    settings = validated(TeleopSettings, **options)
    scenario = load_scenario(settings.scenario)
    start_states_of(scenario, grid_of(scenario), settings.start_area)
    require_a_way_to_drive(settings)
    _run(settings, free_folder(output, "session").resolve(), as_json=as_json)


def _run(settings: TeleopSettings, folder: Path, *, as_json: bool) -> None:
    """Run the stack until it is stopped; in any case, print what is recorded."""
    bag = folder / "bag"
    environment = ros_environment(os.environ)
    environment["ROS_LOG_DIR"] = str(folder / "logs" / "ros")
    processes = stack_processes(settings.stack(), settings.parameters(bag), environment)
    require_free_domain(settings.stack(), environment)
    progress_console.print(f"recording into {bag}", soft_wrap=True)
    try:
        with restored_terminal(sys.stdin), DriverLines(folder / "logs" / "nodes.log") as lines:
            run_together(processes, environment | {VARIABLE: "1"}, lines.take)
    except KeyboardInterrupt:
        pass  # the usual end
    finally:
        _print_recorded(settings, folder, bag, as_json=as_json)


def _print_recorded(settings: TeleopSettings, folder: Path, bag: Path, *, as_json: bool) -> None:
    summary = summarise_session(bag, settings.scenario)
    command = _decisions_command(settings, folder, bag) if summary and summary.n_kept else None
    if as_json:
        recorded = {"outcomes": {}, "n_decisions": 0} if summary is None else asdict(summary)
        print_json({"bag": None if summary is None else bag, **recorded, "decisions": command})
    elif summary is None:
        progress_console.print(f"nothing was recorded in {folder}", soft_wrap=True)
    else:
        progress_console.print(f"\n{summary}\nbag: {bag}", soft_wrap=True)
        if command:
            progress_console.print(f"decisions: {command}", soft_wrap=True)


def _decisions_command(settings: TeleopSettings, folder: Path, bag: Path) -> str:
    """The command that makes decisions of the bag; writes the mapping that it needs."""
    words = ["serd", "demos", str(bag), "--scenario", settings.scenario]
    if settings.velocity:
        mapping = folder / "mapping.yaml"
        atomic_write_text(mapping, model_yaml(_VELOCITIES))
        words += ["--mapping", str(mapping)]
    return shlex.join([*words, "--output", str(folder / "decisions.csv")])


@dataclass(frozen=True)
class SessionSummary:
    """outcomes: of all episodes; n_decisions: of those that were not discarded."""

    outcomes: dict[str, int]
    n_decisions: int

    @property
    def n_kept(self) -> int:
        """Episodes that were not discarded."""
        return sum(self.outcomes.values()) - self.outcomes.get(DISCARDED, 0)

    def __str__(self) -> str:
        """The counts in words."""
        kept = sorted(
            (name.replace("_", " "), n) for name, n in self.outcomes.items() if name != DISCARDED
        )
        how = ", ".join(f"{count} {name}" for name, count in kept)
        return (
            f"{counted(self.n_kept, 'episode')} kept{f' ({how})' if how else ''}, "
            f"{self.outcomes.get(DISCARDED, 0)} discarded; "
            f"{counted(self.n_decisions, 'decision')} by directions"
        )


def summarise_session(bag: Path, scenario: str) -> SessionSummary | None:
    """The bag's episodes and decisions; None where nothing readable was recorded."""
    place = load_scenario(scenario)
    try:
        drives = read_drives(bag, tolerant=True)
        _, report = demonstrations_of_drives(drives, grid_of(place), place.decision_period_s)
    except SerdError:
        return None
    outcomes = Counter(span.outcome for drive in drives for span in drive.episodes)
    return SessionSummary(dict(outcomes), report.n_decisions)
