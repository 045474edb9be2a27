"""One fold: learn from its people, predict moves and times of arrival of those who are held out."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.people.folds import Fold
from lab.experiments.study.people.learners import LEARNERS, Prediction, Task
from lab.experiments.study.people.people import Asked, People, evenly
from lab.experiments.study.people.walkers import CONSTANT_VELOCITY, straight_laws
from serd_core.arrays import BoolArray
from serd_core.arrival.law import ArrivalLaw, crps_s
from serd_core.demonstrations.decisions import TimedDecisions

#: Probability that no move is less likely than.
FLOOR = 1e-4
INTERVALS = (0.5, 0.9)


def task_of(people: People, training: BoolArray) -> Task:
    """What is learned from the people of a mask (P,), or from some of them evenly chosen."""
    chosen = evenly(training, people.settings.training_people)
    decisions = people.decisions_of(chosen)
    flow = people.place.flow(decisions, people.signs_of(decisions))
    return Task(people.place, people.place.problem(flow), decisions, people.times_s)


def run_fold(people: People, fold: Fold, number: int) -> dict[str, Any]:
    """moves: log-likelihoods by method; arrivals: a row per person and method; fits: records."""
    task, asked = task_of(people, fold.training), people.asked_of(fold.test)
    held_out = people.decisions_of(fold.test)
    place, moves, fits = {"fold": number}, list[Row](), list[Row]()
    arrivals = scored(CONSTANT_VELOCITY, asked, straight_laws(people, fold.training, asked))
    for method, learn in LEARNERS.items():
        found = learn(task)
        row = {"method": method, "n_moves": len(held_out)}
        moves.append(place | row | {"log_likelihood": log_likelihood(found, held_out)})
        arrivals += scored(method, asked, laws_of(task, found, asked))
        fits.append(place | {"method": method, "n_decisions": len(task.decisions)} | found.record)
    return {"moves": moves, "arrivals": [place | row for row in arrivals], "fits": fits}


def log_likelihood(found: Prediction, decisions: TimedDecisions) -> float:
    """Mean of the next states of decisions."""
    seen = decisions.select(~decisions.censored)
    share = np.asarray(found.chain[seen.state, seen.next_state]).ravel()
    return float(np.log(np.maximum(share, FLOOR)).mean())


def laws_of(task: Task, found: Prediction, asked: Sequence[Asked]) -> list[ArrivalLaw]:
    """The forecasts asked for."""
    by_state = found.arrival
    return [
        ArrivalLaw(
            task.times_s,
            by_state.cdf[:, one.state],
            float(by_state.arrival_probability[one.state]),
        )
        for one in asked
    ]


def scored(method: str, asked: Sequence[Asked], laws: Sequence[ArrivalLaw]) -> list[Row]:
    """A row per person: measured and predicted time of arrival, score, and what bands hold."""
    return [
        {
            "method": method,
            "walker": one.walker,
            "arrival_s": one.duration_s,
            "median_s": law.quantile_s(0.5),
            "crps_s": crps_s(law, [one.duration_s]),
        }
        | {f"in_{round(100 * share)}": in_band(law, share, one.duration_s) for share in INTERVALS}
        for one, law in zip(asked, laws, strict=True)
    ]


def in_band(law: ArrivalLaw, share: float, time_s: float) -> bool:
    """Whether a time is within the central interval of a share of all times."""
    low, high = ((1 - share) / 2, (1 + share) / 2)
    by_then = float(law.probability_by(time_s))
    return low <= by_then <= high
