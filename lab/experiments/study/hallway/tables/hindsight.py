"""Causes of wrong predictions: arrivals predicted under other estimates of the dynamics.

Three things separate a prediction from the measurement. First, each repetition learns from few
decisions, and the uniform prior pulls on its estimate; dynamics estimated from the demonstrations
of all repetitions together ("pooled") remove this. Second, the world may answer demonstrators
differently from the robot; dynamics estimated from the measured drives ("hindsight") remove this.
They are not available before driving, and they are compared with the drives they are estimated
from, which flatters them by as little as 20 probabilities can. Third, the form of the model
remains: few outcome models for all places, whole periods.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from lab.experiments.running.tables import Row
from lab.experiments.study.arrival.distances import ArrivalTables, distances, ks_p_value
from lab.experiments.study.arrival.stage import arrival_by_chain
from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.recordings.experts import EXPERTS
from lab.experiments.study.recordings.moves import decisions_of_moves
from serd_core.arrays import FloatArray
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import ACROSS_FLOW, WITH_FLOW

_COMPARED = ("measured_mean_s", "predicted_mean_s", "ks", "wasserstein_s", "crps_s")


def hindsight_table(results: Results) -> pd.DataFrame:
    """All predictions side by side, with each estimate's probability that a move fails.

    Methods that do not always arrive have no other predictions: drives that end in a trap sample
    waiting in it, and little else. decisions: number of moves behind each estimate.
    """
    rng = np.random.default_rng([results.settings.seed, 5])
    table: list[Row] = []
    for expert in EXPERTS:
        pooled = _estimate(results, results.demonstrated(expert), "demonstrations")
        for method in results.methods(expert):
            learned = results.arrival_tables(expert, method)
            arrived = bool((learned.measured[:, -1] >= 1.0).all())
            row: Row = {"expert": expert, "method": method, "always_arrived": arrived}
            row |= _columns(
                "learned", learned, results.models(expert, method, "truth").mean(axis=0)
            )
            moves = results.moves(expert, method)
            hindsight = _estimate(results, moves, "measured drives") if moves else None
            for kind, estimate in (("pooled", pooled), ("hindsight", hindsight)):
                row |= _predicted(results, expert, method, kind, estimate if arrived else None, rng)
            table.append(row)
    counts = dict.fromkeys(["pooled_decisions", "hindsight_decisions"], "Int64")
    return pd.DataFrame(table).astype(counts)


def _estimate(
    results: Results, moves: Sequence[Sequence[int]], source: str
) -> tuple[FloatArray, int]:
    """(M, K) M-estimate of the dynamics, and the number of decisions it is made from."""
    decisions = decisions_of_moves(moves, source)
    return estimate_dynamics(results.problem, decisions), len(decisions)


def _predicted(
    results: Results,
    expert: str,
    method: str,
    kind: str,
    estimate: tuple[FloatArray, int] | None,
    rng: np.random.Generator,
) -> Row:
    """Columns of a prediction under an estimate, and the test of it; empty without one."""
    count, p_value = f"{kind}_decisions", f"{kind}_ks_p_value"
    if estimate is None:
        return {count: None} | _columns(kind, None, None) | {p_value: None}
    dynamics, n_decisions = estimate
    tables = tables_under(results, expert, method, dynamics)
    return {
        count: n_decisions,
        **_columns(kind, tables, dynamics),
        p_value: ks_p_value(tables, results.settings.statistics.bootstrap, rng),
    }


def tables_under(results: Results, expert: str, method: str, dynamics: FloatArray) -> ArrivalTables:
    """As `Results.arrival_tables`, with every policy's arrival predicted under other dynamics."""
    predicted = [
        arrival_by_chain(results, greedy, dynamics).cdf
        for greedy in results.models(expert, method, "greedy")
    ]
    return replace(results.arrival_tables(expert, method), predicted=np.array(predicted))


def _columns(kind: str, tables: ArrivalTables | None, dynamics: FloatArray | None) -> Row:
    """Columns of one kind of prediction; empty where there is none."""
    found: Row = dict.fromkeys(_COMPARED) if tables is None else distances(tables)
    row: Row = {f"{kind}_{name}": found[name] for name in _COMPARED}
    for name, model in (("with", WITH_FLOW), ("across", ACROSS_FLOW)):
        stay = None if dynamics is None else float(dynamics[model, Outcome.STAY])
        row[f"{kind}_stay_{name}_flow"] = stay
    return row
