"""What a learned model means for each cell: the policy's direction, time of arrival, dynamics."""

from dataclasses import dataclass

import numpy as np

from serd_app.navigation.evaluation.comparison import reasons_against_prediction, starts_of
from serd_app.navigation.forecast import HALF, quantile_or_nan_s
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Outcome
from serd_core.grid.navigation import INTENDED_OUTCOMES
from serd_sim.drivers.strategy import Strategy


@dataclass(frozen=True, eq=False)
class ModelOverlay:
    """directions: (S, 2) steps east and north of the greedy action, zero where it waits.

    median_s: (S,) by which half of all drives from the cell have arrived, NaN where fewer do before
    the time-out. forward: (S,) probability that the greedy action goes forward, NaN where it waits.
    forward_by_model: that of each outcome model of moves that applies somewhere. n_least_time:
    cells in which the way of least expected time is driven, as the learned policy does not arrive.
    no_prediction_because: why the times are computed and no prediction, none where they are one.
    """

    directions: IntArray
    median_s: FloatArray
    forward: FloatArray
    forward_by_model: dict[str, float]
    n_least_time: int = 0
    no_prediction_because: tuple[str, ...] = ()


def overlay_of(strategy: Strategy) -> ModelOverlay:
    """The overlay of a solved model, at the goal that it is solved for."""
    problem, greedy = strategy.problem, strategy.policy.greedy
    states = np.arange(problem.grid.n_states)
    model = problem.outcome_models.model_of[states, greedy]
    by_model = _forward_by_model(strategy)
    of_model = np.array([by_model.get(name, np.nan) for name in problem.model_names])
    return ModelOverlay(
        directions=DIRECTION_VECTORS[greedy],
        median_s=np.array(
            [quantile_or_nan_s(strategy.law_of_cell(state), HALF) for state in states.tolist()]
        ),
        forward=np.where(greedy == Action.WAIT, np.nan, of_model[model]),
        forward_by_model=by_model,
        n_least_time=int(strategy.by_time.sum()),
        no_prediction_because=reasons_against_prediction(
            n_demonstrations=strategy.file.fit.n_episodes, starts=starts_of(strategy, "train")
        ),
    )


def _forward_by_model(strategy: Strategy) -> dict[str, float]:
    problem, file = strategy.problem, strategy.file
    moves = INTENDED_OUTCOMES == Outcome.FORWARD
    used = [row for row in problem.used_models if moves[row % len(moves)]]
    column = file.outcome_names.index(Outcome.FORWARD.name.lower())
    learned = {each.name: each.learned[column] for each in file.outcome_models}
    return {name: learned[name] for name in (problem.model_names[row] for row in used)}
