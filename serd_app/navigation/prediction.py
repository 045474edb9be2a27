"""What the strategy foretold of a drive, held against what came: a row of the arrival log."""

import math
from dataclasses import dataclass

from serd_app.navigation.arrival_log import ArrivalRow
from serd_app.navigation.navigator import HALF, MOST, Navigator
from serd_core.arrival.law import ArrivalLaw
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation


@dataclass(frozen=True, eq=False)
class Prediction:
    """Made at the first decision for a goal and a model; law: seconds since the episode began."""

    start_m: tuple[float, float]
    scenario: Scenario
    model: str
    law: ArrivalLaw
    probability: float


def prediction_of(navigator: Navigator, observation: Observation) -> Prediction | None:
    """The prediction of the decision just taken, None off the grid."""
    outlook = navigator.outlook
    if outlook is None or outlook.state < 0:
        return None
    return Prediction(
        start_m=(observation.x_m, observation.y_m),
        scenario=navigator.strategy.scenario,
        model=navigator.model,
        law=outlook.law.delayed(outlook.elapsed_s),
        probability=outlook.probability,
    )


def arrival_row(
    prediction: Prediction,
    *,
    episode: int,
    seed: int,
    outcome: str,
    reason: str,
    time_of_arrival_s: float,
) -> ArrivalRow:
    """The row of a drive that has ended; time_of_arrival_s: NaN if it did not arrive."""
    area = prediction.scenario.goal_area_m
    arrived = not math.isnan(time_of_arrival_s)
    law = prediction.law
    return ArrivalRow(
        episode=episode,
        seed=seed,
        start_x_m=prediction.start_m[0],
        start_y_m=prediction.start_m[1],
        goal_x_m=sum(x for x, _ in area) / len(area),
        goal_y_m=sum(y for _, y in area) / len(area),
        model=prediction.model,
        outcome=outcome,
        reason=reason,
        predicted_probability=prediction.probability,
        predicted_median_s=_or_nan(law.quantile_s(HALF)),
        predicted_most_s=_or_nan(law.quantile_s(MOST)),
        time_of_arrival_s=time_of_arrival_s,
        predicted_share=float(law.probability_by(time_of_arrival_s)) if arrived else math.nan,
    )


def _or_nan(time_s: float | None) -> float:
    return math.nan if time_s is None else time_s
