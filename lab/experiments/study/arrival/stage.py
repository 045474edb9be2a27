"""Times of arrival of the learned policies: predicted by model, sampled from it, and measured.

Each repetition's models drive a share of the episodes, in worlds that are the same for every
method. Predictions come from the absorbing chain of the greedy policy under the learned dynamics.
Measured times are rounded up to whole decision periods, the resolution of the model. The moves of
the measured drives are kept beside them, for `hindsight`.
"""

import math
import time
from typing import Any

import numpy as np
import pandas as pd

from lab.experiments.running.tables import Row
from lab.experiments.study.products import load_part
from lab.experiments.study.recordings.drives import Purpose, drive_in, world_seed
from lab.experiments.study.recordings.experts import EXPERTS, PEOPLE
from lab.experiments.study.recordings.moves import Move, counted_moves
from lab.experiments.study.settings import StudySettings
from lab.experiments.study.study import TRAIN_AREA, Study
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import ArrivalTimes, arrival_time_distribution
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.demonstrations.trajectories import trajectories_of
from serd_core.grid.navigation import NavigationProblem
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

    predicted: one record per method; measured: one row per method and episode; moves: of each
    method, what happened in its measured drives, counted.
    """
    models = load_part(study, "fits", expert, repetition)["models"]
    rng = np.random.default_rng([study.settings.seed, EXPERTS.index(expert), repetition])
    predicted = {name: predict(study, model, rng) for name, model in models.items()}
    measured: list[Row] = []
    moves: dict[str, list[Move]] = {}
    driven: dict[tuple[int, ...], tuple[list[Row], list[Move]]] = {}
    for name, model in models.items():
        greedy = tuple(model["greedy"])
        # Equal policies drive alike in equal worlds, so each drives once.
        if greedy not in driven:
            driven[greedy] = _drive(study, expert, repetition, np.array(greedy))
        rows, moves[name] = driven[greedy]
        measured += [{"method": name} | row for row in rows]
    return {"predicted": predicted, "measured": measured, "moves": moves}


def predict(study: Study, model: dict[str, Any], rng: np.random.Generator) -> Row:
    """CDF by whole periods from the chain and from sampled trajectories, and what each costs."""
    greedy, truth = np.array(model["greedy"]), np.array(model["truth"])
    periods, n_sampled = n_periods(study.scenario), study.settings.arrival.sampled
    began_s = time.perf_counter()
    chain = arrival_by_chain(study, greedy, truth)
    between_s = time.perf_counter()
    sampled = sampled_cdf(
        study.problem, study.policy_of(greedy), truth, study.starts, periods, n_sampled, rng
    )
    ended_s = time.perf_counter()
    return {
        "cdf": chain.cdf.tolist(),
        "arrival_probability": chain.arrival_probability,
        "chain_ms": 1e3 * (between_s - began_s),
        "sampled_cdf": sampled.tolist(),
        "sampled_ms": 1e3 * (ended_s - between_s),
    }


def arrival_by_chain(study: Study, greedy: IntArray, dynamics: FloatArray) -> ArrivalTimes:
    """Time of arrival of the actions (S,) under (M, K) dynamics, up to the time limit."""
    policy, periods = study.policy_of(greedy), n_periods(study.scenario)
    return arrival_time_distribution(study.problem, policy, dynamics, study.starts, periods)


def sampled_cdf(
    problem: NavigationProblem,
    policy: FloatArray,
    truth: FloatArray,
    starts: FloatArray,
    periods: int,
    n_sampled: int,
    rng: np.random.Generator,
) -> FloatArray:
    """(periods + 1,) share of sampled trajectories that have arrived by each period."""
    decisions = sample_decisions(
        problem.mdp, policy, truth, starts, n_episodes=n_sampled, n_steps=periods, rng=rng
    )
    tracks = trajectories_of(decisions)
    arrived = tracks.length[np.isin(tracks.end, problem.goal_states)]
    return _cdf_of_periods(arrived, periods, n_sampled)


def measured_cdf(rows: pd.DataFrame, period_s: float, periods: int) -> FloatArray:
    """(periods + 1,) share of measured episodes that have arrived by each period."""
    arrived = np.ceil(rows.loc[rows["arrived"], "time_s"] / period_s - 1e-9)
    return _cdf_of_periods(arrived.to_numpy(np.int64), periods, len(rows))


def _cdf_of_periods(arrived: IntArray, periods: int, n_all: int) -> FloatArray:
    counts = np.bincount(arrived[arrived <= periods], minlength=periods + 1)
    return np.asarray(np.cumsum(counts) / n_all)


def _drive(
    study: Study, expert: str, repetition: int, greedy: IntArray
) -> tuple[list[Row], list[Move]]:
    """Results and moves of the episodes of one policy."""
    seed = world_seed(study.settings.seed, expert, repetition, Purpose.MEASUREMENT)
    drives = drive_in(
        study.scenario,
        study.problem,
        study.settings.planner,
        PolicyDriver(study.problem.grid, study.policy_of(greedy), seed=seed),
        seed=seed,
        starts=[(number, TRAIN_AREA) for number in range(n_episodes(study.settings, expert))],
    )
    rows: list[Row] = [
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
    return rows, counted_moves(drives.decisions)
