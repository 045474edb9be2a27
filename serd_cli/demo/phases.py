"""The three phases that run stacks of nodes; each is skipped when its result exists.

While nodes drive, a web page shows them.
"""

import os
import sys
import time
import webbrowser
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.text import Text

from serd_app.report.inputs import PhaseTiming
from serd_bag.files import atomic_write_text
from serd_cli.demo.folder import DemoFolder, DemoSettings
from serd_cli.errors import RunError
from serd_cli.output.terminal import progress_console
from serd_cli.processes.stack_run import PAGE, port_fault, run_stack
from serd_cli.processes.workspace import PROJECT
from serd_ros.settings import WatchPageConfig

_LAYOUT = PROJECT / "ros_ws/src/serd_ros/foxglove/serd.json"


@dataclass(frozen=True)
class Phase:
    """One stack with its parameters, named after the stack.

    n_parts: how many parts its progress has; drives: folder with its table of episodes, if any.
    """

    name: str
    is_done: Callable[[], bool]
    parameters: Mapping[str, Any]
    n_parts: int
    drives: Path | None = None


def phases_of(folder: DemoFolder, settings: DemoSettings) -> tuple[Phase, ...]:
    """An expert drives and is recorded, a model is learned, and it drives in another world."""
    here = {"scenario": settings.scenario, "seed": settings.seed}
    demonstrate = {
        "scripted_expert.episodes": settings.demonstrations,
        "timeout_s": settings.timeout_s,
        "scripted_expert.output": str(folder.demonstrations),
        "demo_recorder.output": str(folder.bag),
    }
    learn = {
        "bag": str(folder.bag),
        "learner.output": str(folder.model),
        "decisions": str(folder.decisions),
    }
    navigate = {
        "seed": settings.navigation_seed,
        "model": str(folder.model),
        "policy": settings.policy,
        "episodes": settings.episodes,
        "timeout_s": settings.timeout_s,
        "strategy.output": str(folder.navigation),
    }
    return (
        Phase(
            "demonstrate",
            lambda: folder.demonstrated(settings),
            here | demonstrate,
            settings.demonstrations,
            folder.demonstrations,
        ),
        Phase("learn", folder.learned, here | learn, 1),
        Phase(
            "navigate",
            lambda: folder.navigated(settings),
            here | navigate,
            settings.episodes,
            folder.navigation,
        ),
    )


class LivePage:
    """The page that shows the drives, at one address unless another program has its port."""

    def __init__(self) -> None:
        self._shown = ""

    def parameters(self) -> dict[str, int]:
        """Its port: the usual one, or any free one."""
        usual = WatchPageConfig()
        return {f"{PAGE}.port": 0 if port_fault(usual.address, usual.port) else usual.port}

    def show(self, address: str) -> None:
        """Print an address that is new, and open it where there is a display."""
        if address == self._shown:
            return
        self._shown = address
        progress_console.print(Text.assemble("watch the drives at ", (address, "bold")))
        has_display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        if has_display and sys.stdout.isatty():
            webbrowser.open(address)


def run_phases(
    folder: DemoFolder, settings: DemoSettings, environment: Mapping[str, str], page: LivePage
) -> list[PhaseTiming]:
    """Run the phases that are not done; how long each took, with start and end of its nodes."""
    if not folder.demonstrated(settings):
        folder.set_partial_bag_aside()
    if _LAYOUT.is_file():  # as in a checkout
        atomic_write_text(folder.layout, _LAYOUT.read_text(encoding="utf-8"))
    phases = phases_of(folder, settings)
    for phase in phases:
        if phase.is_done():
            continue
        began_s, is_shown = time.monotonic(), phase.drives is not None
        run_stack(
            phase.name,
            {**phase.parameters, **(page.parameters() if is_shown else {})},
            environment,
            total=phase.n_parts,
            logs=folder.logs,
            on_address=page.show if is_shown else None,
        )
        if not phase.is_done():  # a node ended early, even without an error of its own
            raise RunError(f"{phase.name} ended before it was done; see logs/{phase.name}.log")
        folder.note_wall_time(phase.name, time.monotonic() - began_s)
    wall_s, simulated_s = folder.wall_times_s(), {}
    for phase in phases:
        if phase.drives is not None:
            simulated_s[phase.name] = sum(row.duration_s for row in folder.episodes(phase.drives))
    return [
        PhaseTiming(phase.name, wall_s[phase.name], simulated_s.get(phase.name))
        for phase in phases
        if phase.name in wall_s
    ]
