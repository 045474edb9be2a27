"""Learners with the same input on the crowd: its density at each time, or its mean over time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lab.experiments.study.people import learners
from lab.experiments.study.people.cross_validation.forecasts import (
    Asked,
    forecast_laws,
    learn_pace_ahead,
)
from lab.experiments.study.people.crowd import Field, mean_field
from lab.experiments.study.people.learners import (
    CLONING,
    IRL,
    IRL_DENSITY,
    SERD,
    SERD_DENSITY,
    DwellLaw,
    Learned,
    covariates_in,
    learn_dwell_times,
    marginal_directions,
)
from lab.experiments.study.people.pace_ahead import PaceAhead
from lab.experiments.study.people.people import People, Side, evenly, subset_of
from lab.experiments.study.people.problem import Layers
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.arrival.law import ArrivalLaw

Learner = Callable[[Layers], Learned]
#: Learners whose input is the density, and those whose input is the mean crowd.
WITH_DENSITY: Mapping[str, Learner] = {SERD_DENSITY: learners.serd, IRL_DENSITY: learners.irl}
WITHOUT: Mapping[str, Learner] = {SERD: learners.serd, IRL: learners.irl, CLONING: learners.cloning}
#: Quantiles that stand for the drift of walkers in cells that they have not reached.
_DRIFTS = (np.arange(9) + 0.5) / 9


@dataclass(frozen=True, eq=False)
class World:
    """What was learned by methods with the same input on the crowd.

    like: layers learned from; mean: the mean crowd, None where its density is known at each time.
    learned: by method; drift: of the walkers learned from.
    """

    like: Layers
    mean: Field | None
    learned: Mapping[str, Learned]
    dwell: DwellLaw
    ahead: PaceAhead
    drift: FloatArray

    def seen(self, people: People, side: Side) -> Layers:
        """The layers of moves."""
        return _seen(people, side, self.like, self.mean)

    def laws(self, people: People, method: str, asked: Sequence[Asked]) -> list[ArrivalLaw]:
        """The forecast of each person asked for, from what was seen before."""
        mask = np.zeros(len(people.run_of), dtype=np.bool_)
        mask[[one.walker for one in asked]] = True
        there, place = _asked(people, asked, self.like, self.mean)
        return forecast_laws(
            there,
            place,
            marginal_directions(self.learned[method], there, self.drift),
            self.dwell,
            self.ahead,
            self.seen(people, people.side_of(mask)),
            asked,
            people.settings.forecast.step_s,
            people.horizon_s,
        )


def learn_world(people: People, training: BoolArray, *, density: bool) -> World:
    """Learn by all methods from the people of a mask (P,), or from some of them evenly chosen."""
    crowd = people.settings.crowd
    chosen = evenly(training, crowd.training_people)
    side = people.side_of(chosen)
    subset = subset_of(side.dense, crowd.training_layers)
    mean = None if density else mean_field([(each.run, each.field) for each in subset.layers])
    like = Layers(subset.layers, people.settings.discount)
    if density:
        kept = subset.place >= 0
        moves = replace(side.moves.select(kept), layer=subset.place[kept])
        like = replace(like, covariates=covariates_in(like), moves=moves)
        like = replace(like, learned_rows=np.unique(like.crowding, axis=0))
    else:
        like = _seen(people, side, like, mean)
    dwell = learn_dwell_times(like, density=density)
    known = people.asked_of(chosen)
    seen = _seen(people, side, like, mean)
    return World(
        like=like,
        mean=mean,
        learned={
            name: learn(like) for name, learn in (WITH_DENSITY if density else WITHOUT).items()
        },
        dwell=dwell,
        ahead=learn_pace_ahead(dwell, seen, known, *_asked(people, known, like, mean)),
        drift=np.asarray(np.quantile(side.moves.drift, _DRIFTS), dtype=np.float64),
    )


def _seen(people: People, side: Side, like: Layers, mean: Field | None) -> Layers:
    if mean is None:
        moves = replace(side.moves, layer=side.dense.place)
        return replace(like, each=side.dense.layers, moves=moves)
    return replace(like, each=people.mean_layers(mean), moves=replace(side.moves, layer=side.mean))


def _asked(
    people: People, asked: Sequence[Asked], like: Layers, mean: Field | None
) -> tuple[Layers, IntArray]:
    """The crowd as known at each forecast, and which layer is that of each."""
    if mean is None:
        at = people.crowds_of(asked)
        return replace(like, each=at.layers, moves=None), at.place
    there = replace(like, each=people.mean_layers(mean), moves=None)
    return there, people.mean_layer_of(asked)
