"""It takes about two minutes; 'serd navigate MODEL --episodes 200' drives more."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from rich.text import Text

from serd_app.report.inputs import PhaseTiming
from serd_bag.files import atomic_write_text
from serd_bag.quantities import counted
from serd_cli.errors import RunError
from serd_cli.options import AsJson, free_folder, opt, resolved_scenario, validated, with_settings
from serd_cli.output.demo_folder import DemoFolder, DemoSettings
from serd_cli.output.terminal import progress_console
from serd_cli.processes.stack_run import PAGE, port_fault, run_stack, stack_environment
from serd_cli.processes.workspace import PROJECT
from serd_files.yaml_config import load_yaml_model, save_yaml_model
from serd_ros.settings import WatchPageConfig
from serd_sim.scenario.scenario import load_scenario

_LAYOUT = PROJECT / "ros_ws/src/serd_bringup/foxglove/serd.json"


@dataclass(frozen=True)
class Phase:
    """One stack with its parameters, named after the stack.

    n_parts: how many parts it has; last: the file that is written last, but for the table of
    episodes in the folder drives.
    """

    name: str
    parameters: Mapping[str, Any]
    n_parts: int
    last: Path
    drives: Path | None = None

    @property
    def is_done(self) -> bool:
        """Whether all that it makes is there."""
        n_driven = self.n_parts if self.drives is None else len(DemoFolder.episodes(self.drives))
        return n_driven >= self.n_parts and self.last.is_file()


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
            here | demonstrate,
            settings.demonstrations,
            folder.bag / "metadata.yaml",
            folder.demonstrations,
        ),
        Phase("learn", here | learn, 1, folder.model),
        Phase("navigate", here | navigate, settings.episodes, folder.model, folder.navigation),
    )


def page_parameters() -> dict[str, int]:
    """The port of the page that shows the drives: the usual one, or any free one."""
    usual = WatchPageConfig()
    return {f"{PAGE}.port": 0 if port_fault(usual.address, usual.port) else usual.port}


def _show(address: str) -> None:
    progress_console.print(Text.assemble("watch the drives at ", (address, "bold")))


def run_phases(
    folder: DemoFolder, settings: DemoSettings, environment: Mapping[str, str]
) -> list[PhaseTiming]:
    """Run the phases that are not done; how long each took, with start and end of its nodes."""
    if _LAYOUT.is_file():  # as in a checkout
        atomic_write_text(folder.layout, _LAYOUT.read_text(encoding="utf-8"))
    timings: list[PhaseTiming] = []
    phases = phases_of(folder, settings)
    if folder.bag.exists() and not phases[0].is_done:
        folder.bag.rename(free_folder(folder.root, "unfinished") / "bag")
    for phase in phases:
        if phase.is_done:
            continue
        began_s, drives = time.monotonic(), phase.drives
        run_stack(
            phase.name,
            {**phase.parameters, **(page_parameters() if drives else {})},
            environment,
            total=phase.n_parts,
            logs=folder.logs,
            on_address=_show if drives else None,
        )
        if not phase.is_done:
            raise RunError(f"{phase.name} ended before it was done; see logs/{phase.name}.log")
        simulated_s = sum(row.duration_s for row in folder.episodes(drives)) if drives else None
        timings.append(PhaseTiming(phase.name, time.monotonic() - began_s, simulated_s))
    return timings


@with_settings(DemoSettings)
def demo(
    output: Annotated[Path, opt("folder that gets a run-N folder")] = Path("demo_output"),
    resume: Annotated[Path | None, opt("continue this run-N folder; its settings count")] = None,
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Run the phases that are not done and print the report's summary."""
    if resume is not None:
        folder = DemoFolder(resume)
        settings = load_yaml_model(folder.settings, DemoSettings)
    else:
        load_scenario(options["scenario"])
        absolute = {"scenario": resolved_scenario(options["scenario"])}
        settings = validated(DemoSettings, **(options | absolute))
        folder = DemoFolder(free_folder(output, "run"))
        save_yaml_model(folder.settings, settings)
    progress_console.print(
        f"{counted(settings.demonstrations, 'demonstration')} and"
        f" {counted(settings.episodes, 'episode')} through ROS 2; results go to {folder.root}",
        soft_wrap=True,
    )
    try:
        with stack_environment(folder.logs) as environment:
            phases = run_phases(folder, settings, environment)
    except (KeyboardInterrupt, RunError):
        again = f"continue with: serd demo --resume {folder.root}"
        progress_console.print(again, soft_wrap=True)
        raise
    from serd_cli.output.demo import report_demo

    report_demo(folder, settings, phases, as_json=as_json)
