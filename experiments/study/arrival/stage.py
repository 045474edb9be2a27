"""Times of arrival of the learned policies: predicted by model, sampled from it, and measured.

Each repetition's models drive a share of the episodes, in worlds that are the same for every
method. Predictions come from the absorbing chain of the greedy policy under the learned dynamics.
Measured times are rounded up to whole decision periods, the resolution of the model. The moves of
the measured drives are kept beside them, for `hindsight`.
"""

import json
import math
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.running.tables import Row
from experiments.study.fits.fitting import load_fits
from experiments.study.products import Task
from experiments.study.recordings.demonstrations import n_repetitions
from experiments.study.recordings.drives import drive_episodes
from experiments.study.recordings.experts import EXPERTS, PEOPLE
from experiments.study.recordings.moves import Move, counted_moves
from experiments.study.recordings.seeds import Purpose, world_seed
from experiments.study.settings import StudySettings
from experiments.study.world import TRAIN_AREA, problem_of, scenario_of, start_shares
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import arrival_time_distribution
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.demonstrations.trajectories import trajectories_of
from serd_core.grid.navigation import NavigationProblem
from sim.drivers.policy_driver import PolicyDriver
from sim.scenario.scenario import Scenario
from storage.files import atomic_write_text


def arrival_tasks(settings: StudySettings, folder: Path, fits: Path) -> tuple[Task, ...]:
    """One file per expert and repetition."""
    return tuple(
        Task(
            arrival_file(folder, expert, repetition),
            partial(arrivals_of_repetition, settings, expert, repetition, fits),
        )
        for expert in EXPERTS
        for repetition in range(n_repetitions(settings, expert))
    )


def arrival_file(folder: Path, expert: str, repetition: int) -> Path:
    """Where the arrivals of a repetition are kept."""
    return folder / f"{expert}_{repetition:02d}.json"


def load_arrivals(folder: Path, expert: str, repetition: int) -> dict[str, Any]:
    """predicted: one record per method; measured: one row per method and episode.

    moves: of each method, what happened in its measured drives, counted.
    """
    content: dict[str, Any] = json.loads(arrival_file(folder, expert, repetition).read_text())
    return content


def n_episodes(settings: StudySettings, expert: str) -> int:
    """Episodes that one repetition's model of one method drives."""
    wanted = (settings.arrival if expert == PEOPLE else settings.beliefs).episodes
    return math.ceil(wanted / n_repetitions(settings, expert))


def n_periods(scenario: Scenario) -> int:
    """Whole decision periods of an episode's time limit."""
    return math.floor(scenario.episode_timeout_s / scenario.decision_period_s)


def arrivals_of_repetition(
    settings: StudySettings, expert: str, repetition: int, fits: Path, file: Path
) -> None:
    """Predict and measure for the models of every method."""
    scenario, problem = scenario_of(settings), problem_of(settings)
    models = load_fits(fits, expert, repetition)["models"]
    rng = np.random.default_rng([settings.seed, EXPERTS.index(expert), repetition])
    predicted = {
        name: predict(settings, scenario, problem, model, rng) for name, model in models.items()
    }
    measured: list[Row] = []
    moves: dict[str, list[Move]] = {}
    driven: dict[tuple[int, ...], _Driven] = {}
    for name, model in models.items():
        greedy = tuple(model["greedy"])
        # Equal policies drive alike in equal worlds, so each drives once.
        if greedy not in driven:
            driven[greedy] = _drive(settings, scenario, problem, expert, repetition, greedy)
        measured += [{"method": name} | row for row in driven[greedy].rows]
        moves[name] = driven[greedy].moves
    content = {"predicted": predicted, "measured": measured, "moves": moves}
    atomic_write_text(file, json.dumps(content))


def predict(
    settings: StudySettings,
    scenario: Scenario,
    problem: NavigationProblem,
    model: dict[str, Any],
    rng: np.random.Generator,
) -> Row:
    """CDF by whole periods from the chain and from sampled trajectories, and what each costs."""
    policy = np.eye(problem.mdp.n_actions)[np.array(model["greedy"])]
    truth = np.array(model["truth"])
    starts, periods = start_shares(scenario, problem, TRAIN_AREA), n_periods(scenario)
    began_s = time.perf_counter()
    chain = arrival_time_distribution(problem, policy, truth, starts, periods)
    between_s = time.perf_counter()
    sampled = sampled_cdf(problem, policy, truth, starts, periods, settings.arrival.sampled, rng)
    ended_s = time.perf_counter()
    return {
        "cdf": chain.cdf.tolist(),
        "arrival_probability": chain.arrival_probability,
        "chain_ms": 1e3 * (between_s - began_s),
        "sampled_cdf": sampled.tolist(),
        "sampled_ms": 1e3 * (ended_s - between_s),
    }


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


@dataclass(frozen=True)
class _Driven:
    """Results of the episodes of one policy."""

    rows: list[Row]
    moves: list[Move]


def _drive(
    settings: StudySettings,
    scenario: Scenario,
    problem: NavigationProblem,
    expert: str,
    repetition: int,
    greedy: tuple[int, ...],
) -> _Driven:
    seed = world_seed(settings.seed, expert, repetition, Purpose.MEASUREMENT)
    policy = np.eye(problem.mdp.n_actions)[np.array(greedy)]
    drives = drive_episodes(
        scenario,
        problem,
        PolicyDriver(problem.grid, policy, seed=seed),
        planner=settings.planner,
        seed=seed,
        episodes=range(n_episodes(settings, expert)),
        start_area=TRAIN_AREA,
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
    return _Driven(rows, counted_moves(drives.decisions))
