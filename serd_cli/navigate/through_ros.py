"""Episodes of the strategy through the nodes of the stack `navigate`, in lock-step."""

import os
from pathlib import Path

from domain_coordinator import domain_id

from serd_cli.demo.phase_progress import PhaseProgress
from serd_cli.navigate.settings import NavigateSettings
from serd_cli.node_commands import stack_processes
from serd_cli.supervisor import run_together
from serd_cli.workspace import ros_environment
from serd_ros.graph.graph import find_stack
from storage.episode_table import EpisodeResult, load_episodes


def drive_through_ros(settings: NavigateSettings, output: Path) -> list[EpisodeResult]:
    """Drive all episodes from the first; the strategy writes its tables to the output folder."""
    given = {
        **settings.of_strategy(),
        "start_area": settings.start_area,
        **({} if settings.people is None else {"people": settings.people}),
        "local_planner.planner": settings.planner,
        "strategy.output": str(output),
    }
    with domain_id() as domain:
        environment = ros_environment(os.environ)
        environment["ROS_DOMAIN_ID"] = str(domain)
        environment["ROS_LOG_DIR"] = str(output / "logs" / "ros")
        environment.setdefault("OMP_NUM_THREADS", "1")
        environment.setdefault("OPENBLAS_NUM_THREADS", "1")
        processes = stack_processes(find_stack("navigate"), given, environment)
        log = output / "logs" / "navigate.log"
        with PhaseProgress("navigate", settings.episodes, log) as progress:
            run_together(processes, environment, progress.hear)
            progress.finish()
    return list(load_episodes(output / "episodes.csv"))
