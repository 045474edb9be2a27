"""Times of arrival of the learned policies: predicted by model, and measured.

Each repetition's models drive a share of the episodes, in worlds that are the same for every
method. Predictions come from the absorbing chain of the greedy policy under the learned dynamics.
Measured times are rounded up to whole decision periods, the resolution of the model.
"""

import math
from typing import Any

import numpy as np
import pandas as pd

from lab.experiments.running.tables import Row
from lab.experiments.study.products import load_part
from lab.experiments.study.recordings.drives import (
    Purpose,
    drive_in,
    world_seed,
)
from lab.experiments.study.recordings.experts import PEOPLE
from lab.experiments.study.settings import StudySettings
from lab.experiments.study.study import TRAIN_AREA, Study
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import ArrivalTimes, arrival_time_distribution
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.scenario.scenario import Scenario


def n_episodes(settings: StudySettings, expert: str) -> int:
    """Episodes that one repetition's model of one method drives."""
    wanted = (settings.arrival if expert == PEOPLE else settings.beliefs).episodes
    return math.ceil(wanted / settings.n_repetitions(expert))


def n_periods(scenario: Scenario) -> int:
    """Whole decision periods of an episode's time limit."""
    return math.floor(scenario.episode_timeout_s / scenario.decision_period_s)


def arrivals_of_repetition(study: Study, expert: str, repetition: int) -> dict[str, Any]:
    """Predict and measure for the models of every method.

    predicted: one record per method; measured: one row per method and episode.
    """
    models = load_part(study, "fits", expert, repetition)["models"]
    predicted = {name: predict(study, model) for name, model in models.items()}
    measured: list[Row] = []
    driven: dict[tuple[int, ...], list[Row]] = {}
    for name, model in models.items():
        greedy = tuple(model["greedy"])
        # Equal policies drive alike in equal worlds, so each drives once.
        if greedy not in driven:
            driven[greedy] = _drive(study, expert, repetition, np.array(greedy))
        measured += [{"method": name} | row for row in driven[greedy]]
    return {"predicted": predicted, "measured": measured}


def predict(study: Study, model: dict[str, Any]) -> Row:
    """CDF by whole periods from the chain."""
    chain = arrival_by_chain(study, np.array(model["greedy"]), np.array(model["truth"]))
    return {"cdf": chain.cdf.tolist(), "arrival_probability": chain.arrival_probability}


def arrival_by_chain(study: Study, greedy: IntArray, dynamics: FloatArray) -> ArrivalTimes:
    """Time of arrival of the actions (S,) under (M, K) dynamics, up to the time limit."""
    policy, periods = study.policy_of(greedy), n_periods(study.scenario)
    return arrival_time_distribution(study.problem, policy, dynamics, study.starts, periods)


def measured_cdf(rows: pd.DataFrame, period_s: float, periods: int) -> FloatArray:
    """(periods + 1,) share of measured episodes that have arrived by each period."""
    times_s = rows.loc[rows["arrived"], "time_s"]
    arrived = np.ceil(times_s / period_s - 1e-9).to_numpy(np.int64)
    counts = np.bincount(arrived[arrived <= periods], minlength=periods + 1)
    return np.asarray(np.cumsum(counts) / len(rows))


def _drive(study: Study, expert: str, repetition: int, greedy: IntArray) -> list[Row]:
    """Results of the episodes of one policy."""
    seed = world_seed(study.settings.seed, expert, repetition, Purpose.MEASUREMENT)
    drives = drive_in(
        study.scenario,
        study.problem,
        study.settings.planner,
        PolicyDriver(study.problem.grid, study.policy_of(greedy), seed=seed),
        seed=seed,
        starts=[(number, TRAIN_AREA) for number in range(n_episodes(study.settings, expert))],
    )
    return [
        {
            "expert": expert,
            "repetition": repetition,
            "seed": seed,
            "episode": record.episode,
            "arrived": record.outcome == "arrived",
            "time_s": record.duration_s,
            "robot_on_person": record.contacts.robot_on_person,
            "person_on_robot": record.contacts.person_on_robot,
        }
        for record in drives.records
    ]
