"""The three phases that run stacks of nodes; each is skipped when its result exists."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serd_app.report.inputs import PhaseTiming
from serd_bag.files import atomic_write_text
from serd_cli.demo.folder import DemoFolder, DemoSettings
from serd_cli.errors import RunError
from serd_cli.processes.stack_run import run_stack
from serd_cli.processes.workspace import PROJECT

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
    return (
        Phase(
            "demonstrate",
            lambda: folder.demonstrated(settings),
            {
                "scenario": settings.scenario,
                "seed": settings.seed,
                "scripted_expert.episodes": settings.demonstrations,
                "timeout_s": settings.timeout_s,
                "scripted_expert.output": str(folder.demonstrations),
                "demo_recorder.output": str(folder.bag),
            },
            settings.demonstrations,
            folder.demonstrations,
        ),
        Phase(
            "learn",
            folder.learned,
            {
                "scenario": settings.scenario,
                "seed": settings.seed,
                "bag": str(folder.bag),
                "learner.output": str(folder.model),
                "decisions": str(folder.decisions),
            },
            1,
        ),
        Phase(
            "navigate",
            lambda: folder.navigated(settings),
            {
                "scenario": settings.scenario,
                "seed": settings.navigation_seed,
                "model": str(folder.model),
                "policy": settings.policy,
                "episodes": settings.episodes,
                "timeout_s": settings.timeout_s,
                "strategy.output": str(folder.navigation),
            },
            settings.episodes,
            folder.navigation,
        ),
    )


def run_phases(
    folder: DemoFolder, settings: DemoSettings, environment: Mapping[str, str]
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
        began_s = time.monotonic()
        run_stack(phase.name, phase.parameters, environment, total=phase.n_parts, logs=folder.logs)
        if not phase.is_done():  # a node ended early, even without an error of its own
            raise RunError(f"{phase.name} ended before it was done; see logs/{phase.name}.log")
        folder.note_wall_time(phase.name, time.monotonic() - began_s)
    wall_s = folder.wall_times_s()
    return [
        PhaseTiming(phase.name, wall_s[phase.name], _simulated_s(phase))
        for phase in phases
        if phase.name in wall_s
    ]


def _simulated_s(phase: Phase) -> float | None:
    """What the episodes of a phase lasted in all, None where it drove none."""
    if phase.drives is None:
        return None
    return sum(episode.duration_s for episode in DemoFolder.episodes(phase.drives))
