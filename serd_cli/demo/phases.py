"""The three phases that run stacks of nodes; each is skipped when its result exists."""

import time
from collections.abc import Mapping

from serd_app.report.inputs import PhaseTiming
from serd_bag.files import atomic_write_text
from serd_cli.demo.folder import DemoFolder, DemoSettings
from serd_cli.errors import RunError
from serd_cli.processes.node_commands import shared_file
from serd_cli.processes.stack_run import run_stack
from serd_files.episode_table import EpisodeResult
from serd_ros.graph.graph import PACKAGE


def demonstrate(
    folder: DemoFolder, settings: DemoSettings, environment: Mapping[str, str]
) -> PhaseTiming:
    """The expert drives while its episodes are recorded into the bag."""
    if not folder.demonstrated(settings):
        folder.set_partial_bag_aside()
        given = {
            "scenario": settings.scenario,
            "seed": settings.seed,
            "scripted_expert.episodes": settings.demonstrations,
            "timeout_s": settings.timeout_s,
            "scripted_expert.output": str(folder.demonstrations),
            "demo_recorder.output": str(folder.bag),
        }
        total = settings.demonstrations
        run_stack("demonstrate", given, environment, total=total, logs=folder.logs)
        _require(folder.demonstrated(settings), "demonstrate")
    # Installed by pip alone there is no workspace with a layout.
    if layout := shared_file(PACKAGE, "foxglove/serd.json", environment):
        atomic_write_text(folder.layout, layout.read_text(encoding="utf-8"))
    return _driven("demonstrate", folder.episodes(folder.demonstrations))


def learn(
    folder: DemoFolder, settings: DemoSettings, environment: Mapping[str, str]
) -> PhaseTiming:
    """Rewards and dynamics are learned from the bag."""
    began_s = time.monotonic()
    if not folder.learned():
        given = {
            "scenario": settings.scenario,
            "seed": settings.seed,
            "bag": str(folder.bag),
            "learner.output": str(folder.model),
            "decisions": str(folder.decisions),
        }
        run_stack("learn", given, environment, total=1, logs=folder.logs)
        _require(folder.learned(), "learn")
    return PhaseTiming("learn", time.monotonic() - began_s)


def navigate(
    folder: DemoFolder, settings: DemoSettings, environment: Mapping[str, str]
) -> PhaseTiming:
    """The learned policy drives new episodes in a world of another seed."""
    if not folder.navigated(settings):
        given = {
            "scenario": settings.scenario,
            "seed": settings.navigation_seed,
            "model": str(folder.model),
            "policy": settings.policy,
            "episodes": settings.episodes,
            "timeout_s": settings.timeout_s,
            "strategy.output": str(folder.navigation),
        }
        total = settings.episodes
        run_stack("navigate", given, environment, total=total, logs=folder.logs)
        _require(folder.navigated(settings), "navigate")
    return _driven("navigate", folder.episodes(folder.navigation))


def _require(done: bool, name: str) -> None:
    """RunError where a phase ended early, even without an error of its own."""
    if not done:
        raise RunError(f"{name} ended before it was done; see logs/{name}.log")


def _driven(name: str, episodes: tuple[EpisodeResult, ...]) -> PhaseTiming:
    """Wall time from first to last observation of each episode, as the driver measured it."""
    return PhaseTiming(
        name,
        wall_s=sum(episode.wall_s for episode in episodes),
        simulated_s=sum(episode.duration_s for episode in episodes),
    )
