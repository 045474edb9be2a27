"""What would have been predicted, had it been known how the world answers the robot itself.

A prediction may be wrong because the world answers people who demonstrate otherwise than the robot
(they hesitate, it does not), or because of the form of the model (few outcome models for all
places, whole periods). Under dynamics estimated from the measured drives themselves the first
reason is gone; what is left is the second. Nobody could predict so beforehand, and that the same
drives are estimated from and compared with flatters it, by as little as 20 probabilities can.
"""

from dataclasses import replace

import numpy as np

from experiments.repetitions import Row
from experiments.study.arrival_distances import ArrivalTables, distance_row
from experiments.study.demonstrations import n_repetitions
from experiments.study.experts import EXPERTS
from experiments.study.moves import decisions_of_moves
from experiments.study.results import Results
from experiments.study.world import TRAIN_AREA, start_shares
from serd_core.arrays import FloatArray
from serd_core.arrival import arrival_time_distribution
from serd_core.estimation import estimate_dynamics
from serd_core.grid import Outcome
from serd_core.navigation import ACROSS_FLOW, WITH_FLOW

_COMPARED = ("predicted_mean_s", "ks", "ks_p_value", "wasserstein_s", "crps_s")


def hindsight_table(results: Results) -> list[Row]:
    """Learned and hindsight predictions side by side, and how likely a move fails under each."""
    rng = np.random.default_rng([results.settings.seed, 5])
    statistics = results.settings.statistics
    table: list[Row] = []
    for expert in EXPERTS:
        for method in results.methods(expert):
            own = dynamics_of_drives(results, expert, method)
            learned = results.arrival_tables(expert, method)
            rows = {
                "learned": distance_row(learned, statistics, rng),
                "hindsight": distance_row(
                    hindsight_tables(results, expert, method, own), statistics, rng
                ),
            }
            row: Row = {"expert": expert, "method": method}
            row["measured_mean_s"] = rows["learned"]["measured_mean_s"]
            for name in _COMPARED:
                row |= {f"{kind}_{name}": found[name] for kind, found in rows.items()}
            row |= _standing("learned", _mean_truth(results, expert, method))
            table.append(row | _standing("hindsight", own))
    return table


def dynamics_of_drives(results: Results, expert: str, method: str) -> FloatArray:
    """(M, K) M-estimate from the measured drives of all repetitions."""
    return estimate_dynamics(
        results.problem, decisions_of_moves(results.moves(expert, method), "measured drives")
    )


def hindsight_tables(
    results: Results, expert: str, method: str, dynamics: FloatArray
) -> ArrivalTables:
    """As `Results.arrival_tables`, with every policy's arrival predicted under other dynamics."""
    learned, problem = results.arrival_tables(expert, method), results.problem
    starts = start_shares(results.scenario, problem, TRAIN_AREA)
    predicted = [
        arrival_time_distribution(
            problem,
            np.eye(problem.mdp.n_actions)[
                np.array(results.model(expert, number, method)["greedy"])
            ],
            dynamics,
            starts,
            learned.predicted.shape[1] - 1,
        ).cdf
        for number in range(n_repetitions(results.settings, expert))
    ]
    return replace(learned, predicted=np.array(predicted))


def _mean_truth(results: Results, expert: str, method: str) -> FloatArray:
    """(M, K) mean of the dynamics learned in each repetition."""
    every = range(n_repetitions(results.settings, expert))
    learned = np.array([results.model(expert, number, method)["truth"] for number in every])
    return np.asarray(learned.mean(axis=0))


def _standing(kind: str, dynamics: FloatArray) -> Row:
    return {
        f"{kind}_stay_with_flow": float(dynamics[WITH_FLOW, Outcome.STAY]),
        f"{kind}_stay_across_flow": float(dynamics[ACROSS_FLOW, Outcome.STAY]),
    }
