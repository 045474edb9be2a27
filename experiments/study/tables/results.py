"""Results of all stages as tables over all repetitions."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.running.tables import Row
from experiments.study.arrival.distances import ArrivalTables
from experiments.study.arrival.stage import (
    load_arrivals,
    measured_cdf,
    n_episodes,
    n_periods,
)
from experiments.study.fits.fitting import load_fits
from experiments.study.recordings.demonstrations import load_sets, n_repetitions
from experiments.study.recordings.experts import EXPERTS
from experiments.study.recordings.moves import Move, counted_moves
from experiments.study.settings import StudySettings
from experiments.study.world import problem_of, scenario_of
from serd_core.grid.navigation import NavigationProblem
from sim.scenario.scenario import Scenario


@dataclass(frozen=True)
class Results:
    """The finished stages of a folder."""

    settings: StudySettings
    folder: Path

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario of the study."""
        return scenario_of(self.settings)

    @cached_property
    def problem(self) -> NavigationProblem:
        """The decision problem of the study."""
        return problem_of(self.settings)

    @cached_property
    def measures(self) -> pd.DataFrame:
        """Fig. 5.9's rows: expert, repetition, size, method."""
        return pd.DataFrame([row for fits in self._fits.values() for row in fits["measures"]])

    @cached_property
    def candidates(self) -> pd.DataFrame:
        """Fig. 5.8's rows: repetition, size, lambda."""
        return pd.DataFrame([row for fits in self._fits.values() for row in fits["candidates"]])

    @cached_property
    def measured(self) -> pd.DataFrame:
        """One row per measured episode."""
        return pd.DataFrame([row for found in self._arrivals.values() for row in found["measured"]])

    def methods(self, expert: str) -> list[str]:
        """Names of what was compared on an expert, in their order."""
        return list(self._fits[expert, 0]["models"])

    def model(self, expert: str, repetition: int, method: str) -> dict[str, Any]:
        """A learned model of the largest size: greedy, truth, reward_weights."""
        found: dict[str, Any] = self._fits[expert, repetition]["models"][method]
        return found

    def predictions(self, expert: str, method: str) -> list[Row]:
        """The prediction of each repetition's model."""
        every = range(n_repetitions(self.settings, expert))
        return [self._arrivals[expert, number]["predicted"][method] for number in every]

    def moves(self, expert: str, method: str) -> list[Sequence[int]]:
        """What happened in measured drives, as rows of `Move`, of all repetitions that kept it."""
        every = range(n_repetitions(self.settings, expert))
        kept = [self._arrivals[expert, number].get("moves", {}) for number in every]
        return [row for moves in kept for row in moves.get(method, [])]

    def demonstrated(self, expert: str) -> list[Move]:
        """What happened in the training demonstrations of all repetitions, counted."""
        every = range(n_repetitions(self.settings, expert))
        folder = self.folder / "demonstrations"
        return [
            move
            for number in every
            for move in counted_moves(load_sets(folder, expert, number).training)
        ]

    def arrival_tables(self, expert: str, method: str) -> ArrivalTables:
        """Predicted and measured CDFs of each repetition's model."""
        period_s, periods = self.scenario.decision_period_s, n_periods(self.scenario)
        rows = self.measured[(self.measured[["expert", "method"]] == [expert, method]).all(axis=1)]
        measured = [
            measured_cdf(driven, period_s, periods) for _, driven in rows.groupby("repetition")
        ]
        return ArrivalTables(
            predicted=np.array([each["cdf"] for each in self.predictions(expert, method)]),
            measured=np.array(measured),
            n_episodes=n_episodes(self.settings, expert),
            period_s=period_s,
        )

    @cached_property
    def _fits(self) -> dict[tuple[str, int], dict[str, Any]]:
        return {key: load_fits(self.folder / "fits", *key) for key in self._keys}

    @cached_property
    def _arrivals(self) -> dict[tuple[str, int], dict[str, Any]]:
        return {key: load_arrivals(self.folder / "arrival", *key) for key in self._keys}

    @cached_property
    def _keys(self) -> list[tuple[str, int]]:
        return [
            (expert, number)
            for expert in EXPERTS
            for number in range(n_repetitions(self.settings, expert))
        ]
