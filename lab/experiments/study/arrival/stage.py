"""Times of arrival of the learned policies: predicted by model, and measured.

Each repetition's models drive a share of the episodes, in worlds that are the same for every
method. Predictions come from the absorbing chain of the greedy policy under the learned dynamics,
with laws of dwell times that are counted in the same demonstrations. Measured times are rounded to
whole steps, as these dwell times are.
"""

import math
from typing import Any

import numpy as np
import pandas as pd

from lab.experiments.running.tables import Row
from lab.experiments.study.products import load_part
from lab.experiments.study.recordings.drives import Purpose, drive_in, world_seed
from lab.experiments.study.recordings.experts import PEOPLE
from lab.experiments.study.settings import StudySettings
from lab.experiments.study.study import TRAIN_AREA, Study
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import timed_arrival
from serd_core.semi_markov.models import require_timed
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.scenario.scenario import Scenario

#: Seconds between the times for which arrivals are predicted and measured.
STEP_S = 0.5


def n_episodes(settings: StudySettings, expert: str) -> int:
    """Episodes that one repetition's model of one method drives."""
    wanted = (settings.arrival if expert == PEOPLE else settings.beliefs).episodes
    return math.ceil(wanted / settings.n_repetitions(expert))


def n_steps(scenario: Scenario) -> int:
    """Whole steps of an episode's time limit."""
    return math.floor(scenario.episode_timeout_s / STEP_S)


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
    """CDF by whole steps up to the time limit, from the chain."""
    laws = require_timed(study.timed.mdp.transitions)
    energies = laws.outcomes.parameters_of(np.array(model["truth"]))[: laws.means.start]
    parameters = np.concatenate([energies, model["laws"]])
    policy = study.policy_of(np.array(model["greedy"]))
    found = timed_arrival(study.timed, policy, parameters, STEP_S, n_steps(study.scenario))
    return {
        "cdf": (found.cdf @ study.starts).tolist(),
        "arrival_probability": float(found.arrival_probability @ study.starts),
    }


def measured_cdf(rows: pd.DataFrame, n_steps: int) -> FloatArray:
    """(n_steps + 1,) share of measured episodes that have arrived by each step."""
    times_s = rows.loc[rows["arrived"], "time_s"]
    arrived = np.rint(times_s / STEP_S).to_numpy(np.int64)
    counts = np.bincount(arrived[arrived <= n_steps], minlength=n_steps + 1)
    return np.asarray(np.cumsum(counts) / len(rows))


def _drive(study: Study, expert: str, repetition: int, greedy: IntArray) -> list[Row]:
    """Results of the episodes of one policy."""
    seed = world_seed(study.settings.seed, expert, repetition, Purpose.MEASUREMENT)
    drives = drive_in(
        study.scenario,
        study.problem,
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
