"""What decision periods of fixed length predict: the chain of cells that the thesis counts.

People of the training folds are seen every `PERIOD_S`. A period that ends in no neighbouring cell
is assigned to one by `next_state_of`, as in `serd demos`. The shares of the five outcomes are
counted per part of the corridor, with one added to each.
"""

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.people.crowd import BINS, bins_of, cells_of_bins
from lab.experiments.study.people.fold import scored
from lab.experiments.study.people.folds import Fold
from lab.experiments.study.people.people import People
from lab.experiments.study.people.problem import is_goal
from lab.experiments.study.people.recordings import Run
from lab.experiments.study.people.tables import PERIOD_S, PERIODS
from serd_app.demonstrations.discretise import next_state_of
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.law import law_in_seconds
from serd_core.arrival.semi_markov import DwellTimes, RenewalChain, semi_markov_arrival


def period_rows(people: People, fold: Fold, number: int) -> list[Row]:
    """A row of scores per person held out."""
    asked, counts = people.asked_of(fold.test), np.ones((BINS[0] * BINS[1], 5))
    for person in np.flatnonzero(fold.training):
        run = people.runs[people.run_of[person]]
        by_cell = np.zeros((run.grid.n_states, 5))
        np.add.at(by_cell, _outcomes(run, people.walkers[person].every(PERIOD_S)), 1.0)
        counts += cells_of_bins(run) @ by_cell
    n_periods = int(np.ceil(people.horizon_s / PERIOD_S))
    by_run = [
        semi_markov_arrival(_chain(run, counts), DwellTimes.periodic(PERIOD_S), n_periods)
        for run in people.runs
    ]
    laws = [
        law_in_seconds(by_run[people.run_of[one.walker]].from_state(one.cell), period_s=PERIOD_S)
        for one in asked
    ]
    return [{"fold": number} | row for row in scored(PERIODS, asked, laws)]


def _outcomes(run: Run, places: FloatArray) -> tuple[IntArray, IntArray]:
    """(N,) cell and outcome, an index of `Grid.neighbours`, of each period on the grid."""
    state = run.grid.states_at(places)
    pairs = []
    for before, after, end_m in zip(
        state[:-1].tolist(), state[1:].tolist(), places[1:], strict=True
    ):
        if before < 0 or after < 0:
            continue
        reached, _ = next_state_of(run.grid, before, after, end_m)
        if reached >= 0:
            pairs.append((before, int(np.argmax(run.grid.neighbours[before] == reached))))
    table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def _chain(run: Run, counts: FloatArray) -> RenewalChain:
    """Moves between cells; outcomes into walls stay."""
    share = counts[bins_of(run)]
    share = share / share.sum(axis=1, keepdims=True)
    n_cells = run.grid.n_states
    return RenewalChain(
        state=np.repeat(np.arange(n_cells), 5),
        successor=run.grid.neighbours.ravel(),
        probability=share.ravel(),
        dwell=np.zeros(5 * n_cells, dtype=np.int64),
        goal=is_goal(run),
    )
