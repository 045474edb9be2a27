"""One fold: learn from its people, predict moves and times of arrival of those who are held out."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.people import learners
from lab.experiments.study.people.cross_validation.folds import Fold
from lab.experiments.study.people.cross_validation.forecasts import Asked
from lab.experiments.study.people.cross_validation.walkers import (
    CONSTANT_VELOCITY,
    DISTANCE_OVER_SPEED,
    SOCIAL_FORCE,
    calibrated,
    confusion,
    free_directions,
)
from lab.experiments.study.people.cross_validation.worlds import World, learn_world
from lab.experiments.study.people.learners import DwellLaw, kinds_of
from lab.experiments.study.people.people import People
from lab.experiments.study.people.problem import Layers
from lab.experiments.study.people.scores import (
    crps_s,
    integral_transform,
    point_law,
    scaled_point_law,
)
from serd_core.arrival.law import ArrivalLaw

#: Predictions of `walker_predictions`, by run.
Predictions = Sequence[Mapping[str, Any]]
#: Quantiles that stand for measured over predicted times.
_FACTORS = np.linspace(0.0025, 0.9975, 200)


def run_fold(people: People, fold: Fold, number: int, predictions: Predictions) -> dict[str, Any]:
    """moves: log-likelihoods by method; arrivals: a row per person and method; fits: records."""
    asked = people.asked_of(fold.test)
    worlds = [learn_world(people, fold.training, density=density) for density in (True, False)]
    moves, arrivals, fits = [], [], []
    for world in worlds:
        moves += _likelihoods(people, fold, world)
        for name, learned in world.learned.items():
            arrivals += scored(name, asked, world.laws(people, name, asked))
            fits.append({"method": name, "n_moves": len(world.like.decided)} | learned.record)
    for name in (CONSTANT_VELOCITY, SOCIAL_FORCE):
        likelihood, rows = _walkers(people, fold, name, predictions, asked)
        moves.append(likelihood)
        arrivals += rows
    points = _all(predictions, CONSTANT_VELOCITY, "arrival_s")
    arrivals += scored(DISTANCE_OVER_SPEED, asked, [point_law(points[one.walker]) for one in asked])
    place = {"fold": number, "n_moves": int(fold.test[people.moves[0].walker].sum())}
    return {
        "moves": [place | row for row in moves],
        "arrivals": [{"fold": number} | row for row in arrivals],
        "fits": [{"fold": number} | row for row in fits],
    }


def _likelihoods(people: People, fold: Fold, world: World) -> list[Row]:
    """Mean log-likelihood of the moves held out, and of their dwell times."""
    seen = world.seen(people, people.side_of(fold.test))
    assert seen.moves is not None
    rows: list[Row] = []
    dwell = _dwell_log_likelihood(world.dwell, seen)
    for name, learned in world.learned.items():
        shares = learned.directions(seen)[seen.decided, seen.moves.direction]
        log = np.log(np.maximum(shares, learners.FLOOR))
        row = {"method": name, "log_likelihood": float(log.mean())}
        rows.append(row | {"dwell_log_likelihood": dwell})
    return rows


def _dwell_log_likelihood(dwell: DwellLaw, layers: Layers) -> float:
    """Mean log density of each dwell time given the person's moves before it."""
    moves = layers.moves
    assert moves is not None
    kind = kinds_of(moves)
    design = learners.dwell_design(layers, layers.cell[layers.decided], kind, density=dwell.density)
    mean_s, total = dwell.model.mean_s(design), 0.0
    for walker in np.unique(moves.walker):
        rows = np.flatnonzero(moves.walker == walker)
        for count, row in enumerate(rows):
            before = rows[:count]
            pace = dwell.model.pace(moves.dwell_s[before], design[before], kind[before])
            total += dwell.model.log_density(
                float(moves.dwell_s[row]), float(mean_s[row]), int(kind[row]), pace
            )
    return total / len(moves)


def _all(predictions: Predictions, name: str, what: str) -> list[Any]:
    return [value for one in predictions for value in one[name][what]]


def _walkers(
    people: People, fold: Fold, name: str, predictions: Predictions, asked: Sequence[Asked]
) -> tuple[Row, list[Row]]:
    """Calibrated on the people learned from."""
    moves, run, _ = people.moves
    predicted = np.concatenate(
        [np.asarray(each, dtype=np.int64) for each in _all(predictions, name, "directions")]
    )
    training, test = fold.training[moves.walker], fold.test[moves.walker]
    table = confusion(predicted[training], moves.direction[training])
    by_run = [free_directions(each) for each in people.runs]
    free = np.array([by_run[i][c] for i, c in zip(run[test], moves.cell[test], strict=True)])
    shares = calibrated(table, predicted[test], free)
    log = np.log(shares[np.arange(len(shares)), moves.direction[test]])
    points = np.array(_all(predictions, name, "arrival_s"))
    measured = np.array([one.duration_s for one in people.asked])
    ratios = (measured / np.maximum(points, 1e-3))[fold.training]
    factors = np.quantile(ratios, _FACTORS)
    laws = [scaled_point_law(float(points[one.walker]), factors) for one in asked]
    row = {"method": name, "log_likelihood": float(log.mean()), "dwell_log_likelihood": None}
    return row, scored(name, asked, laws)


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
