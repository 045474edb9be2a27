"""One fold: learn from its people, predict moves and times of arrival of those who are held out."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.people.folds import Fold
from lab.experiments.study.people.forecasts import Asked
from lab.experiments.study.people.learners import FLOOR, dwell_design, kinds_of
from lab.experiments.study.people.people import People
from lab.experiments.study.people.problem import Moves
from lab.experiments.study.people.scores import (
    crps_s,
    integral_transform,
    point_law,
    scaled_point_law,
)
from lab.experiments.study.people.walkers import (
    CONSTANT_VELOCITY,
    DISTANCE_OVER_SPEED,
    Straight,
    calibrated,
    confusion,
    free_directions,
)
from lab.experiments.study.people.worlds import World, learn_world
from serd_core.arrival.dwell_times import DwellModel
from serd_core.arrival.law import ArrivalLaw

#: Quantiles that stand for measured over predicted times.
_FACTORS = np.linspace(0.0025, 0.9975, 200)


def run_fold(people: People, fold: Fold, number: int, straight: Straight) -> dict[str, Any]:
    """moves: log-likelihoods by method; arrivals: a row per person and method; fits: records."""
    asked, world = people.asked_of(fold.test), learn_world(people, fold.training)
    moves, arrivals, fits = _likelihoods(people, fold, world), [], []
    for name, learned in world.learned.items():
        arrivals += scored(name, asked, world.laws(people, name, asked))
        fits.append({"method": name, "n_moves": world.n_moves} | learned.record)
    likelihood, rows = _constant_velocity(people, fold, straight, asked)
    moves.append(likelihood)
    arrivals += rows
    points = [point_law(float(straight.arrival_s[one.walker])) for one in asked]
    arrivals += scored(DISTANCE_OVER_SPEED, asked, points)
    place = {"fold": number, "n_moves": int(fold.test[people.moves.walker].sum())}
    return {
        "moves": [place | row for row in moves],
        "arrivals": [{"fold": number} | row for row in arrivals],
        "fits": [{"fold": number} | row for row in fits],
    }


def _likelihoods(people: People, fold: Fold, world: World) -> list[Row]:
    """Mean log-likelihood of the moves held out, and of their dwell times."""
    seen, moves = world.seen(people, fold.test), people.moves_of(fold.test)
    dwell = _dwell_log_likelihood(world.dwell, moves)
    rows: list[Row] = []
    for name, learned in world.learned.items():
        shares = learned.directions(seen)[seen.decided, moves.direction]
        log = np.log(np.maximum(shares, FLOOR))
        row = {"method": name, "log_likelihood": float(log.mean())}
        rows.append(row | {"dwell_log_likelihood": dwell})
    return rows


def _dwell_log_likelihood(dwell: DwellModel, moves: Moves) -> float:
    """Mean log density of each dwell time given the person's moves before it."""
    kind = kinds_of(moves)
    design = dwell_design(kind)
    mean_s, total = dwell.mean_s(design), 0.0
    for walker in np.unique(moves.walker):
        rows = np.flatnonzero(moves.walker == walker)
        for count, row in enumerate(rows):
            before = rows[:count]
            pace = dwell.pace(moves.dwell_s[before], design[before], kind[before])
            total += dwell.log_density(
                float(moves.dwell_s[row]), float(mean_s[row]), int(kind[row]), pace
            )
    return total / len(moves)


def _constant_velocity(
    people: People, fold: Fold, straight: Straight, asked: Sequence[Asked]
) -> tuple[Row, list[Row]]:
    """Calibrated on the people learned from."""
    moves = people.moves
    predicted, points = straight.directions, straight.arrival_s
    training, test = fold.training[moves.walker], fold.test[moves.walker]
    table = confusion(predicted[training], moves.direction[training])
    by_run = [free_directions(each) for each in people.runs]
    free = np.array(
        [by_run[i // 2][c] for i, c in zip(moves.layer[test], moves.cell[test], strict=True)]
    )
    shares = calibrated(table, predicted[test], free)
    log = np.log(shares[np.arange(len(shares)), moves.direction[test]])
    measured = np.array([one.duration_s for one in people.asked])
    ratios = (measured / np.maximum(points, 1e-3))[fold.training]
    factors = np.quantile(ratios, _FACTORS)
    laws = [scaled_point_law(float(points[one.walker]), factors) for one in asked]
    likelihood = {"log_likelihood": float(log.mean()), "dwell_log_likelihood": None}
    return {"method": CONSTANT_VELOCITY} | likelihood, scored(CONSTANT_VELOCITY, asked, laws)


def scored(name: str, asked: Sequence[Asked], laws: Sequence[ArrivalLaw]) -> list[Row]:
    """A row per person: measured and predicted time of arrival."""
    return [
        {
            "method": name,
            "walker": one.walker,
            "arrival_s": one.duration_s,
            "median_s": law.quantile_s(0.5),
            "crps_s": crps_s(law, one.duration_s),
            "pit": integral_transform(law, one.duration_s),
        }
        for one, law in zip(asked, laws, strict=True)
    ]
