"""When a person who was watched for some cells arrives at the last column.

Learned laws: the semi-Markov chain of the moves and dwell times, at the pace that the observed one
leads to expect. How one follows from the other is learned from the people of the training folds.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from lab.experiments.study.people.learners import dwell_design, kinds_of
from lab.experiments.study.people.pace_ahead import PaceAhead, fit_pace_ahead
from lab.experiments.study.people.problem import AHEAD, Layers, Moves
from lab.experiments.study.people.recordings import Run, Walker
from lab.experiments.study.people.settings import ForecastSettings
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import ArrivalByState
from serd_core.arrival.dwell_times import DwellModel, Pace, paced_law
from serd_core.arrival.law import ArrivalLaw
from serd_core.arrival.semi_markov import DwellTimes, RenewalChain, semi_markov_arrival

#: Step of the logarithm of mean dwell times, so that moves share distributions.
_STEP = 0.04


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


def observed_pace(dwell: DwellModel, moves: Moves, asked: Asked) -> Pace:
    """Posterior of a person's pace from the moves before the forecast."""
    mine = moves.select((moves.walker == asked.walker) & (moves.entered_s < asked.time_s))
    kind = kinds_of(mine)
    return dwell.pace(mine.dwell_s, dwell_design(kind), kind)


def learn_pace_ahead(dwell: DwellModel, moves: Moves, asked: Sequence[Asked]) -> PaceAhead:
    """From people whose arrival is known."""
    rows = []
    for one in asked:
        later = moves.select((moves.walker == one.walker) & (moves.entered_s >= one.time_s))
        kind = kinds_of(later)
        mean_s = dwell.mean_s(dwell_design(kind))
        total_s = float(mean_s.sum())
        ahead = np.log(later.dwell_s.sum() / total_s)
        noise = np.sum(dwell.dispersion[kind] * mean_s**2) / total_s**2
        rows.append((observed_pace(dwell, moves, one).mean, ahead, noise))
    return fit_pace_ahead(*np.array(rows).T)


def _arrivals(
    layers: Layers, directions: FloatArray, dwell: DwellModel, step_s: float, n_steps: int
) -> ArrivalByState:
    """Arrival at pace 0 from (cell, whether it was entered by another direction than ahead)."""
    n_cells = layers.start[-1]
    table = np.meshgrid(np.arange(n_cells), [0, 1], np.arange(4), indexing="ij")
    cell, turned, direction = (column.ravel() for column in table)
    goal = np.isin(np.arange(n_cells), layers.goal_states)
    probability = directions[cell, direction]
    kept = (probability > 0) & ~goal[cell]
    cell, turned, direction = cell[kept], turned[kept], direction[kept]
    kind = 2 * turned + (direction != AHEAD)
    kinds, classes = np.unique(kind, return_inverse=True)
    # Rounded, as where the means of many moves share a distribution.
    mean_s = np.exp(_STEP * np.rint(np.log(dwell.mean_s(dwell_design(kinds))) / _STEP))
    mass = dwell.mass(mean_s, kinds, step_s, n_steps)
    successor = layers.neighbours[cell, direction]
    chain = RenewalChain(
        state=2 * cell + turned,
        successor=2 * successor + (direction != AHEAD),
        probability=directions[cell, direction] / directions.sum(axis=1)[cell],
        dwell=classes.reshape(-1),
        goal=np.repeat(goal, 2),
    )
    return semi_markov_arrival(chain, DwellTimes(step_s, mass), n_steps)


def forecast_laws(
    layers: Layers,
    layer_of: IntArray,
    directions: FloatArray,
    dwell: DwellModel,
    ahead: PaceAhead,
    moves: Moves,
    asked: Sequence[Asked],
    step_s: float,
    horizon_s: float,
) -> list[ArrivalLaw]:
    """The law of each person asked for, in the layer of that place; moves: those until then."""
    n_steps = int(np.ceil(horizon_s / step_s))
    times_s = np.asarray(step_s * np.arange(n_steps + 1), dtype=np.float64)
    found = _arrivals(layers, directions, dwell, step_s, n_steps)
    laws = []
    for one, layer in zip(asked, layer_of.tolist(), strict=True):
        state = 2 * (layers.start[layer] + one.cell)
        law = ArrivalLaw(times_s, found.cdf[:, state], float(found.arrival_probability[state]))
        laws.append(paced_law(law, ahead.after(observed_pace(dwell, moves, one))))
    return laws
