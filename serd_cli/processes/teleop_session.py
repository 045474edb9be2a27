"""A session of `serd teleop`: its stack, what of it the driver sees, and what was recorded."""

import os
import re
import shlex
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.text import Text

from serd_app.demonstrations.discretise import demonstrations_of_drives
from serd_app.drives.drive import DISCARDED
from serd_app.drives.mapping import BagMapping
from serd_app.drives.sessions import read_drives
from serd_app.teleop.page.server import PageAccess, read_token
from serd_bag.files import atomic_write_text
from serd_bag.quantities import counted
from serd_cli.commands.teleop import TeleopSettings
from serd_cli.errors import UsageError
from serd_cli.output.terminal import print_json, progress_console
from serd_cli.processes.node_commands import stack_processes
from serd_cli.processes.stack_run import log_of_nodes, port_fault, require_free_domain
from serd_cli.processes.supervisor import Line, run_together
from serd_cli.processes.workspace import ros_environment
from serd_files.errors import USER_ERRORS
from serd_files.yaml_config import model_yaml
from serd_ros.graph.graph import find_stack
from serd_ros.process.progress import VARIABLE, parse_progress
from serd_sim.scenario.grid import grid_of, start_states_of
from serd_sim.scenario.scenario import load_scenario

_VELOCITIES = BagMapping(action_from="velocity", action_topic="cmd_vel", episode_topic="episode")
_SHOWN = ("teleop_page", "teleop_mux")
_ROS_PREFIX = re.compile(r"^\[(\w+)\] \[[\d.]+\] \[[\w.]+\]: ")


def require_start(settings: TeleopSettings) -> None:
    """SimError where the scenario has no such start area."""
    scenario = load_scenario(settings.scenario)
    start_states_of(scenario, grid_of(scenario), settings.start_area)


def run_session(settings: TeleopSettings, folder: Path, *, as_json: bool) -> None:
    """Run the stack until it is stopped; in any case, print what is recorded."""
    bag = folder / "bag"
    environment = ros_environment(os.environ)
    environment["ROS_LOG_DIR"] = str(folder / "logs" / "ros")
    stack = find_stack("teleop")
    processes = stack_processes(stack, settings.parameters(bag), environment)
    require_free_domain(stack, environment)
    progress_console.print(f"recording into {bag}", soft_wrap=True)
    try:
        with suppress(KeyboardInterrupt), driver_lines(folder / "logs" / "nodes.log") as take:
            run_together(processes, environment | {VARIABLE: "1"}, take)
    finally:
        _print_recorded(settings, folder, bag, as_json=as_json)


def require_page(settings: TeleopSettings) -> None:
    """UsageError where the page cannot be served."""
    PageAccess(settings.address, read_token(settings.token_file))
    if fault := port_fault(settings.address, settings.port):
        raise UsageError(
            f"cannot serve the page on {settings.address} port {settings.port}: {fault}"
            "; choose another with --port, 0 takes a free one"
        )


@contextmanager
def driver_lines(log: Path) -> Iterator[Line]:
    """What logs the lines of nodes and prints those for the driver."""
    # Nodes whose traceback is hidden: the supervisor reports a failure that matters.
    broken: set[str] = set()
    with log_of_nodes(log) as write:

        def take(node: str, line: str) -> None:
            write(node, line)
            match = _ROS_PREFIX.match(line)
            text = line[match.end() :] if match else line
            if match and match[1] == "FATAL":
                broken.add(node)
            if progress := parse_progress(line):
                if progress.address:
                    address = progress.address, "bold"
                    progress_console.print(Text.assemble("drive at ", address, "   (Ctrl-C ends)"))
            elif node in _SHOWN and node not in broken:
                progress_console.print(text, soft_wrap=True)

        yield take


def _print_recorded(settings: TeleopSettings, folder: Path, bag: Path, *, as_json: bool) -> None:
    """What was recorded, and the command that makes decisions of it."""
    summary, command = summarise_session(bag, settings.scenario), None
    if summary and summary.n_kept:
        words = ["serd", "demos", str(bag), "--scenario", settings.scenario]
        if settings.velocity:
            mapping = folder / "mapping.yaml"
            atomic_write_text(mapping, model_yaml(_VELOCITIES))
            words += ["--mapping", str(mapping)]
        command = shlex.join([*words, "--output", str(folder / "decisions.csv")])
    if as_json:
        recorded = {"outcomes": {}, "n_decisions": 0} if summary is None else asdict(summary)
        print_json({"bag": None if summary is None else bag, **recorded, "decisions": command})
        return
    text = f"nothing was recorded in {folder}" if summary is None else f"\n{summary}\nbag: {bag}"
    progress_console.print(text, soft_wrap=True)
    if command:
        progress_console.print(f"decisions: {command}", soft_wrap=True)


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
        named = {
            name.replace("_", " "): n for name, n in self.outcomes.items() if name != DISCARDED
        }
        how = ", ".join(f"{n} {name}" for name, n in sorted(named.items()))
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
        _, report = demonstrations_of_drives(drives, grid_of(place), place.patience_s, place.wait_s)
    except USER_ERRORS:
        return None
    outcomes = Counter(span.outcome for drive in drives for span in drive.episodes)
    return SessionSummary(dict(outcomes), report.n_decisions)
