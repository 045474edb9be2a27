"""Folds of people, with no id on both sides: groups of runs, or blocks of time with gaps.

A fold learns from its people, and predicts moves and times of arrival of those who are held out. It
is compared with constant velocity: distance over speed so far, times what people differ by from it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.people.learners import LEARNERS, Prediction, Task
from lab.experiments.study.people.paces import Paces
from lab.experiments.study.people.people import Asked, People, evenly
from lab.experiments.study.people.recordings import Run
from lab.experiments.study.people.settings import FoldSettings
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.arrival.law import ArrivalLaw, crps_s
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.errors import SerdError

CONSTANT_VELOCITY = "constant velocity"
_SLOWEST_MPS, _SOONEST_S = 0.2, 1e-3


def straight_laws(people: People, training: BoolArray, asked: Sequence[Asked]) -> list[ArrivalLaw]:
    """The forecasts asked for; training: (P,) of whom measured over predicted times are taken."""
    known = people.asked_of(training)
    factors = np.sort([one.duration_s / straight_s(people, one) for one in known])
    return [scaled_law(straight_s(people, one), factors, people.times_s) for one in asked]


def straight_s(people: People, one: Asked) -> float:
    """Seconds until a person is in the last column who keeps the mean speed along the corridor."""
    walker, run = people.walkers[one.walker], people.runs[people.run_of[one.walker]]
    here_m, since_s = walker.ahead_m(one.time_s), one.time_s - float(walker.time_s[0])
    speed_mps = (here_m - float(walker.position_m[0, 0])) / max(since_s, _SOONEST_S)
    return float(max((run.goal_line_m - here_m) / max(speed_mps, _SLOWEST_MPS), _SOONEST_S))


def scaled_law(time_s: float, factors: FloatArray, times_s: FloatArray) -> ArrivalLaw:
    """One time, multiplied by each of the sorted factors with the same probability."""
    cdf = np.searchsorted(time_s * factors, times_s, side="right") / len(factors)
    return ArrivalLaw(times_s, cdf, 1.0)


#: People that a fold learns from at least.
FEWEST = 10


@dataclass(frozen=True, eq=False)
class Fold:
    """(P,) masks of people: those learned from, and those held out."""

    training: BoolArray
    test: BoolArray


def folds_of(runs: Sequence[Run], settings: FoldSettings) -> tuple[Fold, ...]:
    """Folds over all walkers of all runs, in their order."""
    run = np.concatenate([np.full(len(each.walkers), i) for i, each in enumerate(runs)])
    spans = np.array(
        [(walker.time_s[0], walker.time_s[-1]) for each in runs for walker in each.walkers]
    )
    if len(runs) >= settings.runs:
        number = min(settings.number, len(runs))
        return tuple(Fold(run % number != k, run % number == k) for k in range(number))
    block = _blocks(runs, run, spans, settings.number)
    folds = tuple(_fold(run, spans, block, k, settings.gap_s) for k in range(settings.number))
    for k, fold in enumerate(folds):
        if not fold.test.any() or fold.training.sum() < FEWEST:
            raise SerdError(
                f"each of {settings.number} time blocks must hold people and leave {FEWEST} who are"
                f" not there with them to learn from, block {k + 1} has {fold.test.sum()} and"
                f" leaves {fold.training.sum()}; choose another number of folds (folds: number:),"
                f" or give {settings.runs} files"
            )
    return folds


def _blocks(runs: Sequence[Run], run: IntArray, spans: FloatArray, number: int) -> IntArray:
    """(P,) block of each person by the time of entry, blocks of a run being equally long."""
    begins = np.array([each.span_s[0] for each in runs])[run]
    ends = np.array([spans[run == i, 0].max() for i in range(len(runs))])[run]
    share = (spans[:, 0] - begins) / np.maximum(ends - begins, 1e-9)
    return np.asarray(np.clip((share * number).astype(np.int64), 0, number - 1))


def _fold(run: IntArray, spans: FloatArray, block: IntArray, k: int, gap_s: float) -> Fold:
    test = block == k
    near = np.zeros(len(run), dtype=np.bool_)
    for each in np.unique(run[test]):
        tested = spans[test & (run == each)]
        low, high = tested[:, 0].min() - gap_s, tested[:, 1].max() + gap_s
        near |= (run == each) & (spans[:, 1] >= low) & (spans[:, 0] <= high)
    return Fold(~near & ~test, test)


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
    paces = Paces.of(task.problem.grid, task.decisions)
    at_pace_one = paces.at_pace_one(
        task.decisions, people.settings.patience_s, np.random.default_rng(number)
    )
    place, moves, fits = {"fold": number}, list[Row](), list[Row]()
    arrivals = scored(CONSTANT_VELOCITY, asked, straight_laws(people, fold.training, asked))
    for method, learn in LEARNERS.items():
        found = learn(replace(task, decisions=at_pace_one))
        row = {"method": method, "n_moves": len(held_out)}
        moves.append(place | row | {"log_likelihood": log_likelihood(found, held_out)})
        laws = paces.own_laws(task.times_s, found.arrival, asked, people.seen)
        arrivals += scored(method, asked, laws)
        fits.append(place | {"method": method, "n_decisions": len(task.decisions)} | found.record)
    return {"moves": moves, "arrivals": [place | row for row in arrivals], "fits": fits}


def log_likelihood(found: Prediction, decisions: TimedDecisions) -> float:
    """Mean of the next states of decisions."""
    seen = decisions.select(~decisions.censored)
    share = np.asarray(found.chain[seen.state, seen.next_state]).ravel()
    return float(np.log(np.maximum(share, FLOOR)).mean())


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
