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
from experiments.study.arrival_distances import ArrivalTables, distances, ks_p_value
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

_COMPARED = ("measured_mean_s", "predicted_mean_s", "ks", "wasserstein_s", "crps_s")


def hindsight_table(results: Results) -> list[Row]:
    """Learned and hindsight predictions side by side, and how likely a move fails under each.

    No hindsight on methods that do not always arrive: drives that end in a trap show how waiting
    in it goes, and little else. decisions: of how many moves the hindsight is made.
    """
    rng = np.random.default_rng([results.settings.seed, 5])
    table: list[Row] = []
    for expert in EXPERTS:
        for method in results.methods(expert):
            learned = results.arrival_tables(expert, method)
            row: Row = {"expert": expert, "method": method}
            row |= {"always_arrived": bool((learned.measured[:, -1] >= 1.0).all())}
            row |= {"decisions": sum(count for *_, count in results.moves(expert, method))}
            row |= _told("learned", learned, _mean_truth(results, expert, method))
            hindsight, own = None, None
            if row["always_arrived"] and row["decisions"]:
                own = dynamics_of_drives(results, expert, method)
                hindsight = hindsight_tables(results, expert, method, own)
            row |= _told("hindsight", hindsight, own)
            p_value = hindsight and ks_p_value(
                hindsight, results.settings.statistics.bootstrap, rng
            )
            table.append(row | {"hindsight_ks_p_value": p_value})
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


def _told(kind: str, tables: ArrivalTables | None, dynamics: FloatArray | None) -> Row:
    """Columns of one kind of prediction; empty where there is none."""
    found: Row = dict.fromkeys(_COMPARED) if tables is None else distances(tables)
    row: Row = {f"{kind}_{name}": found[name] for name in _COMPARED}
    for name, model in (("with", WITH_FLOW), ("across", ACROSS_FLOW)):
        stay = None if dynamics is None else float(dynamics[model, Outcome.STAY])
        row[f"{kind}_stay_{name}_flow"] = stay
    return row
