"""What all learners of a fold learned, and the forecasts that follow."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lab.experiments.study.people import learners
from lab.experiments.study.people.forecasts import Asked, forecast_laws, learn_pace_ahead
from lab.experiments.study.people.learners import (
    CLONING,
    IRL,
    SERD,
    Learned,
    learn_dwell_times,
    marginal_directions,
)
from lab.experiments.study.people.pace_ahead import PaceAhead
from lab.experiments.study.people.people import People, evenly
from lab.experiments.study.people.problem import Layers
from serd_core.arrays import BoolArray, FloatArray
from serd_core.arrival.dwell_times import DwellModel
from serd_core.arrival.law import ArrivalLaw

LEARNERS: Mapping[str, Callable[[Layers], Learned]] = {
    SERD: learners.serd,
    IRL: learners.irl,
    CLONING: learners.cloning,
}
#: Quantiles that stand for the drift of walkers in cells that they have not reached.
_DRIFTS = (np.arange(9) + 0.5) / 9


@dataclass(frozen=True, eq=False)
class World:
    """What was learned: by method, and what all methods share.

    layers: of the mean crowd, without moves; drift: of the walkers learned from.
    """

    layers: Layers
    n_moves: int
    learned: Mapping[str, Learned]
    dwell: DwellModel
    ahead: PaceAhead
    drift: FloatArray

    def seen(self, people: People, mask: BoolArray) -> Layers:
        """The layers with the moves of the people of a mask (P,)."""
        return replace(self.layers, moves=people.moves_of(mask))

    def laws(self, people: People, method: str, asked: Sequence[Asked]) -> list[ArrivalLaw]:
        """The forecast of each person asked for, from what was seen before."""
        mask = np.zeros(len(people.run_of), dtype=np.bool_)
        mask[[one.walker for one in asked]] = True
        return forecast_laws(
            self.layers,
            people.layer_of(asked),
            marginal_directions(self.learned[method], self.layers, self.drift),
            self.dwell,
            self.ahead,
            people.moves_of(mask),
            asked,
            people.settings.forecast.step_s,
            people.horizon_s,
        )


def learn_world(people: People, training: BoolArray) -> World:
    """Learn by all methods from the people of a mask (P,), or from some of them evenly chosen."""
    chosen = evenly(training, people.settings.crowd.training_people)
    moves = people.moves_of(chosen)
    layers = Layers(people.layers(people.mean_crowd(moves)), people.settings.discount)
    like, dwell = replace(layers, moves=moves), learn_dwell_times(moves)
    return World(
        layers=layers,
        n_moves=len(moves),
        learned={name: learn(like) for name, learn in LEARNERS.items()},
        dwell=dwell,
        ahead=learn_pace_ahead(dwell, moves, people.asked_of(chosen)),
        drift=np.asarray(np.quantile(moves.drift, _DRIFTS), dtype=np.float64),
    )
