"""Demonstrations of the hallway experiment, recorded once in the simulator and kept as tables.

The scripted expert demonstrates the training and the transfer task; a robot that wanders at random
visits what no expert shows, so that all recordings together give a better model of the dynamics.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.repetitions import Progress, claim_folder
from serd_core.arrays import FloatArray
from serd_core.demonstrations import Decisions
from serd_core.estimation import estimate_dynamics
from serd_core.likelihood.observations import explained
from serd_core.navigation import NavigationProblem
from sim.driver import Driver
from sim.episode import run_episode
from sim.expert import ScriptedExpert
from sim.planners import make_planner
from sim.policy_driver import PolicyDriver
from sim.scenario import Scenario
from sim.world import HallwayWorld
from storage.decision_table import load_decisions, save_decisions


@dataclass(frozen=True)
class RecordingPlan:
    """How many episodes of each kind are recorded; wander_s: time-out of a wandering robot."""

    n_training: int = 20
    n_test: int = 10
    n_transfer: int = 10
    n_wandering: int = 20
    wander_s: float = 120.0
    planner: str = "dwa"
    seed: int = 1


@dataclass(frozen=True, eq=False)
class HallwayData:
    """Decisions of each set, and (M, K) dynamics estimated from all of them."""

    training: Decisions
    test: Decisions
    transfer: Decisions
    wandering: Decisions
    dynamics: FloatArray


def hallway_data(
    scenario: Scenario,
    problem: NavigationProblem,
    plan: RecordingPlan,
    folder: Path,
    progress: Progress,
) -> HallwayData:
    """Load the tables of `folder`, or record what is missing."""
    claim_folder(folder, f"{plan!r} {scenario!r}")
    available = problem.mdp.available
    wander = PolicyDriver(
        problem.grid,
        available / available.sum(axis=1, keepdims=True),
        seed=plan.seed,
        greedy=False,
        name="wandering",
    )
    expert = ScriptedExpert(scenario, plan.seed)
    # Episode numbers differ between the sets, so no two share their people and starts.
    sets: dict[str, tuple[Driver, str, range, float | None]] = {
        "training": (expert, "train", range(plan.n_training), None),
        "test": (expert, "train", range(1_000, 1_000 + plan.n_test), None),
        "transfer": (expert, "transfer", range(2_000, 2_000 + plan.n_transfer), None),
        "wandering": (wander, "train", range(3_000, 3_000 + plan.n_wandering), plan.wander_s),
    }
    tables = {}
    for done, (name, (driver, area, episodes, timeout_s)) in enumerate(sets.items()):
        progress(done, len(sets))
        file = folder / f"{name}.csv"
        if not file.exists():
            recorded = _record(scenario, plan, driver, area, episodes, timeout_s)
            save_decisions(file, recorded.select(explained(problem.mdp, recorded)))
        tables[name] = load_decisions(file)
    progress(len(sets), len(sets))
    everything = together(tuple(tables.values()))
    return HallwayData(**tables, dynamics=estimate_dynamics(problem, everything))


def together(tables: tuple[Decisions, ...]) -> Decisions:
    """All rows of several tables, one after the other."""
    return Decisions(
        episode=np.concatenate([table.episode for table in tables]),
        time_s=np.concatenate([table.time_s for table in tables]),
        state=np.concatenate([table.state for table in tables]),
        action=np.concatenate([table.action for table in tables]),
        next_state=np.concatenate([table.next_state for table in tables]),
        source="; ".join(dict.fromkeys(table.source for table in tables)),
    )


def _record(
    scenario: Scenario,
    plan: RecordingPlan,
    driver: Driver,
    area: str,
    episodes: range,
    timeout_s: float | None,
) -> Decisions:
    planner = make_planner(plan.planner, scenario)
    with HallwayWorld(scenario, seed=plan.seed) as world:
        records = [
            run_episode(
                world, planner, driver, episode=episode, start_area=area, timeout_s=timeout_s
            )
            for episode in episodes
        ]
    return together(tuple(record.decisions for record in records))
