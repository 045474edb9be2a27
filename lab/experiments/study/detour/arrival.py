"""Times of arrival on the transfer task: predicted by the learned dynamics, and driven."""

from typing import Any

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.arrival.stage import STEP_S, arrival_by_chain
from lab.experiments.study.detour.fits import EXPERT, REWARDS
from lab.experiments.study.detour.settings import DetourStudy
from lab.experiments.study.products import load_part
from lab.experiments.study.recordings.drives import Purpose, drive_in, world_seed
from lab.experiments.study.recordings.reference import reference_decisions
from lab.experiments.study.study import TRANSFER_AREA
from serd_core.arrays import FloatArray
from serd_core.dynamics.estimation import estimate_dynamics
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.drivers.strategy import start_distribution

#: Features of the models that drive; predictions are made for all.
DRIVEN = next(iter(REWARDS))


def arrive_repetition(study: DetourStudy, expert: str, repetition: int) -> dict[str, Any]:
    """rows: of each model the predicted median under its own and under the true dynamics; driven.

    Seconds; None where less than half arrive within the time limit. driven: one time per episode,
    cut off at the time limit. Equal policies drive alike in equal worlds, so each drives once.
    """
    models = load_part(study, "fits", expert, repetition)["models"]
    reference = reference_decisions(study)
    truth = estimate_dynamics(study.problem, reference), study.laws_of(reference)
    driven = dict[tuple[int, ...], list[float]]()
    rows: list[Row] = []
    for model in models:
        greedy = tuple(model["greedy"])
        policy = study.policy_of(np.array(greedy))
        row = {name: model[name] for name in ("repetition", "size", "reward", "method")}
        row["predicted"] = median_s(
            study, policy, np.array(model["truth"]), np.array(model["laws"])
        )
        row["predicted_by_truth"] = median_s(study, policy, *truth)
        if model["reward"] == DRIVEN:
            if greedy not in driven:
                driven[greedy] = drive(study, repetition, policy)
            row["driven"] = driven[greedy]
        rows.append(row)
    return {"rows": rows}


def median_s(
    study: DetourStudy, policy: FloatArray, outcomes: FloatArray, laws: FloatArray
) -> float | None:
    """Seconds until half have arrived from the transfer area."""
    starts = start_distribution(study.scenario, TRANSFER_AREA)
    found = arrival_by_chain(study, policy, outcomes, laws, starts)
    reached = np.flatnonzero(found.cdf >= 0.5)
    return STEP_S * int(reached[0]) if reached.size else None


def drive(study: DetourStudy, repetition: int, policy: FloatArray) -> list[float]:
    """Seconds of each episode, cut off at the time limit."""
    seed = world_seed(study.settings.seed, EXPERT, repetition, Purpose.MEASUREMENT)
    drives = drive_in(
        study.scenario,
        study.problem,
        PolicyDriver(study.problem.grid, policy, seed=seed),
        seed=seed,
        starts=[(episode, TRANSFER_AREA) for episode in range(study.settings.drives)],
    )
    return [record.duration_s for record in drives.records]
