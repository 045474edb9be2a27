"""World, planner, mux, recorder and page are started; drive, save or discard episodes.

Ctrl-C ends. Each session has a new session-N folder.
"""

import os
import re
import shlex
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

from rich.text import Text

from serd_app.drives.drive import DISCARDED
from serd_app.teleop.page.server import PageAccess, read_token
from serd_bag.files import atomic_write_text
from serd_bag.quantities import counted
from serd_cli.errors import UsageError
from serd_cli.options import AsJson, free_folder, opt, resolved_scenario, validated, with_settings
from serd_cli.output.terminal import print_json, progress_console
from serd_cli.processes.stack_run import log_of_nodes, port_fault
from serd_cli.processes.supervisor import Line, run_together
from serd_cli.processes.workspace import ros_environment, stack_processes
from serd_files.errors import USER_ERRORS
from serd_files.settings import setting, setting_of
from serd_files.yaml_config import StrictModel
from serd_ros.graph.graph import find_stack
from serd_ros.process.progress import VARIABLE, parse_progress
from serd_ros.settings import PageConfig
from serd_sim.episodes.episode import EpisodeSettings, WorldSettings
from serd_sim.scenario.grid import grid_of, start_states_of
from serd_sim.scenario.scenario import load_scenario


class TeleopSettings(StrictModel):
    """Settings of a session."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    seed: int = setting_of(EpisodeSettings, "seed")
    start_area: str = setting_of(WorldSettings, "start_area")
    people: int | None = setting_of(WorldSettings, "people")
    velocity: bool = setting(False, "drive by velocities, not by directions")
    driver: str = setting("", "name of the driver in the episode marks; the node's own when empty")
    address: str = setting_of(PageConfig, "address")
    port: int = setting_of(PageConfig, "port")
    token_file: str = setting_of(PageConfig, "token_file")

    def parameters(self, bag: Path) -> dict[str, Any]:
        """Parameters of the nodes of the stack `teleop`."""
        given = self.model_dump(exclude={"velocity"}, exclude_none=True)
        given |= {"mode": "velocity" if self.velocity else "directions"}
        given |= {"demo_recorder.output": str(bag)}
        if self.token_file:
            given["token_file"] = str(Path(self.token_file).resolve())
        if not self.driver:
            del given["driver"]
        return given


#: A mapping for 'serd demos'.
_VELOCITIES = "action_from: velocity\naction_topic: cmd_vel\nepisode_topic: episode\n"
_SHOWN = ("teleop_page", "teleop_mux")
_ROS_PREFIX = re.compile(r"^\[(\w+)\] \[[\d.]+\] \[[\w.]+\]: ")


def run_session(settings: TeleopSettings, folder: Path, *, as_json: bool) -> None:
    """Run the stack until it is stopped; in any case, print what is recorded."""
    bag = folder / "bag"
    environment = ros_environment(os.environ)
    environment["ROS_LOG_DIR"] = str(folder / "logs" / "ros")
    stack = find_stack("teleop")
    processes = stack_processes(stack, settings.parameters(bag), environment)
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
    with log_of_nodes(log) as write:

        def take(node: str, line: str) -> None:
            write(node, line)
            match = _ROS_PREFIX.match(line)
            if progress := parse_progress(line):
                if progress.address:
                    address = progress.address, "bold"
                    progress_console.print(Text.assemble("drive at ", address, "   (Ctrl-C ends)"))
            elif node in _SHOWN and match and match[1] != "FATAL":
                progress_console.print(line[match.end() :], soft_wrap=True)

        yield take


def _print_recorded(settings: TeleopSettings, folder: Path, bag: Path, *, as_json: bool) -> None:
    """What was recorded, and the command that makes decisions of it."""
    outcomes, n_decisions = recorded_in(bag, settings.scenario)
    command = None
    if set(outcomes) - {DISCARDED}:
        words = ["serd", "demos", str(bag), "--scenario", settings.scenario]
        if settings.velocity:
            mapping = folder / "mapping.yaml"
            atomic_write_text(mapping, _VELOCITIES)
            words += ["--mapping", str(mapping)]
        command = shlex.join([*words, "--output", str(folder / "decisions.csv")])
    if as_json:
        values = {"outcomes": outcomes, "n_decisions": n_decisions, "decisions": command}
        print_json({"bag": bag if bag.exists() else None, **values})
        return
    counts = ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in sorted(outcomes.items()))
    text = f"{counts or 'no episode'}; {counted(n_decisions, 'decision')} by directions"
    progress_console.print(f"\nrecorded in {bag}: {text}", soft_wrap=True)
    if command:
        progress_console.print(f"decisions: {command}", soft_wrap=True)


def recorded_in(bag: Path, scenario: str) -> tuple[dict[str, int], int]:
    """How many episodes ended how, and how many decisions were not discarded."""
    from serd_app.demonstrations.discretise import demonstrations_of_drives
    from serd_app.drives.sessions import read_drives

    place = load_scenario(scenario)
    try:
        drives = read_drives(bag, tolerant=True)
        _, report = demonstrations_of_drives(drives, grid_of(place), place.patience_s, place.wait_s)
    except USER_ERRORS:  # nothing readable was recorded
        return {}, 0
    outcomes = Counter(span.outcome for drive in drives for span in drive.episodes)
    return dict(outcomes), report.n_decisions


Output = Annotated[Path, opt("folder that gets a session-N folder")]


@with_settings(TeleopSettings)
def teleop(output: Output = Path("teleop_output"), as_json: AsJson = False, **options: Any) -> None:
    """Parse the options, run the stack and print what was recorded."""
    options["scenario"] = resolved_scenario(options["scenario"])
    settings = validated(TeleopSettings, **options)
    scenario = load_scenario(settings.scenario)
    start_states_of(scenario, grid_of(scenario), settings.start_area)
    require_page(settings)
    run_session(settings, free_folder(output, "session").resolve(), as_json=as_json)
