"""Whether moves take as long in all places as a forecast assumes.

The residual of a move is the log of its dwell time less the mean log of its law, n_c of them begin
in cell c, with the sum r_c. With weights K of cells at d cell sizes, exp(-d^2 / 8),

    z = max_c |(K r)_c| / sqrt((K^2 n)_c)

is compared with its values where the residuals of each law change places at random, which is exact
where places do not matter. It looks for one region of another pace (as Kulldorff, Communications
in Statistics 26, 1997, does for counts). The factor of a cell with moves is the exponential of
(K r) / (K n + 4), with four moves of prior weight. Of cells without moves it is not known: it is
between the least and the largest factor of the others. Where drives went round a slow place, no
move shows it, so a forecast may not be long in cells without moves.
"""

from dataclasses import dataclass

import numpy as np

from serd_bag.quantities import counted
from serd_core.arrays import FloatArray, IntArray, weighted_counts
from serd_core.arrival.chain import arrival_moments
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import NavigationProblem
from serd_core.semi_markov.dwell_likelihood import dwell_times
from serd_core.semi_markov.models import require_timed, semi_markov_problem
from serd_files.model_file import Check
from serd_sim.drivers.strategy import STEP_S, Plan

#: Cell sizes within which places are alike, moves that a factor of one is worth, permutations.
_REACH, _WORTH, _REPLICATES = 2.0, 4.0, 400
#: Largest factor of the time of arrival where moves from cells without any take twice as long.
MOST_UNKNOWN = 1.2


@dataclass(frozen=True, eq=False)
class PlaceFactors:
    """tail: probability of places that differ as much by chance; cells: (C,) with moves.

    factors: (C,) by which moves from each of them take longer than their law.
    """

    tail: float
    cells: IntArray
    factors: FloatArray


def place_factors(
    problem: NavigationProblem, decisions: TimedDecisions, rng: np.random.Generator
) -> PlaceFactors | None:
    """Compare dwell times by place; None where no move with one law was seen."""
    law, residual, state = _residuals(problem, decisions)
    if not len(state):
        return None
    cells, cell = np.unique(state, return_inverse=True)
    n_moves = np.bincount(cell).astype(np.float64)
    near = _nearness(problem.grid, cells)
    by_chance = (_within_laws(residual, law, rng) for _ in range(_REPLICATES))
    sums = np.stack([weighted_counts(cell, each, len(cells)) for each in (residual, *by_chance)])
    largest = np.abs(sums @ near / np.sqrt(near**2 @ n_moves)).max(axis=1)
    factors = np.exp(near @ sums[0] / (near @ n_moves + _WORTH))
    return PlaceFactors(float(np.mean(largest >= largest[0])), cells, factors)


def _nearness(grid: Grid, cells: IntArray) -> FloatArray:
    places = grid.centers_m[cells] / grid.cell_size_m
    away = np.linalg.norm(places[:, None] - places, axis=2)
    return np.asarray(np.exp(-0.5 * (away / _REACH) ** 2))


def _residuals(
    problem: NavigationProblem, decisions: TimedDecisions
) -> tuple[IntArray, FloatArray, IntArray]:
    """(N,) law, residual and state of the moves that ended in another cell by one law."""
    observed = dwell_times(semi_markov_problem(problem).mdp, decisions)
    assert observed is not None
    alone = np.bincount(observed.decision)[observed.decision] == 1
    law = np.full(len(observed.row), -1)
    law[observed.decision[alone]] = observed.law[alone]
    known = (law >= 0) & ~observed.censored
    law, log_s = law[known], observed.log_dwell[known]
    n_of_law = np.maximum(np.bincount(law), 1)
    means = np.bincount(law, weights=log_s) / n_of_law
    return law, log_s - means[law], decisions.state[observed.row[known]]


def _within_laws(residual: FloatArray, law: IntArray, rng: np.random.Generator) -> FloatArray:
    """The residuals, in which those of each law have changed places at random."""
    order, mixed = np.argsort(law, kind="stable"), np.lexsort((rng.random(len(law)), law))
    found = np.empty_like(residual)
    found[order] = residual[mixed]
    return found


def check_dwell_times(
    plan: Plan,
    decisions: TimedDecisions,
    starts: IntArray,
    rng: np.random.Generator,
    *,
    level: float,
    margin: float,
) -> Check:
    """Fails where places differ, and the mean time of arrival may do so by more than a factor, or
    much of it is spent in cells from which no move is recorded.

    decisions: with known actions; starts: (E,) states in which drives begin; level: of the tail
    probability; margin: the factor.
    """
    key, found = "dwell_times", place_factors(plan.problem, decisions, rng)
    if found is None:
        return Check(key=key, mark="unknown", sentence="no dwell time of a move is known")
    forecast_s = _mean_s(plan, plan.problem, starts)
    model = require_timed(plan.problem.mdp.transitions)
    by_action = model.log_pace[model.model_of]  # 0 for actions of a given duration
    slower, quicker = by_action.max(axis=1), by_action.min(axis=1)
    learned = np.where(slower > 0.0, slower, quicker)

    def ratio(known: FloatArray, unknown: FloatArray | float) -> float:
        """By which it changes with log paces of cells with moves and others; 1 where it is not
        finite, which other checks are of."""
        pace = np.broadcast_to(unknown, learned.shape).copy()
        pace[found.cells] = known
        changed_s = _mean_s(plan, semi_markov_problem(plan.problem, log_pace=pace), starts)
        return changed_s / forecast_s if np.isfinite([changed_s, forecast_s]).all() else 1.0

    if_twice = ratio(learned[found.cells], learned + np.log(2.0))
    fails = if_twice > MOST_UNKNOWN
    by_place = (
        f"by place moves take {found.factors.min():.2f} to {found.factors.max():.2f} times as long"
        f" as on average, over {counted(len(found.cells), 'cell')} with moves (tail probability"
        f" {found.tail:.3f})"
    )
    unknown = (
        "were moves twice as slow in cells from which none is recorded, the drive would take"
        f" {if_twice:.2f} times as long"
    )
    sentence = f"{by_place}; {unknown}"
    if fails:
        sentence = f"the learned way leads through cells that nobody drove: {unknown}; {by_place}"
    if found.tail <= level:
        paces = np.log(found.factors)
        least, most = ratio(paces, paces.min()), ratio(paces, paces.max())
        fails |= not (1.0 / margin <= least and most <= margin)
        sentence += (
            f"; cells without moves may be as slow or as quick as others, so it takes {least:.2f}"
            f" to {most:.2f} times as long"
        )
    return Check(key=key, mark="fails" if fails else "holds", sentence=sentence)


def _mean_s(plan: Plan, problem: NavigationProblem, starts: IntArray) -> float:
    """Mean time of arrival by a plan from the starts, where moves have the paces of a problem."""
    theta, policy = plan.draws.mean(axis=0), plan.policy.probabilities
    return float(arrival_moments(problem, policy, theta, STEP_S)[0][starts].mean())
