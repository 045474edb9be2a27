"""When a person who was watched for some cells arrives at the last column.

Learned laws: the semi-Markov chain of the moves and dwell times, in the crowd as it was when the
forecast was made, at the pace that the observed one leads to expect. How one follows from the other
is learned from the people of the training folds, with the crowd as known at their forecasts.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from lab.experiments.study.people.learners import DwellLaw, dwell_design, kinds_of
from lab.experiments.study.people.pace_ahead import PaceAhead, fit_pace_ahead
from lab.experiments.study.people.problem import AHEAD, Layers
from lab.experiments.study.people.recordings import Run, Walker
from lab.experiments.study.people.settings import ForecastSettings
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import ArrivalByState
from serd_core.arrival.dwell_times import Pace, paced_law
from serd_core.arrival.law import ArrivalLaw
from serd_core.arrival.semi_markov import DwellTimes, RenewalChain, semi_markov_arrival

#: Step of the logarithm of mean dwell times, so that moves share distributions.
_STEP = 0.04
#: Layers whose chains are solved together.
_AT_A_TIME = 32


@dataclass(frozen=True)
class Asked:
    """A forecast that is asked for: at time_s in a cell, answered by duration_s until arrival."""

    walker: int
    cell: int
    time_s: float
    duration_s: float


def asked_of(walker: Walker, number: int, run: Run, observed_cells: int) -> Asked:
    """The forecast on entering the first cell after those that are observed."""
    columns = run.grid.cells[walker.crossings.state, 1]
    here = int(np.argmax(columns >= observed_cells))
    entered = walker.crossings.entered_s
    return Asked(
        number,
        int(walker.crossings.state[here]),
        float(entered[here]),
        float(entered[run.arrival_of(walker)] - entered[here]),
    )


def horizon_of(asked: Iterable[Asked], settings: ForecastSettings) -> float:
    """Seconds that forecasts cover: some times the longest measured one."""
    return settings.horizon * max(one.duration_s for one in asked)


def observed_pace(law: DwellLaw, seen: Layers, asked: Asked) -> Pace:
    """Posterior of a person's pace from the moves before the forecast."""
    moves = seen.moves
    assert moves is not None
    mine = np.flatnonzero((moves.walker == asked.walker) & (moves.entered_s < asked.time_s))
    kind = kinds_of(moves.select(mine))
    design = dwell_design(seen, seen.cell[seen.decided[mine]], kind, density=law.density)
    return law.model.pace(moves.dwell_s[mine], design, kind)


def learn_pace_ahead(
    law: DwellLaw, seen: Layers, asked: Sequence[Asked], at: Layers, layer_of: IntArray
) -> PaceAhead:
    """From people whose arrival is known; at: the crowd at the time of each forecast."""
    moves = seen.moves
    assert moves is not None
    rows = []
    for one, layer in zip(asked, layer_of.tolist(), strict=True):
        later = np.flatnonzero((moves.walker == one.walker) & (moves.entered_s >= one.time_s))
        kind = kinds_of(moves.select(later))
        mean_s = law.mean_s(at, at.start[layer] + moves.cell[later], kind)
        total_s = float(mean_s.sum())
        ahead = np.log(moves.dwell_s[later].sum() / total_s)
        noise = np.sum(law.model.dispersion[kind] * mean_s**2) / total_s**2
        rows.append((observed_pace(law, seen, one).mean, ahead, noise))
    return fit_pace_ahead(*np.array(rows).T)


def _arrivals(
    layers: Layers,
    directions: FloatArray,
    dwell: DwellLaw,
    states: IntArray,
    step_s: float,
    n_steps: int,
) -> ArrivalByState:
    """Arrival at pace 0 from (cell, whether it was entered by another direction than ahead).

    states: of some neighbouring layers.
    """
    first = states[0]
    cell, turned, direction = (
        each.ravel() for each in np.meshgrid(states - first, [0, 1], np.arange(4), indexing="ij")
    )
    goal = np.isin(states, layers.goal_states)
    probability = directions[cell + first, direction]
    kept = (probability > 0) & ~goal[cell]
    cell, turned, direction = cell[kept], turned[kept], direction[kept]
    kind = 2 * turned + (direction != AHEAD)
    mean_s = dwell.mean_s(layers, cell + first, kind)
    keys, classes = np.unique(
        np.stack([np.rint(np.log(mean_s) / _STEP).astype(np.int64), kind], axis=1),
        axis=0,
        return_inverse=True,
    )
    mass = dwell.model.mass(np.exp(_STEP * keys[:, 0]), keys[:, 1], step_s, n_steps)
    successor = layers.neighbours[cell + first, direction] - first
    total = directions[states].sum(axis=1)
    chain = RenewalChain(
        state=2 * cell + turned,
        successor=2 * successor + (direction != AHEAD),
        probability=directions[cell + first, direction] / total[cell],
        dwell=classes.reshape(-1),
        goal=np.repeat(goal, 2),
    )
    return semi_markov_arrival(chain, DwellTimes(step_s, mass), n_steps)


def forecast_laws(
    layers: Layers,
    layer_of: IntArray,
    directions: FloatArray,
    dwell: DwellLaw,
    ahead: PaceAhead,
    seen: Layers,
    asked: Iterable[Asked],
    step_s: float,
    horizon_s: float,
) -> list[ArrivalLaw]:
    """The law of each person asked for, in the layer of that place; seen: moves until then."""
    who, laws = list(asked), {}
    n_steps = int(np.ceil(horizon_s / step_s))
    times_s = np.asarray(step_s * np.arange(n_steps + 1), dtype=np.float64)
    for begin in range(0, len(layers.each), _AT_A_TIME):
        end = min(begin + _AT_A_TIME, len(layers.each))
        mine = np.flatnonzero((layer_of >= begin) & (layer_of < end))
        if not len(mine):
            continue
        states = np.arange(layers.start[begin], layers.start[end])
        found = _arrivals(layers, directions, dwell, states, step_s, n_steps)
        for place in mine.tolist():
            one = who[place]
            state = 2 * (layers.start[layer_of[place]] - layers.start[begin] + one.cell)
            ever = float(found.arrival_probability[state])
            law = ArrivalLaw(times_s, found.cdf[:, state], ever)
            laws[place] = paced_law(law, ahead.after(observed_pace(dwell, seen, one)))
    return [laws[place] for place in range(len(who))]
