"""Belief or truth, chosen by evidence, for the recorded people of the hallway.

    python -m lab belief-recorded

It goes on where it was stopped. Learned from random subsets of the training recordings, scored by
the log-likelihood per decision of the test and transfer recordings. Subsets share episodes, so
their rows are not independent.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lab.benchmarks.learning.belief_choice import policies_of
from lab.benchmarks.report import measured_rows, save
from lab.experiments.study.recordings.demonstrations import ROLES, sets_from_bags
from lab.experiments.study.settings import study_settings
from lab.experiments.study.study import Study
from serd_core.bayes.belief_comparison import compare_beliefs
from serd_core.posterior.beliefs import TiedBelief
from serd_core.selection.evaluation import policy_log_likelihood

BAGS = Path(__file__).parents[3] / "bags" / "data" / "hallway"
SIZES = (2, 5, 10, 15)
N_SUBSETS = 20


def run() -> None:
    """Measure the subsets that are missing, then write the table."""
    cases = [{"demonstrations": n, "subset": k} for n in SIZES for k in range(N_SUBSETS)]
    rows = measured_rows("belief_recorded", cases, measure)
    save("belief_recorded", "Belief or truth of the recorded people, by evidence", summary(rows))


def measure(demonstrations: int, subset: int) -> dict[str, Any]:
    """Probability of each relation; log-likelihood of what is held out by tied, free, chosen."""
    study = Study(study_settings(bags=[BAGS / role for role in ROLES]), Path())
    sets = sets_from_bags(study, repetition=0)
    rng = np.random.default_rng([demonstrations, subset])
    episodes = rng.permutation(sets.training.episodes)[:demonstrations]
    found = compare_beliefs(study.problem, sets.training.select_episodes(sorted(episodes)))
    shares = zip(found.relations, found.probabilities.tolist(), strict=True)
    row: dict[str, Any] = {type(relation).__name__: share for relation, share in shares}
    for name, policy in policies_of(found).items():
        row[f"test, {name}"] = policy_log_likelihood(study.problem, sets.test, policy)
        row[f"transfer, {name}"] = policy_log_likelihood(study.problem, sets.transfer, policy)
    return row | {"left out": list(found.left_out)}


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row per size and recording."""
    return [
        _summary(size, held_out, [row for row in rows if row["demonstrations"] == size])
        for size in SIZES
        for held_out in ("test", "transfer")
    ]


def _summary(size: int, held_out: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    both = [row for row in rows if {f"{held_out}, tied", f"{held_out}, free"} <= row.keys()]
    tied, free, chosen = (
        np.array([row[f"{held_out}, {name}"] for row in both])
        for name in ("tied", "free", "chosen")
    )
    gain = chosen - tied
    return {
        "demonstrations": size,
        "held out": held_out,
        "subsets": len(rows),
        "left out": sum(bool(row["left out"]) for row in rows),
        "decided not tied": float(
            np.mean([row.get(TiedBelief.__name__, 0) < 0.05 for row in rows])
        ),
        "tied": float(tied.mean()),
        "free better by": float((free - tied).mean()),
        "chosen better by": float(gain.mean()),
        "worst": float(gain.min()),
        "best": float(gain.max()),
    }
