"""The three phases that run node stacks; each is skipped when its product is already there."""

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from domain_coordinator import domain_id

from report.inputs import PhaseTiming
from serd_cli.demo.folder import DemoFolder
from serd_cli.demo.phase_progress import PhaseProgress
from serd_cli.demo.settings import DemoSettings
from serd_cli.errors import RunError
from serd_cli.node_commands import stack_processes
from serd_cli.supervisor import run_together
from serd_cli.workspace import ros_environment
from serd_ros.graph.graph import find_stack
from serd_ros.parameters.configs import LearnerConfig
from storage.episode_table import EpisodeResult


@contextmanager
def demo_environment(folder: DemoFolder) -> Iterator[dict[str, str]]:
    """Environment of the nodes: a ROS domain nobody else uses, logs inside the folder."""
    with domain_id() as domain:
        environment = ros_environment(os.environ)
        environment["ROS_DOMAIN_ID"] = str(domain)
        environment["ROS_LOG_DIR"] = str(folder.logs / "ros")
        environment.setdefault("OMP_NUM_THREADS", "1")
        environment.setdefault("OPENBLAS_NUM_THREADS", "1")
        yield environment


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
        _run(folder, "demonstrate", given, environment, total=settings.demonstrations)
        _require(folder.demonstrated(settings), "demonstrate")
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
        n_fits = len(LearnerConfig().prior_weights) + 1
        _run(folder, "learn", given, environment, total=n_fits)
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
        _run(folder, "navigate", given, environment, total=settings.episodes)
        _require(folder.navigated(settings), "navigate")
    return _driven("navigate", folder.episodes(folder.navigation))


def _run(
    folder: DemoFolder,
    name: str,
    given: Mapping[str, Any],
    environment: Mapping[str, str],
    *,
    total: int,
) -> None:
    processes = stack_processes(find_stack(name), given, environment)
    with PhaseProgress(name, total, folder.logs / f"{name}.log") as progress:
        run_together(processes, environment, progress.hear)
        progress.finish()


def _require(done: bool, name: str) -> None:
    """A node that ends early without an error, because somebody told it to, is one all the same."""
    if not done:
        raise RunError(f"{name} ended before it was done; see logs/{name}.log")


def _driven(name: str, episodes: tuple[EpisodeResult, ...]) -> PhaseTiming:
    """Wall time from first to last observation of each episode, as the driver measured it."""
    return PhaseTiming(
        name,
        wall_s=sum(episode.wall_s for episode in episodes),
        simulated_s=sum(episode.duration_s for episode in episodes),
    )
