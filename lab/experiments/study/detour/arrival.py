"""Times of arrival on the transfer task: predicted by the learned dynamics, and driven."""

from typing import Any

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.arrival.stage import n_periods
from lab.experiments.study.detour.fits import EXPERT, REWARDS
from lab.experiments.study.detour.settings import DetourStudy
from lab.experiments.study.products import load_part
from lab.experiments.study.recordings.drives import Purpose, drive_in, world_seed
from lab.experiments.study.recordings.reference import reference_dynamics
from lab.experiments.study.study import TRANSFER_AREA
from serd_app.navigation.strategy import start_distribution
from serd_core.arrays import FloatArray
from serd_core.arrival.chain import arrival_time_distribution
from serd_sim.drivers.policy_driver import PolicyDriver

#: Features of the models that drive; predictions are made for all.
DRIVEN = next(iter(REWARDS))


def arrive_repetition(study: DetourStudy, expert: str, repetition: int) -> dict[str, Any]:
    """rows: of each model the predicted median under its own and under the true dynamics; driven.

    Periods; None where less than half arrive within the time limit. driven: one time per episode,
    cut off at the time limit. Equal policies drive alike in equal worlds, so each drives once.
    """
    models = load_part(study, "fits", expert, repetition)["models"]
    truth, driven = reference_dynamics(study), dict[tuple[int, ...], list[float]]()
    rows: list[Row] = []
    for model in models:
        greedy = tuple(model["greedy"])
        policy = study.policy_of(np.array(greedy))
        row = {name: model[name] for name in ("repetition", "size", "reward", "method")}
        row["predicted"] = median_periods(study, policy, np.array(model["truth"]))
        row["predicted_by_truth"] = median_periods(study, policy, truth)
        if model["reward"] == DRIVEN:
            if greedy not in driven:
                driven[greedy] = drive(study, repetition, policy)
            row["driven"] = driven[greedy]
        rows.append(row)
    return {"rows": rows}


def median_periods(study: DetourStudy, policy: FloatArray, dynamics: FloatArray) -> int | None:
    """Decision periods until half have arrived from the transfer area."""
    found = arrival_time_distribution(
        study.problem,
        policy,
        dynamics,
        start_distribution(study.scenario, TRANSFER_AREA),
        n_periods(study.scenario),
    )
    reached = np.flatnonzero(found.cdf >= 0.5)
    return int(reached[0]) if reached.size else None


def drive(study: DetourStudy, repetition: int, policy: FloatArray) -> list[float]:
    """Decision periods of each episode, cut off at the time limit."""
    seed = world_seed(study.settings.seed, EXPERT, repetition, Purpose.MEASUREMENT)
    drives = drive_in(
        study.scenario,
        study.problem,
        study.settings.planner,
        PolicyDriver(study.problem.grid, policy, seed=seed),
        seed=seed,
        starts=[(episode, TRANSFER_AREA) for episode in range(study.settings.drives)],
    )
    return [record.duration_s / study.scenario.decision_period_s for record in drives.records]
